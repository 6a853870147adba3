"""Reading a file as a cloud: points, colors and positions of the sensor, in meters with z up."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from reconstruction._src.base.bounded_read import MAX_BYTES
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.formats import DROPPED
from reconstruction._src.scans.frames import FrameConfig, describe_odd_size, find_offset, make_frame
from reconstruction._src.scans.point_files import find_kind, find_log_points, read_raw
from reconstruction._src.scans.point_rows import RawPoints
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.scan_3dtk import load_3dtk, read_pose

_logger = logging.getLogger(__name__)


def load_cloud(
    path: str | os.PathLike[str],
    unit: str | None = None,
    up: str | None = None,
    scale: float = 1.0,
    max_bytes: float = MAX_BYTES,
    viewpoints: ArrayLike | None = None,
    config: FrameConfig | None = None,
) -> Cloud:
    """Read the points of a file with their colors and the positions of the sensor, in meters and with z up.

    Viewpoints come from scan logs (each scan's position), 3DTK scans (`.3d` with `.pose`), VIEWPOINT of .pcd files,
    the poses of .e57 scans, and the arrays ``viewpoints`` and ``seen_from`` of an .npz with ``points``. Large
    coordinates are moved to the origin: see `FrameConfig`; `Cloud.offset` is what was subtracted.

    Rows that are not finite and points that a .las file marks as noise are dropped, their number is logged. A
    warning is logged about a size that is none of a robot's scene.

    Args:
        path: a file of any kind that `load_points` reads. Of a mesh the vertices are the points: `load_mesh` keeps
            its faces.
        unit: "m", "cm", "mm", "ft", "us-ft" or "in"; None: what the file says (.las, .e57, .gltf, .dae, .3d), meters
            where it does not.
        up: axis of the file that points up: "x", "y", "z", "-x", "-y" or "-z"; None: what the file says (.gltf,
            .dae), "z" where it does not.
        scale: a further factor, for files whose unit has no name.
        max_bytes: most bytes that the file may hold unpacked, and its points in memory (24 bytes each).
        viewpoints: `[K, 3]` or `[3]` where the sensor stood, in meters with z up, before large coordinates are moved;
            they replace those of the file.
        config: which coordinates are large, and which sizes are warned about.

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds fewer than three points; there is
            no such unit or axis; or the viewpoints are no positions.
        MissingExtraError: the library that reads this kind is not installed.
    """
    path, config = Path(path), config or FrameConfig()
    raw = _read_sweeps(path, max_bytes) if find_kind(path) == ".3d" else read_raw(path, max_bytes)
    try:
        cloud = _make_cloud(raw, unit, up, scale)
        if viewpoints is not None:
            cloud = cloud.replace(viewpoints=_as_viewpoints(viewpoints), seen_from=None)
    except ScanError as error:
        raise ScanError(f"{path}: {error}") from error
    num_dropped = len(raw.points) - cloud.num_points + raw.num_ignored
    if num_dropped:
        _logger.warning(DROPPED, path, num_dropped, cloud.num_points)
    if odd := describe_odd_size(cloud.points, config):
        _logger.warning("%s: %s; if that is wrong, give unit= or scale=", path, odd)
    return recenter(cloud, config)


def make_log_cloud(log: ScanLog) -> Cloud:
    """Return the points of a log, each seen from the position of its scan; equal positions are one viewpoint."""
    raw = find_log_points(log)
    return Cloud(raw.points, raw.colors, viewpoints=raw.viewpoints, seen_from=raw.seen_from)


def recenter(cloud: Cloud, config: FrameConfig | None = None) -> Cloud:
    """Return a cloud whose large coordinates are moved to the origin, with `offset` grown by what was subtracted.

    Args:
        cloud: in meters.
        config: which coordinates are large.
    """
    offset = find_offset(cloud.points, config)
    if not offset.any():
        return cloud
    _logger.info("moved by %s m: points + offset are the file's coordinates", (-offset).tolist())
    viewpoints = None if cloud.viewpoints is None else cloud.viewpoints - offset
    return cloud.replace(points=cloud.points - offset, viewpoints=viewpoints, offset=cloud.offset + offset)


def _as_viewpoints(viewpoints: ArrayLike) -> np.ndarray:
    try:
        return np.atleast_2d(np.asarray(viewpoints, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ScanError(f"viewpoints must be numbers [K, 3]: {error}") from error


def _make_cloud(raw: RawPoints, unit: str | None, up: str | None, scale: float) -> Cloud:
    """Return the finite points of a file in meters with z up."""
    frame = make_frame(raw, unit, up, scale)
    finite = np.asarray(np.isfinite(raw.points).all(axis=1))
    chosen = slice(None) if finite.all() else finite
    return Cloud(
        frame.place(raw.points[chosen]),
        None if raw.colors is None else raw.colors[chosen],
        None if raw.viewpoints is None else frame.place(raw.viewpoints),
        None if raw.seen_from is None else raw.seen_from[chosen],
    )


def _read_sweeps(path: Path, max_bytes: float) -> RawPoints:
    """Read a 3DTK scan in the frame of its pose; of an ordered one without the beams that did not return.

    The points of a .3d stand in the scanner's own frame: without .pose, that is the frame of the cloud.
    """
    has_pose = path.with_suffix(".pose").is_file()
    if has_pose:
        try:
            log = load_3dtk(path, max_bytes=max_bytes)
        except ScanError:
            _logger.info("%s is not ordered in sweeps: read as points", path)
        else:
            raw = find_log_points(log)
            if len(raw.points):
                return raw._replace(has_fixed_unit=True)
    raw = read_raw(path, max_bytes)
    pose = read_pose(path.with_suffix(".pose")) if has_pose else np.eye(4)
    return raw._replace(points=raw.points @ pose[:3, :3].T + pose[:3, 3], viewpoints=pose[None, :3, 3])
