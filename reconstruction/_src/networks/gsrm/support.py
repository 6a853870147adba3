"""Whether samples lie on a face: what tells a gap in the topology from a hole in the data."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.base.range_checks import check_all_positive
from reconstruction._src.geometry.rows import cross_rows, find_lengths
from reconstruction._src.networks.gsrm.growth import Level


@dataclass(frozen=True)
class TopologyConfig:
    """How faces are learned, and which holes are closed. Lengths are in sample spacings.

    Attributes:
        gap: a place farther than this from all samples is void, that is, no surface was seen there: a hole wider than
            four spacings. Lower, and gaps of uneven sampling become holes; higher, and small holes of the surface are
            closed.
        max_void: a face or patch whose void is larger spans a hole, in squared sample spacings; half a disc of the
            radius `gap`.
        min_cover: a face over which this share of the expected samples lies cuts a corner of the surface and has
            no void.
        min_patch_cover: likewise for the patches of `max_tip_edges`, which may reach far: with less, a hole in
            the data would be covered.
        few_samples: a unit that wins fewer samples may not see all its edges; places between it and its neighbors
            then count as samples where there are samples near them.
        num_neighbors: nearest units to which such a unit may be joined; six in a regular map.
        rim_neighbors: likewise at the boundary (the rim) of a component, between components.
        max_hole_edges: longer boundary loops are the boundary of the surface, not holes.
        max_tip_edges: longer loops are not tested for sharp tips and ridges.
        rim_cosine: a loop whose area vector lies against the normals next to it by more than this cosine runs
            around a piece of surface and not around a gap in it.
        max_folded: a patch of which a larger share of the faces is folded back is a second layer of the surface.
        reversed_cost: cost of a face that lies against the surface around it; well-shaped faces cost 0.5, slivers 1.
        min_component: components of fewer faces are debris, where another is `debris_ratio` times as large.
        debris_ratio: see `min_component`.
        max_repairs: rounds in which faces around a hole that cannot be closed are removed to close a larger one.
    """

    gap: float = 2.0
    max_void: float = 6.0
    min_cover: float = 0.2
    min_patch_cover: float = 0.75
    few_samples: int = 10
    num_neighbors: int = 6
    rim_neighbors: int = 24
    max_hole_edges: int = 24
    max_tip_edges: int = 64
    rim_cosine: float = -0.5
    max_folded: float = 0.3
    reversed_cost: float = 10.0
    min_component: int = 6
    debris_ratio: int = 50
    max_repairs: int = 6

    def __post_init__(self) -> None:
        check_all_positive(self, any_sign=("rim_cosine",))


_PLACES = (
    np.array([[4, 4, 4], [8, 2, 2], [2, 8, 2], [2, 2, 8], [2, 5, 5], [5, 2, 5], [5, 5, 2]], dtype=np.float64)
    / 12
)
"""Barycentric coordinates of seven places spread evenly over a face."""
_DEFAULT = TopologyConfig()


class Support:
    """The samples, prepared for queries whether they support a face.

    Attributes:
        config: what decides that.
        is_uneven: whether the cloud's density varies, as scan lines' does.
    """

    def __init__(
        self,
        tree: cKDTree,
        spacings: Float[np.ndarray, " N"],
        config: TopologyConfig = _DEFAULT,
        *,
        is_uneven: bool = False,
    ) -> None:
        """Keep the samples."""
        self.config = config
        self._tree = tree
        self._spacings = np.maximum(spacings, np.finfo(float).tiny ** 0.25)  # samples may coincide
        self.is_uneven = is_uneven

    def measure_void(
        self, corners: Float[np.ndarray, "F 3 3"], min_cover: float | None = None
    ) -> Float[np.ndarray, " F"]:
        """Return how much of each face is far from all samples, in squared spacings."""
        min_cover = self.config.min_cover if min_cover is None else min_cover
        places = np.einsum("pk,fki->fpi", _PLACES, corners)
        distances, nearest = self._tree.query(places)
        is_void = distances > self.config.gap * self._spacings[nearest]
        cross = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        expected = find_lengths(cross) / 2 / self._spacings[nearest].mean(axis=1) ** 2
        void = expected * is_void.mean(axis=1)
        for face in np.flatnonzero(void):
            if self._count_over(corners[face]) >= max(1, min_cover * expected[face]):
                void[face] = 0
        return void

    def is_near(self, places: Float[np.ndarray, "Q 3"]) -> Bool[np.ndarray, " Q"]:
        """Return which places have a sample nearer than a gap."""
        distances, nearest = self._tree.query(places)
        return distances <= self.config.gap * self._spacings[nearest]

    def _count_over(self, corners: Float[np.ndarray, "3 3"]) -> int:
        """Count the samples within a face's reach whose foot lies in it."""
        middle = corners.mean(axis=0)
        radius = find_lengths(corners - middle).max()
        offset = self._tree.data[self._tree.query_ball_point(middle, radius)] - corners[0]
        side, other = corners[1] - corners[0], corners[2] - corners[0]
        gram = np.array([[side @ side, side @ other], [side @ other, other @ other]])
        if len(offset) == 0 or np.linalg.det(gram) <= 0:
            return 0
        share = np.linalg.solve(gram, np.stack([offset @ side, offset @ other]))
        return int(((share >= 0).all(axis=0) & (share.sum(axis=0) <= 1)).sum())


def make_support(
    level: Level,
    units: Float[np.ndarray, "U 3"],
    winners: Int[np.ndarray, "T S"],
    config: TopologyConfig = _DEFAULT,
) -> Support:
    """Prepare the samples of a level for queries; outliers support nothing.

    Where units win few samples each, the scan lines are about as far apart as the units: there a gap of two
    units' spacing is no hole yet.
    """
    is_used = level.weights > 0
    spacings = level.spacings
    sparse = find_sparse(winners[is_used], len(units), config.few_samples)
    if len(sparse):
        distances, _ = cKDTree(units).query(units[sparse], k=min(config.num_neighbors, len(units) - 1) + 1)
        widest = np.zeros(len(units))
        widest[sparse] = np.median(distances[:, 1:], axis=1) / 2
        spacings = np.where(is_used, np.maximum(spacings, widest[winners]), spacings)
    is_uneven = bool(np.ptp(level.spacings) > 0)
    if is_used[level.tiles.is_real].all():
        by_sample = np.empty(level.tiles.tree.n)
        by_sample[level.tiles.order[is_used]] = spacings[is_used]
        return Support(level.tiles.tree, by_sample, config, is_uneven=is_uneven)
    return Support(cKDTree(level.tiles.samples[is_used]), spacings[is_used], config, is_uneven=is_uneven)


def find_sparse(winners: Int[np.ndarray, " N"], num_units: int, few_samples: int) -> Int[np.ndarray, " C"]:
    """Return the units that win samples, but fewer than `few_samples`: too few to see all their edges."""
    counts = np.bincount(winners, minlength=num_units)
    return np.flatnonzero((counts > 0) & (counts < few_samples))
