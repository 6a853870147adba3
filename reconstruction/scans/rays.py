"""The points of a scan log together with the places they were read from."""

import numpy as np

from reconstruction.scans.levelling import level_floor
from reconstruction.scans.preprocess import remove_mixed_pixels
from reconstruction.scans.scan import Array, ScanLog
from reconstruction.scans.smoothing import smooth_ranges


def read_rays(log: ScanLog) -> tuple[Array, Array]:
    """Level, filter and smooth a log; return its points and where the sensor was at each, both `[N, 3]` [m].

    Args:
        log: the scans; only what lies in its box is kept, where it has one.
    """
    log = smooth_ranges(remove_mixed_pixels(level_floor(log)))
    points = log.points()
    places = np.broadcast_to(log.poses[:, None, :3, 3], (*log.ranges.shape, 3))
    origins = places[log.is_valid]
    if log.box is None:
        return points, origins
    is_inside = ((points >= log.box[0]) & (points <= log.box[1])).all(axis=1)
    return points[is_inside], origins[is_inside]
