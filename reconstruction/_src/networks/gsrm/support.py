"""Whether samples lie on a face: what tells a gap in the topology from a hole in the data."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import compute_lengths, cross_rows
from reconstruction._src.networks.gsrm.growth import Level

Units = Float[np.ndarray, "U 3"]  # Reference vectors

_TOPOLOGY_GAP = 2.0
"""A place farther than this from all samples is void, that is, no surface was seen there: a hole wider than
four spacings. Lower, and gaps of uneven sampling become holes; higher, and small holes of the surface are
closed."""
MAX_VOID = 6.0
"""A face or patch whose void is larger spans a hole, in squared sample spacings; half a disc of the radius
`gap`."""
_MIN_COVER = 0.2
"""A face over which this share of the expected samples lies cuts a corner of the surface and has no void."""
_FEW_SAMPLES = 10
"""A unit that wins fewer samples may not see all its edges; places between it and its neighbors then count as
samples where there are samples near them."""
NUM_NEIGHBORS = 6  # Nearest units to which such a unit may be joined; six in a regular map
_PLACES = (
    np.array([[4, 4, 4], [8, 2, 2], [2, 8, 2], [2, 2, 8], [2, 5, 5], [5, 2, 5], [5, 5, 2]], dtype=np.float64)
    / 12
)
"""Barycentric coordinates of seven places spread evenly over a face."""


class Support:
    """The samples, prepared for queries whether they support a face.

    Attributes:
        is_uneven: whether the cloud's density varies, as scan lines' does.
    """

    def __init__(self, tree: cKDTree, spacings: Float[np.ndarray, " N"], is_uneven: bool = False) -> None:
        self._tree = tree
        self._spacings = np.maximum(spacings, np.finfo(float).tiny ** 0.25)  # samples may coincide
        self.is_uneven = is_uneven

    def measure_void(
        self, corners: Float[np.ndarray, "F 3 3"], min_cover: float = _MIN_COVER
    ) -> Float[np.ndarray, " F"]:
        """Return how much of each face is far from all samples, in squared spacings."""
        places = np.einsum("pk,fki->fpi", _PLACES, corners)
        distances, nearest = self._tree.query(places)
        is_void = distances > _TOPOLOGY_GAP * self._spacings[nearest]
        cross = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        expected = compute_lengths(cross) / 2 / self._spacings[nearest].mean(axis=1) ** 2
        void = expected * is_void.mean(axis=1)
        for face in np.flatnonzero(void):
            if self._count_over(corners[face]) >= max(1, min_cover * expected[face]):
                void[face] = 0
        return void

    def is_near(self, places: Float[np.ndarray, "Q 3"]) -> Bool[np.ndarray, " Q"]:
        """Return which places have a sample nearer than a gap."""
        distances, nearest = self._tree.query(places)
        return distances <= _TOPOLOGY_GAP * self._spacings[nearest]

    def _count_over(self, corners: Float[np.ndarray, "3 3"]) -> int:
        """Count the samples within a face's reach whose foot lies in it."""
        middle = corners.mean(axis=0)
        radius = compute_lengths(corners - middle).max()
        offset = self._tree.data[self._tree.query_ball_point(middle, radius)] - corners[0]
        side, other = corners[1] - corners[0], corners[2] - corners[0]
        gram = np.array([[side @ side, side @ other], [side @ other, other @ other]])
        if len(offset) == 0 or np.linalg.det(gram) <= 0:
            return 0
        share = np.linalg.solve(gram, np.stack([offset @ side, offset @ other]))
        return int(((share >= 0).all(axis=0) & (share.sum(axis=0) <= 1)).sum())


def make_support(level: Level, units: Units, winners: Int[np.ndarray, "T S"]) -> Support:
    """Prepare the samples of a level for queries; outliers support nothing.

    Where units win few samples each, the scan lines are about as far apart as the units: there a gap of two
    units' spacing is no hole yet.
    """
    is_used = level.weights > 0
    spacings = level.spacings
    sparse = find_sparse(winners[is_used], len(units))
    if len(sparse):
        distances, _ = cKDTree(units).query(units[sparse], k=min(NUM_NEIGHBORS, len(units) - 1) + 1)
        widest = np.zeros(len(units))
        widest[sparse] = np.median(distances[:, 1:], axis=1) / 2
        spacings = np.where(is_used, np.maximum(spacings, widest[winners]), spacings)
    is_uneven = bool(np.ptp(level.spacings) > 0)
    if is_used[level.tiles.is_real].all():
        by_sample = np.empty(level.tiles.tree.n)
        by_sample[level.tiles.order[is_used]] = spacings[is_used]
        return Support(level.tiles.tree, by_sample, is_uneven)
    return Support(cKDTree(level.tiles.samples[is_used]), spacings[is_used], is_uneven)


def find_sparse(winners: Int[np.ndarray, " N"], num_units: int) -> Int[np.ndarray, " C"]:
    """Return the units that win samples, but too few to see all their edges."""
    counts = np.bincount(winners, minlength=num_units)
    return np.flatnonzero((counts > 0) & (counts < _FEW_SAMPLES))
