"""Pre-processing that keeps what is known about each point: colors, and the viewpoint it was seen from."""

from __future__ import annotations

import numpy as np

from reconstruction.scans.cells import find_sparse_points
from reconstruction.scans.cloud import Cloud
from reconstruction.scans.cloud_file import make_log_cloud
from reconstruction.scans.leveling import level_floor
from reconstruction.scans.mixed_pixels import find_mixed_beams
from reconstruction.scans.preprocess import PreprocessConfig
from reconstruction.scans.scan import ScanLog
from reconstruction.scans.selection import crop
from reconstruction.scans.smoothing import smooth_ranges


def preprocess_cloud(source: ScanLog | Cloud, config: PreprocessConfig | None = None) -> Cloud:
    """Level, filter and smooth a log, or filter a cloud; return the points that `preprocess` keeps as a cloud.

    Args:
        source: a log, or a cloud [m].
        config: configuration of the steps.
    """
    config = config or PreprocessConfig()
    if isinstance(source, Cloud):
        return source.select(~find_sparse_points(source.points, config.sparse_points))
    log = level_floor(source, config=config.leveling)
    is_mixed = find_mixed_beams(log.ranges, log.angles, config.mixed_pixels)
    log = smooth_ranges(log.replace(ranges=np.where(is_mixed, np.nan, log.ranges)), config=config.smoothing)
    cloud = make_log_cloud(log)
    if log.box is not None:
        cloud = crop(cloud, log.box, config.crop_margin)
    return cloud.select(~find_sparse_points(cloud.points, config.sparse_readings))
