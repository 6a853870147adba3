"""Read the scans of .e57 files (ASTM E2807) by pye57, an optional dependency; each scan with its sensor's position."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.bounded_read import check_size
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.geometry.pose import to_rotation
from reconstruction._src.scans.point_rows import RawPoints, as_colors, is_plausible_origin

if TYPE_CHECKING:
    import pye57

_POINT_BYTES = 24
_CHUNK = 1_000_000  # Points that are read at once
_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_INVALID = ("cartesianInvalidState", "sphericalInvalidState")
"""0 where a point can be used; 1: only its direction is known; 2: nothing is."""
_COLORS = ("colorRed", "colorGreen", "colorBlue")
_GRID = ("rowIndex", "columnIndex")
_ROTATION_TOLERANCE = 1e-3  # How far the length of a quaternion may be from 1


class _Pose(NamedTuple):
    """Sensor -> file, and whether that is the identity."""

    rotation: Float[np.ndarray, "3 3"]
    translation: Float[np.ndarray, " 3"]
    is_identity: bool


class _Scan(NamedTuple):
    """A scan in the common frame of its file: its points, their colors, and where the sensor stood."""

    points: Float[np.ndarray, "N 3"]
    colors: Float[np.ndarray, "N 3"] | None
    viewpoint: Float[np.ndarray, " 3"] | None
    num_ignored: int


def read_e57(path: str | os.PathLike[str], max_bytes: float) -> RawPoints:
    """Read all scans of a file in their common frame.

    A scan's pose is also the position of its sensor. Files of one merged cloud have no pose or the identity; the
    origin is then believed only for ordered points around it.
    """
    path = Path(path)
    check_size(path.stat().st_size, max_bytes)
    require_extras("an .e57 file", "formats")
    import pye57

    file = pye57.E57(str(path))
    try:
        headers = [file.get_header(index) for index in range(file.scan_count)]
        check_size(_POINT_BYTES * sum(header.point_count for header in headers), max_bytes)
        poses = [_find_pose(header) for header in headers]
        is_alone = sum(is_identity for *_, is_identity in poses) == 1
        scans = [_read_scan(file, *pair, is_alone) for pair in zip(headers, poses, strict=True)]
    finally:
        file.close()
    if not scans:
        raise ScanError("the .e57 file holds no scans; pictures alone make no cloud")
    return _merge(scans)


def _merge(scans: Sequence[_Scan]) -> RawPoints:
    """Return all scans as one cloud; colors stand only where every scan has them."""
    scans = [scan for scan in scans if len(scan.points)] or scans[:1]
    viewpoints = [scan.viewpoint for scan in scans if scan.viewpoint is not None]
    colors = [scan.colors for scan in scans if scan.colors is not None]
    counts = [len(scan.points) for scan in scans]
    return RawPoints(
        np.concatenate([scan.points for scan in scans]),
        as_colors(np.concatenate(colors)) if len(colors) == len(scans) else None,
        np.stack(viewpoints) if viewpoints else None,
        np.repeat(np.arange(len(scans)), counts) if len(viewpoints) == len(scans) else None,
        meters=1.0,
        num_ignored=sum(scan.num_ignored for scan in scans),
    )


def _read_scan(file: pye57.E57, header: Any, pose: _Pose, is_alone: bool) -> _Scan:
    """Return a scan, turned and moved by its pose."""
    fields = list(header.point_fields)
    axes = next((names for names in (_CARTESIAN, _SPHERICAL) if {*names} <= {*fields}), None)
    if axes is None:
        raise ScanError(f"the .e57 file has points of {', '.join(fields) or 'no fields'}, not x y z")
    has_colors = {*_COLORS} <= {*fields}
    state = next((name for name in _INVALID if name in fields and name[:9] == axes[0][:9]), None)
    names = [*axes, *(_COLORS if has_colors else ()), *([state] if state else ())]
    values = _read_columns(file, header, names)
    points = values[:, :3] if axes is _CARTESIAN else _to_cartesian(values[:, :3])
    rotation, translation, is_identity = pose
    is_ordered = {*_GRID} <= {*fields}
    is_trusted = not is_identity or (is_alone and is_ordered and is_plausible_origin(points))
    is_usable = _select_usable(values[:, -1] if state else None, points)
    colors = values[is_usable, 3:6] if has_colors else None
    return _Scan(
        points[is_usable] @ rotation.T + translation,
        colors,
        translation if is_trusted else None,
        int((~is_usable).sum()),
    )


def _select_usable(
    state: Float[np.ndarray, " N"] | None, points: Float[np.ndarray, "N 3"]
) -> Bool[np.ndarray, " N"]:
    return np.ones(len(points), bool) if state is None else state == 0


def _read_columns(file: pye57.E57, header: Any, names: Sequence[str]) -> Float[np.ndarray, "N C"]:
    """Return columns of a scan's points, read piece by piece."""
    from pye57 import libe57  # pyright: ignore[reportAttributeAccessIssue]

    count = header.point_count
    values = np.empty((count, len(names)))
    blocks = [np.empty(min(_CHUNK, max(count, 1))) for _ in names]
    buffers = libe57.VectorSourceDestBuffer()
    for name, block in zip(names, blocks, strict=True):
        buffers.append(libe57.SourceDestBuffer(file.image_file, name, block, len(block), True, True))
    reader, num_read = header.points.reader(buffers), 0
    while num_read < count:
        num_rows = int(reader.read())
        if not 0 < num_rows <= count - num_read:
            raise ScanError(f"the .e57 file promises {count} points, the data hold {num_read + num_rows}")
        for column, block in enumerate(blocks):
            values[num_read : num_read + num_rows, column] = block[:num_rows]
        num_read += num_rows
    reader.close()
    return values


def _to_cartesian(polar: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Return range, azimuth and elevation as x, y, z (ASTM E2807, 8.4.4)."""
    distance, azimuth, elevation = polar.T
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=1)


def _find_pose(header: Any) -> _Pose:
    """Return where the sensor of a scan stood."""
    if not header.has_pose():
        return _Pose(np.eye(3), np.zeros(3), True)
    rotation = np.array(_find_values(header, "rotation", "wxyz"))
    translation = np.array(_find_values(header, "translation", "xyz"))
    length = np.linalg.norm(rotation)
    if not np.isfinite(translation).all() or not abs(length - 1) < _ROTATION_TOLERANCE:
        raise ScanError(f"the .e57 file has a scan of pose {rotation.tolist()}, {translation.tolist()}")
    matrix = to_rotation(rotation[None] / length)[0]
    is_identity = np.array_equal(matrix, np.eye(3)) and not translation.any()
    return _Pose(matrix, translation, bool(is_identity))


def _find_values(header: Any, group: str, names: str) -> list[float]:
    """Return the numbers of a part of a pose, in this order; those of the identity where it is absent."""
    pose = header["pose"]
    if not pose.isDefined(group):
        return [float(name == "w") for name in names]
    return [float(pose[group][name].value()) for name in names]
