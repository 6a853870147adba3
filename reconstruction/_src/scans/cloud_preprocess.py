"""Pre-processing that keeps what is known about each point: colors, and the viewpoint it was seen from."""

from __future__ import annotations

from dataclasses import replace

from reconstruction._src.scans.cells import find_sparse_points
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import make_log_cloud
from reconstruction._src.scans.preprocess import PreprocessConfig, clean_log
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.selection import crop


def preprocess_cloud(source: ScanLog | Cloud, config: PreprocessConfig | None = None) -> Cloud:
    """Level, filter and smooth a log, or filter a cloud; return the points that are left as a cloud.

    Of a log these are the points of `preprocess`, and those that sparsely read surfaces need (`find_needed_beams`): far
    walls, and walls at a low angle. The arenas of this project are made with `preprocess`.

    Args:
        source: a log, or a cloud [m].
        config: configuration of the steps.
    """
    config = config or PreprocessConfig()
    if isinstance(source, Cloud):
        return source.select(~find_sparse_points(source.points, config.sparse_points))
    log = clean_log(source, keep_sparse=True, config=config)
    cloud = make_log_cloud(log)
    if log.box is not None:
        cloud = crop(cloud, log.box, config.crop_margin)
    sparse = replace(config.sparse_readings, flatness=config.sparse_points.flatness)
    return cloud.select(~find_sparse_points(cloud.points, sparse))
