"""Points of a large file in chunks, so that no more than a chunk is in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import load_cloud
from reconstruction._src.scans.formats import load_points
from reconstruction._src.scans.las import find_las_units
from reconstruction._src.scans.point_rows import COLORS

CHUNK = 1_000_000
"""Points at a time: 24 MB, and a few times that while they are sorted into tiles."""
_SAMPLE = 100_000
"""Points that say where the middle of a cloud is."""
_FAR = 1000.0
"""Clouds whose middle is farther from the origin are moved there [m]: beyond, single precision loses 0.1 mm."""
_COLORED = 6
"""Columns of points with colors."""
_MAX_BYTE, _MAX_SHORT = 255, 65535
_NOISE_CLASSES = (7, 18)
"""LAS 1.4, table 17: low point (noise), high noise."""


class PointStream(NamedTuple):
    """Points that are read when they are needed, as often as wanted.

    Attributes:
        chunks: returns the points in chunks `[N, 3]`, in the coordinates of the file [m]; with colors `[N, 6]`:
            red, green and blue (0 to 255) behind them.
        offset: `[3]` what is to be subtracted from them [m]; zeros where they are near the origin.
        columns: 3, or 6 with colors.
    """

    chunks: Callable[[], Iterator[Float[np.ndarray, "N columns"]]]
    offset: Float[np.ndarray, " 3"]
    columns: int = 3


def open_points(source: str | Path | ArrayLike | Cloud, meters: float | None = None) -> PointStream:
    """Open a file or an array of points for reading in chunks."""
    path = Path(source) if isinstance(source, str | Path) else None
    if path is not None and not path.is_file():
        raise ScanError(f"{path}: no such file")
    if path is not None and path.suffix.lower() in (".las", ".laz"):
        return _open_las(path, meters)
    meters = 1.0 if meters is None else meters
    if path is not None and path.suffix.lower() == ".npy":
        rows = _map_array(path)
    else:
        rows = _load_rows(source) if path is None else _load_rows(path)
    if rows.ndim != 2 or rows.shape[1] < 3 or not np.issubdtype(rows.dtype, np.number):
        raise ScanError(f"points must be numbers of shape [N, 3], not {rows.dtype} of {rows.shape}")
    if not len(rows):
        raise ScanError("there are no points")

    columns = _COLORED if isinstance(rows, _ColoredRows) else 3

    def read() -> Iterator[Float[np.ndarray, "N columns"]]:
        for start in range(0, len(rows), CHUNK):
            yield _as_meters(rows[start : start + CHUNK, :columns], meters)

    sample = _as_meters(rows[:: max(len(rows) // _SAMPLE, 1), :3], meters)
    return PointStream(read, _find_offset(np.median(sample, axis=0) if len(sample) else np.zeros(3)), columns)


class _ColoredRows(np.ndarray):
    """Rows of positions and colors, rather than an array of a user with more columns."""


def _load_rows(source: Path | ArrayLike) -> np.ndarray:
    """Return positions, with colors behind them where the source is a cloud or a file with colors."""
    if isinstance(source, Path):
        points, cloud = load_points(source), load_cloud(source)
    elif isinstance(source, Cloud):
        points, cloud = source.points + source.offset, source
    else:
        return np.asarray(source)
    if cloud.colors is None or cloud.num_points != len(points):
        return points
    return np.concatenate([points, cloud.colors], axis=1).view(_ColoredRows)


def _map_array(path: Path) -> np.ndarray:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise ScanError(f"{path}: not an array of numbers ({error})") from error


def _open_las(path: Path, meters: float | None) -> PointStream:
    try:
        import laspy
    except ImportError as error:
        raise MissingExtraError(
            f"a {path.suffix} file needs laspy, which is not installed: pip install 'symbrion-gym[formats]'"
        ) from error

    def read() -> Iterator[Float[np.ndarray, "N columns"]]:
        with path.open("rb") as file, laspy.LasReader(file, closefd=False) as reader:
            for chunk in reader.chunk_iterator(CHUNK):
                names = ("x", "y", "z", *(COLORS if scale else ()))
                points = np.stack([np.asarray(chunk[name], dtype=np.float64) for name in names], axis=1)
                points[:, 3:] *= scale
                yield _as_meters(points[_find_usable(chunk)], lengths)

    try:
        with path.open("rb") as file, laspy.LasReader(file, closefd=False) as reader:
            header = reader.header
            low, high, count = np.array(header.mins), np.array(header.maxs), header.point_count
            stated, height_factor = find_las_units(header)
            scale = _find_color_scale(next(iter(reader.chunk_iterator(CHUNK)), None), header)
    except (laspy.LaspyException, OSError, ValueError) as error:
        raise ScanError(f"{path}: not readable as LAS ({error})") from error
    if not count:
        raise ScanError(f"{path}: there are no points")
    unit = (stated or 1.0) if meters is None else meters
    lengths = unit * np.array([1.0, 1.0, height_factor])
    return PointStream(read, _find_offset(lengths * (low + high) / 2), _COLORED if scale else 3)


def _find_color_scale(chunk: Any, header: Any) -> float:
    """Return the factor from the colors of a .las to bytes, by its first points: 16 bits or 8; 0 without colors."""
    if chunk is None or not {*COLORS} <= set(header.point_format.dimension_names):
        return 0.0
    largest = max(int(np.max(np.asarray(chunk[name]), initial=0)) for name in COLORS)
    return 0.0 if not largest else 1.0 if largest <= _MAX_BYTE else _MAX_BYTE / _MAX_SHORT


def _find_usable(chunk: Any) -> np.ndarray:
    """Return which points are neither withheld nor noise."""
    is_noise = np.isin(np.asarray(chunk["classification"]), _NOISE_CLASSES)
    return ~(is_noise | np.asarray(chunk["withheld"]).astype(bool))


def _as_meters(rows: np.ndarray, meters: float | Float[np.ndarray, " 3"]) -> Float[np.ndarray, "N columns"]:
    """Return rows in double precision, without those that are not finite."""
    points = np.array(rows, dtype=np.float64)
    points[:, :3] *= meters
    is_finite = np.isfinite(points[:, :3]).all(axis=1)
    return points if is_finite.all() else points[is_finite]


def _find_offset(middle: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return the middle in whole meters, where it is far from the origin."""
    return np.round(middle) if np.abs(middle).max() > _FAR else np.zeros(3)
