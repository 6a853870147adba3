"""The points of a scan log together with the positions they were measured from."""

import numpy as np
from jaxtyping import Float, UInt8

from reconstruction._src.scans.leveling import level_floor
from reconstruction._src.scans.preprocess import PreprocessConfig, remove_mixed_pixels
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.smoothing import smooth_ranges


def read_rays(
    log: ScanLog, config: PreprocessConfig | None = None
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Level, filter and smooth a log; return its points, and the position of the sensor at each [m]."""
    return read_colored_rays(log, config)[:2]


def read_colored_rays(
    log: ScanLog, config: PreprocessConfig | None = None
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"], UInt8[np.ndarray, "N 3"] | None]:
    """Return the points and origins of `read_rays`, and the colors of the points where the log has a camera's."""
    config = config or PreprocessConfig()
    log = remove_mixed_pixels(level_floor(log, config=config.leveling), config=config)
    log = smooth_ranges(log, config=config.smoothing)
    points = log.points()
    sensors = np.broadcast_to(log.poses[:, None, :3, 3], (*log.ranges.shape, 3))
    origins = sensors[log.is_valid]
    colors = log.point_colors
    if log.box is None:
        return points, origins, colors
    is_inside = ((points >= log.box[0]) & (points <= log.box[1])).all(axis=1)
    return points[is_inside], origins[is_inside], None if colors is None else colors[is_inside]
