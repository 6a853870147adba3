"""Points of a large file in chunks, so that no more than a chunk is in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction.errors import ScanError
from reconstruction.extras import MissingExtraError
from reconstruction.scans.formats import load_points
from reconstruction.scans.las import find_las_units

CHUNK = 1_000_000
"""Points at a time: 24 MB, and a few times that while they are sorted into tiles."""
_SAMPLE = 100_000
"""Points that say where the middle of a cloud is."""
_FAR = 1000.0
"""Clouds whose middle is farther from the origin are moved there [m]: beyond, single precision loses 0.1 mm."""
_NOISE_CLASSES = (7, 18)
"""LAS 1.4, table 17: low point (noise), high noise."""


class PointStream(NamedTuple):
    """Points that are read when they are needed, as often as wanted.

    Attributes:
        chunks: returns the points in chunks `[N, 3]`, in the coordinates of the file [m].
        offset: `[3]` what is to be subtracted from them [m]; zeros where they are near the origin.
    """

    chunks: Callable[[], Iterator[Float[np.ndarray, "N 3"]]]
    offset: Float[np.ndarray, " 3"]


def open_points(source: str | Path | ArrayLike, meters: float | None = None) -> PointStream:
    """Open a file or an array of points for reading in chunks.

    Args:
        source: a file .las or .laz (read in chunks, needs laspy), .npy of an array `[N, 3]` or wider (mapped into
            memory), any other point file (read whole), or an array.
        meters: length of a unit of the source [m]; None: what a .las or .laz says, else 1.

    Raises:
        ScanError: no points, or an array of another shape.
        MissingExtraError: laspy is not installed.
    """
    path = Path(source) if isinstance(source, str | Path) else None
    if path is not None and not path.is_file():
        raise ScanError(f"{path}: no such file")
    if path is not None and path.suffix.lower() in (".las", ".laz"):
        return _open_las(path, meters)
    meters = 1.0 if meters is None else meters
    if path is not None and path.suffix.lower() == ".npy":
        rows = _map_array(path)
    else:
        rows = load_points(path) if path is not None else np.asarray(source)
    if rows.ndim != 2 or rows.shape[1] < 3 or not np.issubdtype(rows.dtype, np.number):
        raise ScanError(f"points must be numbers of shape [N, 3], not {rows.dtype} of {rows.shape}")
    if not len(rows):
        raise ScanError("there are no points")

    def read() -> Iterator[Float[np.ndarray, "N 3"]]:
        for start in range(0, len(rows), CHUNK):
            yield _as_meters(rows[start : start + CHUNK, :3], meters)

    sample = _as_meters(rows[:: max(len(rows) // _SAMPLE, 1), :3], meters)
    return PointStream(read, _find_offset(np.median(sample, axis=0) if len(sample) else np.zeros(3)))


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

    def read() -> Iterator[Float[np.ndarray, "N 3"]]:
        with path.open("rb") as file, laspy.LasReader(file, closefd=False) as reader:
            for chunk in reader.chunk_iterator(CHUNK):
                points = np.stack([np.asarray(chunk[axis], dtype=np.float64) for axis in "xyz"], axis=1)
                yield _as_meters(points[_find_usable(chunk)], lengths)

    try:
        with path.open("rb") as file, laspy.LasReader(file, closefd=False) as reader:
            header = reader.header
            low, high, count = np.array(header.mins), np.array(header.maxs), header.point_count
            stated, height_factor = find_las_units(header)
    except (laspy.LaspyException, OSError, ValueError) as error:
        raise ScanError(f"{path}: not readable as LAS ({error})") from error
    if not count:
        raise ScanError(f"{path}: there are no points")
    unit = (stated or 1.0) if meters is None else meters
    lengths = unit * np.array([1.0, 1.0, height_factor])
    return PointStream(read, _find_offset(lengths * (low + high) / 2))


def _find_usable(chunk: Any) -> np.ndarray:
    """Return which points are neither withheld nor noise."""
    is_noise = np.isin(np.asarray(chunk["classification"]), _NOISE_CLASSES)
    return ~(is_noise | np.asarray(chunk["withheld"]).astype(bool))


def _as_meters(rows: np.ndarray, meters: float | Float[np.ndarray, " 3"]) -> Float[np.ndarray, "N 3"]:
    """Return rows in double precision, without those that are not finite."""
    points = np.asarray(rows, dtype=np.float64) * meters
    is_finite = np.isfinite(points).all(axis=1)
    return points if is_finite.all() else points[is_finite]


def _find_offset(middle: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return the middle in whole meters, where it is far from the origin."""
    return np.round(middle) if np.abs(middle).max() > _FAR else np.zeros(3)
