"""Units, edges and faces under the sequential rules: every edge has an age and at most two faces."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Int

Edge = tuple[int, int]


def edge_of(a: int, b: int) -> Edge:
    """Return the name of the edge between two units."""
    return (a, b) if a < b else (b, a)


class PaperMesh:
    """The graph of a map.

    Attributes:
        neighbors: for every unit its neighbors, and the age of the edge to each.
        apexes: for every edge the third corners of its faces, at most two.
        first_end: for every edge the unit that it was drawn from.
    """

    def __init__(self) -> None:
        """Create a graph without units."""
        self.neighbors: list[dict[int, int]] = []
        self.apexes: dict[Edge, list[int]] = {}
        self.first_end: dict[Edge, int] = {}

    def add_unit(self) -> int:
        """Add a unit without edges; return its index."""
        self.neighbors.append({})
        return len(self.neighbors) - 1

    def add_edge(self, a: int, b: int) -> None:
        """Join two units by an edge; they must not have one."""
        self.neighbors[a][b] = self.neighbors[b][a] = 0
        self.apexes[edge_of(a, b)] = []
        self.first_end[edge_of(a, b)] = a

    def remove_edge(self, a: int, b: int) -> None:
        """Remove the edge between two units, with its faces."""
        for apex in list(self.apexes[edge_of(a, b)]):
            self.remove_face(a, b, apex)
        del self.neighbors[a][b], self.neighbors[b][a]
        del self.apexes[edge_of(a, b)], self.first_end[edge_of(a, b)]

    def has_edge(self, a: int, b: int) -> bool:
        """Return whether two units are joined."""
        return b in self.neighbors[a]

    def count_faces(self, a: int, b: int) -> int:
        """Return how many faces an edge has."""
        return len(self.apexes[edge_of(a, b)])

    def add_face(self, a: int, b: int, c: int) -> bool:
        """Add a face between three joined units, unless it exists or an edge is full; return whether it was added."""
        sides = ((a, b, c), (b, c, a), (c, a, b))
        if c in self.apexes[edge_of(a, b)] or any(self.count_faces(u, v) == 2 for u, v, _ in sides):
            return False
        for u, v, apex in sides:
            self.apexes[edge_of(u, v)].append(apex)
        return True

    def remove_face(self, a: int, b: int, c: int) -> None:
        """Remove a face; its edges stay."""
        for u, v, apex in ((a, b, c), (b, c, a), (c, a, b)):
            self.apexes[edge_of(u, v)].remove(apex)

    def find_common(self, a: int, b: int) -> list[int]:
        """Return the common neighbors of two units, oldest first."""
        other = self.neighbors[b]
        return [unit for unit in self.neighbors[a] if unit in other]

    def walk_faces(self) -> Iterator[tuple[int, int, int]]:
        """Yield every face once, corners ascending."""
        for (a, b), apexes in self.apexes.items():
            for c in apexes:
                if c > b:
                    yield a, b, c

    def gather_faces(self) -> Int[np.ndarray, "F 3"]:
        """Return the faces, not consistently wound."""
        return np.array(list(self.walk_faces()), dtype=np.int64).reshape(-1, 3)
