"""Hole patching by the sequential rules: incorrect faces and edges go, open triangles close.

References:
    Rêgo, Araújo and Lima Neto (2010), post-processing; the order of its passes follows the program published
    by one of the paper's authors.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.rows import Faces

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

    def gather_faces(self) -> Faces:
        """Return the faces, not consistently wound."""
        return np.array(list(self.walk_faces()), dtype=np.int64).reshape(-1, 3)


MIN_DIHEDRAL = np.deg2rad(45)  # Two faces at an edge that enclose less [rad] are incorrect
MAX_ANGLE = np.deg2rad(135)  # A face with a larger angle [rad] is incorrect
MERGE_ANGLE = np.deg2rad(162)
"""Two edges that meet at a larger angle [rad] are nearly straight. All three are those of the program."""


def patch_mesh(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"]) -> None:
    """Clean and close a mesh, in place."""
    drop_incorrect_faces(mesh, positions)
    drop_incorrect_edges(mesh)
    merge_edges(mesh, positions)
    close_surface(mesh, positions)
    drop_incorrect_edges(mesh)
    close_surface(mesh, positions)
    drop_lonely(mesh)
    close_surface(mesh, positions)
    drop_lonely(mesh)
    close_triangles(mesh)


def drop_incorrect_faces(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"]) -> None:
    """Drop faces with an angle that is too large, and one of two that enclose too small an angle."""
    for a, b, c in list(mesh.walk_faces()):
        if not has_fair_angles(positions, a, b, c):
            mesh.remove_face(a, b, c)
    for (a, b), apexes in list(mesh.apexes.items()):
        if len(apexes) == 2 and compute_dihedral(positions, a, b, *apexes) < MIN_DIHEDRAL:
            mesh.remove_face(a, b, min(apexes, key=lambda c: _rank_face(mesh, positions, a, b, c)))


def drop_incorrect_edges(mesh: PaperMesh) -> None:
    """Drop edges that end in nothing, or at whose first end no second edge is left to make a face with."""
    while _drop_edges_once(mesh):
        pass


def _drop_edges_once(mesh: PaperMesh) -> bool:
    """Drop the incorrect edges there are; return whether there were any."""
    has_changed = False
    for edge in list(mesh.apexes):
        a, b = edge
        is_dangling = min(len(mesh.neighbors[a]), len(mesh.neighbors[b])) == 1
        if is_dangling or _count_open(mesh, mesh.first_end[edge]) == 1:
            mesh.remove_edge(a, b)
            has_changed = True
    return has_changed


def merge_edges(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"]) -> None:
    """Merge two edges without faces that meet, alone and nearly straight, in one unit."""
    while _merge_once(mesh, positions):
        pass


def _merge_once(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"]) -> bool:
    """Merge the edges that can be; return whether there were any."""
    has_changed = False
    for unit, around in enumerate(mesh.neighbors):
        if len(around) != 2:
            continue
        a, b = around
        if mesh.count_faces(a, unit) or mesh.count_faces(b, unit) or mesh.has_edge(a, b):
            continue
        if _compute_angle(positions[a] - positions[unit], positions[b] - positions[unit]) > MERGE_ANGLE:
            mesh.remove_edge(a, unit)
            mesh.remove_edge(b, unit)
            mesh.add_edge(a, b)
            has_changed = True
    return has_changed


def close_surface(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"]) -> None:
    """Put faces on border edges until no more fit."""
    has_changed = True
    while has_changed:
        has_changed = False
        for edge in list(mesh.apexes):
            if edge in mesh.apexes and len(mesh.apexes[edge]) == 1:
                has_changed |= _close_triangle(mesh, positions, *edge) or _close_corner(
                    mesh, positions, *edge
                )


def drop_lonely(mesh: PaperMesh) -> None:
    """Drop faces without a neighbor, then edges without a face."""
    for a, b, c in list(mesh.walk_faces()):
        if all(mesh.count_faces(u, v) == 1 for u, v in ((a, b), (b, c), (c, a))):
            mesh.remove_face(a, b, c)
    for (a, b), apexes in list(mesh.apexes.items()):
        if not apexes:
            mesh.remove_edge(a, b)


def close_triangles(mesh: PaperMesh) -> None:
    """Put a face into every triangle of edges that have room."""
    for a, b in list(mesh.apexes):
        for c in mesh.find_common(a, b):
            if mesh.count_faces(a, c) == 1 and mesh.count_faces(b, c) == 1:
                mesh.add_face(a, b, c)
                break


def has_fair_angles(positions: Float[np.ndarray, "C 3"], a: int, b: int, c: int) -> bool:
    """Return whether no angle of a face is too large."""
    return all(
        _compute_angle(positions[v] - positions[u], positions[w] - positions[u]) <= MAX_ANGLE
        for u, v, w in ((a, b, c), (b, c, a), (c, a, b))
    )


def compute_dihedral(positions: Float[np.ndarray, "C 3"], a: int, b: int, c: int, d: int) -> float:
    """Return the angle [rad] between the faces a b c and a b d at their common edge; pi where flat."""
    along = positions[b] - positions[a]
    along = along / max(float(np.linalg.norm(along)), 1e-300)
    left, right = positions[c] - positions[a], positions[d] - positions[a]
    return _compute_angle(left - (left @ along) * along, right - (right @ along) * along)


def _close_triangle(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"], a: int, b: int) -> bool:
    """Put a second face on a border edge, with a common neighbor whose edges have room; return whether."""
    apex = mesh.apexes[(a, b)][0]
    for unit in mesh.find_common(a, b):
        if (
            unit != apex
            and mesh.count_faces(a, unit) < 2
            and mesh.count_faces(b, unit) < 2
            and has_fair_angles(positions, a, b, unit)
            and compute_dihedral(positions, a, b, apex, unit) >= MIN_DIHEDRAL
        ):
            return mesh.add_face(a, b, unit)
    return False


def _close_corner(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"], a: int, b: int) -> bool:
    """Put a face between a border edge and the only other one at an end of it; return whether."""
    beyond_a, beyond_b = _find_next(mesh, a, b), _find_next(mesh, b, a)
    if beyond_a is None and beyond_b is None:
        return False
    start, end = (a, beyond_b) if beyond_b is not None else (b, beyond_a)
    assert end is not None
    if start == end:
        return False
    is_new = not mesh.has_edge(start, end)
    if is_new:
        mesh.add_edge(start, end)
    if not _close_triangle(mesh, positions, a, b):
        if is_new:
            mesh.remove_edge(start, end)
        return False
    if beyond_a is None or beyond_b is None or beyond_a == beyond_b:
        return True
    is_new = not mesh.has_edge(beyond_a, beyond_b)
    if is_new:
        mesh.add_edge(beyond_a, beyond_b)
    low, high = min(start, end), max(start, end)
    is_closed = len(mesh.apexes[(low, high)]) == 1 and _close_triangle(mesh, positions, low, high)
    if not is_closed and is_new:
        mesh.remove_edge(beyond_a, beyond_b)
    return True


def _find_next(mesh: PaperMesh, unit: int, coming_from: int) -> int | None:
    """Return where the only other border edge of a unit leads; none if there are more or bare edges."""
    found = None
    for neighbor in mesh.neighbors[unit]:
        count = mesh.count_faces(unit, neighbor)
        if count == 0:
            return None
        if count == 1 and neighbor != coming_from:
            if found is not None:
                return None
            found = neighbor
    return found


def _count_open(mesh: PaperMesh, unit: int) -> int:
    """Return how many edges of a unit have room for a face."""
    return sum(mesh.count_faces(unit, neighbor) < 2 for neighbor in mesh.neighbors[unit])


def _rank_face(
    mesh: PaperMesh, positions: Float[np.ndarray, "C 3"], a: int, b: int, c: int
) -> tuple[int, float]:
    """Return how well a face is embedded: neighbors, then area."""
    shared = sum(mesh.count_faces(u, v) == 2 for u, v in ((a, b), (b, c), (c, a)))
    side, other = positions[b] - positions[a], positions[c] - positions[a]
    return shared, float(np.linalg.norm(np.cross(side, other)))


def _compute_angle(first: Float[np.ndarray, " 3"], second: Float[np.ndarray, " 3"]) -> float:
    """Return the angle between two vectors [rad]."""
    length = float(np.sqrt((first @ first) * (second @ second)))
    return float(np.arccos(np.clip((first @ second) / max(length, 1e-300), -1, 1)))
