"""The growing self-reconstruction map by its literal rules, one signal after the other.

For comparison and for teaching: some 30 microseconds a signal and more, 200 signals a unit.

References:
    Rêgo, Araújo and Lima Neto (2010), "Growing self-reconstruction maps", IEEE Transactions on Neural
    Networks 21(2): competitive Hebbian learning extended by faces, growth, topology learning, post-processing, whose
    passes follow the program published by one of the paper's authors.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.base.progress import Progress
from reconstruction._src.geometry.manifold import make_winding
from reconstruction._src.geometry.rows import Faces, Points

_MIN_DIHEDRAL = np.deg2rad(45)  # Two faces at an edge that enclose less [rad] are incorrect
_MAX_ANGLE = np.deg2rad(135)  # A face with a larger angle [rad] is incorrect
_MERGE_ANGLE = np.deg2rad(162)
"""Two edges that meet at a larger angle [rad] are nearly straight. All three are those of the program."""

Positions = Float[np.ndarray, "C 3"]


class PaperMesh:
    """The graph of a map.

    Attributes:
        neighbors: for every unit its neighbors, and the age of the edge to each.
        apexes: for every edge (lower unit first) the third corners of its faces, at most two.
        first_end: for every edge the unit that it was drawn from.
    """

    def __init__(self) -> None:
        self.neighbors: list[dict[int, int]] = []
        self.apexes: dict[tuple[int, int], list[int]] = {}
        self.first_end: dict[tuple[int, int], int] = {}

    def add_unit(self) -> int:
        """Add a unit without edges; return its index."""
        self.neighbors.append({})
        return len(self.neighbors) - 1

    def add_edge(self, a: int, b: int) -> None:
        """Join two units by an edge; they must not have one."""
        self.neighbors[a][b] = self.neighbors[b][a] = 0
        edge = _name_edge(a, b)
        self.apexes[edge], self.first_end[edge] = [], a

    def remove_edge(self, a: int, b: int) -> None:
        """Remove the edge between two units, with its faces."""
        edge = _name_edge(a, b)
        for apex in list(self.apexes[edge]):
            self.remove_face(a, b, apex)
        del self.neighbors[a][b], self.neighbors[b][a], self.apexes[edge], self.first_end[edge]

    def has_edge(self, a: int, b: int) -> bool:
        """Return whether two units are joined."""
        return b in self.neighbors[a]

    def count_faces(self, a: int, b: int) -> int:
        """Return how many faces an edge has."""
        return len(self.apexes[_name_edge(a, b)])

    def add_face(self, a: int, b: int, c: int) -> bool:
        """Add a face between three joined units, unless it exists or an edge is full; return whether it was added."""
        edges = {_name_edge(a, b): c, _name_edge(b, c): a, _name_edge(c, a): b}
        if c in self.apexes[_name_edge(a, b)] or any(len(self.apexes[edge]) == 2 for edge in edges):
            return False
        for edge, apex in edges.items():
            self.apexes[edge].append(apex)
        return True

    def remove_face(self, a: int, b: int, c: int) -> None:
        """Remove a face; its edges stay."""
        for u, v, apex in ((a, b, c), (b, c, a), (c, a, b)):
            self.apexes[_name_edge(u, v)].remove(apex)

    def find_common(self, a: int, b: int) -> list[int]:
        """Return the common neighbors of two units, oldest first."""
        return [unit for unit in self.neighbors[a] if unit in self.neighbors[b]]

    def walk_faces(self) -> Iterator[tuple[int, int, int]]:
        """Yield every face once, corners ascending."""
        for (a, b), apexes in self.apexes.items():
            yield from ((a, b, c) for c in apexes if c > b)

    def gather_faces(self) -> Faces:
        """Return the faces, not consistently wound."""
        return np.array(list(self.walk_faces()), dtype=np.int64).reshape(-1, 3)


def patch_mesh(mesh: PaperMesh, positions: Positions) -> None:
    """Clean and close a mesh, in place."""
    drop_incorrect_faces(mesh, positions)
    _drop_incorrect_edges(mesh)
    merge_edges(mesh, positions)
    close_surface(mesh, positions)
    _drop_incorrect_edges(mesh)
    close_surface(mesh, positions)
    _drop_lonely(mesh)
    close_surface(mesh, positions)
    _drop_lonely(mesh)
    _close_triangles(mesh)


def drop_incorrect_faces(mesh: PaperMesh, positions: Positions) -> None:
    """Drop faces with an angle that is too large, and one of two that enclose too small an angle."""

    def rank(a: int, b: int, c: int) -> tuple[int, float]:
        """Return how well a face is embedded: neighbors, then area."""
        shared = sum(mesh.count_faces(u, v) == 2 for u, v in ((a, b), (b, c), (c, a)))
        return shared, float(
            np.linalg.norm(np.cross(positions[b] - positions[a], positions[c] - positions[a]))
        )

    for face in list(mesh.walk_faces()):
        if not _has_fair_angles(positions, *face):
            mesh.remove_face(*face)
    for (a, b), apexes in list(mesh.apexes.items()):
        if len(apexes) == 2 and compute_dihedral(positions, a, b, *apexes) < _MIN_DIHEDRAL:
            mesh.remove_face(a, b, min(apexes, key=lambda c: rank(a, b, c)))


def _drop_incorrect_edges(mesh: PaperMesh) -> None:
    """Drop edges that end in nothing, or at whose first end no second edge is left to make a face with."""

    def is_incorrect(a: int, b: int) -> bool:
        if min(len(mesh.neighbors[a]), len(mesh.neighbors[b])) == 1:
            return True
        first = mesh.first_end[a, b]
        return sum(mesh.count_faces(first, other) < 2 for other in mesh.neighbors[first]) == 1

    has_changed = True
    while has_changed:
        has_changed = False
        for edge in list(mesh.apexes):
            if is_incorrect(*edge):
                mesh.remove_edge(*edge)
                has_changed = True


def merge_edges(mesh: PaperMesh, positions: Positions) -> None:
    """Merge two edges without faces that meet, alone and nearly straight, in one unit."""
    has_changed = True
    while has_changed:
        has_changed = False
        for unit, around in enumerate(mesh.neighbors):
            if len(around) != 2:
                continue
            a, b = around
            if mesh.count_faces(a, unit) or mesh.count_faces(b, unit) or mesh.has_edge(a, b):
                continue
            ways = positions[a] - positions[unit], positions[b] - positions[unit]
            if _compute_angle(*ways) > _MERGE_ANGLE:
                mesh.remove_edge(a, unit)
                mesh.remove_edge(b, unit)
                mesh.add_edge(a, b)
                has_changed = True


def close_surface(mesh: PaperMesh, positions: Positions) -> None:
    """Put faces on border edges until no more fit."""
    has_changed = True
    while has_changed:
        has_changed = False
        for edge in list(mesh.apexes):
            if edge in mesh.apexes and len(mesh.apexes[edge]) == 1:
                is_closed = _close_triangle(mesh, positions, *edge) or _close_corner(mesh, positions, *edge)
                has_changed |= is_closed


def _drop_lonely(mesh: PaperMesh) -> None:
    """Drop faces without a neighbor, then edges without a face."""
    for a, b, c in list(mesh.walk_faces()):
        if all(mesh.count_faces(u, v) == 1 for u, v in ((a, b), (b, c), (c, a))):
            mesh.remove_face(a, b, c)
    for edge in [edge for edge, apexes in mesh.apexes.items() if not apexes]:
        mesh.remove_edge(*edge)


def _close_triangles(mesh: PaperMesh) -> None:
    """Put a face into every triangle of edges that have room."""
    for a, b in list(mesh.apexes):
        for c in mesh.find_common(a, b):
            if mesh.count_faces(a, c) == 1 and mesh.count_faces(b, c) == 1:
                mesh.add_face(a, b, c)
                break


def _close_triangle(mesh: PaperMesh, positions: Positions, a: int, b: int) -> bool:
    """Put a second face on a border edge, with a common neighbor whose edges have room; return whether."""
    apex = mesh.apexes[a, b][0]
    for unit in mesh.find_common(a, b):
        has_room = unit != apex and mesh.count_faces(a, unit) < 2 and mesh.count_faces(b, unit) < 2
        if (
            has_room
            and _has_fair_angles(positions, a, b, unit)
            and compute_dihedral(positions, a, b, apex, unit) >= _MIN_DIHEDRAL
        ):
            return mesh.add_face(a, b, unit)
    return False


def _close_corner(mesh: PaperMesh, positions: Positions, a: int, b: int) -> bool:
    """Put a face between a border edge and the only other one at an end of it; return whether."""
    beyond_a, beyond_b = _find_next(mesh, a, b), _find_next(mesh, b, a)
    if beyond_a is None and beyond_b is None:
        return False
    start, end = (a, beyond_b) if beyond_b is not None else (b, beyond_a)
    assert end is not None
    if start == end or not _close_by_edge(mesh, positions, start, end, (a, b)):
        return False
    if beyond_a is not None and beyond_b is not None and beyond_a != beyond_b:
        _close_by_edge(mesh, positions, beyond_a, beyond_b, _name_edge(start, end))
    return True


def _close_by_edge(
    mesh: PaperMesh, positions: Positions, start: int, end: int, border: tuple[int, int]
) -> bool:
    """Draw an edge, unless it exists, and close the triangle at a border; return whether; undo it where not."""
    is_new = not mesh.has_edge(start, end)
    if is_new:
        mesh.add_edge(start, end)
    is_closed = len(mesh.apexes[border]) == 1 and _close_triangle(mesh, positions, *border)
    if is_new and not is_closed:
        mesh.remove_edge(start, end)
    return is_closed


def _find_next(mesh: PaperMesh, unit: int, coming_from: int) -> int | None:
    """Return where the only other border edge of a unit leads; none if there are more or bare edges."""
    counts = {other: mesh.count_faces(unit, other) for other in mesh.neighbors[unit]}
    found = [other for other, count in counts.items() if count == 1 and other != coming_from]
    return found[0] if len(found) == 1 and 0 not in counts.values() else None


def _has_fair_angles(positions: Positions, a: int, b: int, c: int) -> bool:
    """Return whether no angle of a face is too large."""
    return all(
        _compute_angle(positions[v] - positions[u], positions[w] - positions[u]) <= _MAX_ANGLE
        for u, v, w in ((a, b, c), (b, c, a), (c, a, b))
    )


def compute_dihedral(positions: Positions, a: int, b: int, c: int, d: int) -> float:
    """Return the angle [rad] between the faces a b c and a b d at their common edge; pi where flat."""
    along = positions[b] - positions[a]
    along = along / max(float(np.linalg.norm(along)), 1e-300)
    left, right = positions[c] - positions[a], positions[d] - positions[a]
    return _compute_angle(left - (left @ along) * along, right - (right @ along) * along)


def _compute_angle(first: Float[np.ndarray, " 3"], second: Float[np.ndarray, " 3"]) -> float:
    """Return the angle between two vectors [rad]."""
    length = float(np.sqrt((first @ first) * (second @ second)))
    return float(np.arccos(np.clip((first @ second) / max(length, 1e-300), -1, 1)))


def _name_edge(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


_FAR = 1e9  # Where the slots of removed units lie: they win nothing
_SPARE_SLOTS = 64  # Slots beyond those for the wanted units; removed units keep theirs
_MAX_INSERTIONS = 4
"""Insertions for each wanted unit after which growth ends, as units may be removed as fast as they are inserted."""


@dataclass(frozen=True)
class Rates:
    """The rules' constants, as published."""

    insertion_period: int = 200  # signals between two new units (lambda)
    winner_rate: float = 0.05  # how far the winner moves towards the signal (eps_b)
    neighbor_rate: float = 0.0006  # how far its neighbors move (eps_n)
    split_decay: float = 0.95  # factor on the errors of the two units that a new one comes between (alpha)
    error_decay: float = 0.9995  # factor on all errors at every signal (beta)
    # an edge is removed after this many signals of its units that did not confirm it (age_max)
    max_age: int = 200


class PaperMap:
    """A map that learns signal by signal.

    Attributes:
        mesh: units, edges and faces; units without edges have been removed.
        positions: `[C, 3]` reference vectors; removed ones lie far away.
        errors: `[C]` accumulated squared distances, below zero where removed.
        num_alive: how many units there are.
    """

    def __init__(self, start: Float[np.ndarray, "S 3"], capacity: int, rates: Rates) -> None:
        self.rates = rates
        self.mesh = PaperMesh()
        self.positions = np.full((capacity, 3), _FAR)
        self.errors = np.full(capacity, -1.0)
        self.num_alive = 0
        for position in start:
            self._add_unit(position, 0.0)

    def learn(self, signal: Float[np.ndarray, " 3"]) -> None:
        """Adapt to one signal (steps 2 to 6): join the winners, move, age."""
        num_slots = len(self.mesh.neighbors)
        offset = self.positions[:num_slots] - signal
        squared = np.einsum("uk,uk->u", offset, offset)
        winner = int(squared.argmin())
        squared[winner] = np.inf
        join_winners(self.mesh, self.positions, winner, int(squared.argmin()))
        self.positions[winner] += self.rates.winner_rate * (signal - self.positions[winner])
        offset = signal - self.positions[winner]
        self.errors[winner] += offset @ offset
        self.errors[:num_slots] *= self.rates.error_decay
        around = list(self.mesh.neighbors[winner])
        self.positions[around] += self.rates.neighbor_rate * (signal - self.positions[around])
        self._age_edges(winner)

    def insert_unit(self) -> None:
        """Put a unit between the one of largest error and its worst neighbor (step 7)."""
        worst = int(self.errors.argmax())
        around = list(self.mesh.neighbors[worst])
        if not around:
            return
        neighbor = around[int(self.errors[around].argmax())]
        self.mesh.remove_edge(worst, neighbor)
        self.errors[[worst, neighbor]] *= self.rates.split_decay
        middle = (self.positions[worst] + self.positions[neighbor]) / 2
        unit = self._add_unit(middle, float(self.errors[[worst, neighbor]].mean()))
        self.mesh.add_edge(worst, unit)
        self.mesh.add_edge(neighbor, unit)

    def _add_unit(self, position: Float[np.ndarray, " 3"], error: float) -> int:
        unit = self.mesh.add_unit()
        if unit == len(self.positions):
            self.positions = np.concatenate([self.positions, np.full_like(self.positions, _FAR)])
            self.errors = np.concatenate([self.errors, np.full_like(self.errors, -1.0)])
        self.positions[unit], self.errors[unit] = position, error
        self.num_alive += 1
        return unit

    def _age_edges(self, winner: int) -> None:
        """Age the winner's edges; remove those too old, and units that lose their last."""
        ages = self.mesh.neighbors[winner]
        for neighbor in list(ages):
            ages[neighbor] += 1
            self.mesh.neighbors[neighbor][winner] = ages[neighbor]
            if ages[neighbor] > self.rates.max_age:
                self.mesh.remove_edge(winner, neighbor)
                if not self.mesh.neighbors[neighbor]:
                    self._remove_unit(neighbor)
        if not ages:
            self._remove_unit(winner)

    def _remove_unit(self, unit: int) -> None:
        self.positions[unit], self.errors[unit] = _FAR, -1.0
        self.num_alive -= 1


def join_winners(mesh: PaperMesh, positions: Float[np.ndarray, "C 3"], first: int, second: int) -> None:
    """Confirm or draw the edge between two winners (steps 3 and 4), with its faces.

    An edge that a common neighbor sees at more than 90 degrees (within the ball of Thales) is removed. A new edge
    replaces those between common neighbors, and gets faces with the first two of these.
    """
    common = mesh.find_common(first, second)
    if mesh.has_edge(first, second):
        mesh.neighbors[first][second] = mesh.neighbors[second][first] = 0
        for unit in common:
            if (positions[first] - positions[unit]) @ (positions[second] - positions[unit]) < 0:
                mesh.remove_edge(first, second)
                return
        return
    for place, unit in enumerate(common):
        for other in common[place + 1 :]:
            if mesh.has_edge(unit, other):
                mesh.remove_edge(unit, other)
    mesh.add_edge(first, second)
    for unit in common[:2]:
        mesh.add_face(first, second, unit)


def train(
    points: Points, num_units: int, rng: np.random.Generator, progress: Progress
) -> tuple[Float[np.ndarray, "U 3"], Faces]:
    """Grow a map by the literal rules, learn its topology again, patch it."""
    rates = Rates()
    order = rng.permutation(len(points))
    network, place = PaperMap(points[order[:3]], num_units + _SPARE_SLOTS, rates), 3
    for _ in range(_MAX_INSERTIONS * num_units):
        for _ in range(rates.insertion_period):
            if place == len(points):
                order, place = rng.permutation(len(points)), 0
            network.learn(points[order[place]])
            place += 1
        network.insert_unit()
        if network.num_alive >= num_units:
            break
        if network.num_alive % 16 == 0:
            progress("grow", 0.9 * network.num_alive / num_units)
    progress("learn the topology", 0.9)
    _, winners = cKDTree(network.positions[: len(network.mesh.neighbors)]).query(points[order], k=2)
    for first, second in winners.tolist():
        join_winners(network.mesh, network.positions, first, second)
    patch_mesh(network.mesh, network.positions)
    faces = network.mesh.gather_faces()
    used, flat = np.unique(faces, return_inverse=True)
    units = network.positions[used]
    return units, make_winding(units, flat.reshape(-1, 3))
