"""Whether samples lie on a face: what tells a gap in the topology from a hole in the data."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.rows import cross_rows, find_lengths
from reconstruction.networks.gsrm.growth import Level

GAP = 2.0
"""A place farther than so many sample spacings from all samples is void: a hole wider than four of them."""
MAX_VOID = 6.0
"""A patch whose void is larger, in squared sample spacings (half a disc of `GAP`), spans a hole."""
MIN_COVER = 0.2
"""A face over which this share of the expected samples lies cuts a corner of the surface, and has no void."""
WHOLE_COVER = 0.75
"""Likewise for faces that may reach far: with less of the samples a hole in the data would be covered."""
FEW_SAMPLES = 10
NUM_NEIGHBORS = 6
"""How many neighbours a unit has in a regular map."""
_INNER = np.array(
    [[4, 4, 4], [8, 2, 2], [2, 8, 2], [2, 2, 8], [2, 5, 5], [5, 2, 5], [5, 5, 2]], dtype=np.float64
)
_PLACES = _INNER / 12


class Support:
    """The samples, ready to be asked whether they carry a face."""

    def __init__(self, tree: cKDTree, spacings: np.ndarray, *, is_uneven: bool = False) -> None:
        """Keep the samples.

        Args:
            tree: of the samples.
            spacings: distance between samples round each of the tree's.
            is_uneven: whether the cloud's density varies, as scan lines' does.
        """
        self._tree = tree
        self._spacings = np.maximum(spacings, np.finfo(float).tiny ** 0.25)  # samples may coincide
        self.is_uneven = is_uneven

    def measure_void(self, corners: np.ndarray, min_cover: float = MIN_COVER) -> np.ndarray:
        """Return how much of each face is far from all samples, in squared spacings: `[F]`.

        Args:
            corners: `[F, 3, 3]` of the faces.
            min_cover: a face over which this share of the expected samples lies has no void.
        """
        places = np.einsum("pk,fki->fpi", _PLACES, corners)
        distances, nearest = self._tree.query(places)
        is_void = distances > GAP * self._spacings[nearest]
        cross = cross_rows(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        expected = find_lengths(cross) / 2 / self._spacings[nearest].mean(axis=1) ** 2
        void = expected * is_void.mean(axis=1)
        for face in np.flatnonzero(void):
            if self._count_over(corners[face]) >= max(1, min_cover * expected[face]):
                void[face] = 0
        return void

    def is_near(self, places: np.ndarray) -> np.ndarray:
        """Return which places `[Q, 3]` have a sample within two sample spacings: `[Q]`."""
        distances, nearest = self._tree.query(places)
        return distances <= GAP * self._spacings[nearest]

    def _count_over(self, corners: np.ndarray) -> int:
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


def make_support(level: Level, units: np.ndarray, winners: np.ndarray) -> Support:
    """Make the samples of a level ready; outliers carry nothing.

    Where units win few samples each, the scan lines are about as far apart as the units: there a gap of two
    units' spacing is no hole yet.

    Args:
        level: all samples.
        units: `[U, 3]`.
        winners: `[T, S]` the unit nearest to every slot.
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
        return Support(level.tiles.tree, by_sample, is_uneven=is_uneven)
    return Support(cKDTree(level.tiles.samples[is_used]), spacings[is_used], is_uneven=is_uneven)


def find_sparse(winners: np.ndarray, num_units: int) -> np.ndarray:
    """Return the units `[C]` that win too few samples to see all their edges."""
    counts = np.bincount(winners, minlength=num_units)
    return np.flatnonzero((counts > 0) & (counts < FEW_SAMPLES))
