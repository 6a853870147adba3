"""The growing self-reconstruction map by its literal rules, one signal after the other.

For comparison and for teaching: some 30 microseconds a signal and more, 200 signals a unit.

References:
    Rêgo, Araújo and Lima Neto (2010), "Growing self-reconstruction maps", IEEE Transactions on Neural
    Networks 21(2): competitive Hebbian learning extended by faces, growth, topology learning.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.base.progress import Progress
from reconstruction._src.geometry.manifold import make_winding
from reconstruction._src.geometry.rows import Faces, Points
from reconstruction._src.networks.gsrm.paper_patching import PaperMesh, patch_mesh

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
        """Start with a few units without edges."""
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
