"""Point files: .xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj .3d, also compressed by gzip or bzip2."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float, Shaped
from numpy.typing import ArrayLike

from reconstruction.errors import ScanError
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.bounded_read import (
    MAX_BYTES,
    BoundedFile,
    UnreadableFileError,
    find_npz_names,
    open_bounded,
    read_array,
    read_npz,
)
from reconstruction.scans import point_rows
from reconstruction.scans.pcd import read_pcd
from reconstruction.scans.ply import read_ply, write_ply
from reconstruction.scans.scan import ScanLog
from reconstruction.scans.scan_3dtk import to_right_handed
from reconstruction.scans.text_points import read_obj, read_text, read_vtk

_logger = logging.getLogger(__name__)

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Meters in one unit of the file."""
SCENE_EXTENT = (2.0, 100.0)
"""Extent of a scene that a robot scans [m]: a room is larger than 2 m, and 100 m is the reach of its scanner.
Its ends are a factor of 50 apart, so m and cm never both fit."""
_MIN_POINTS = 3
"""Fewer points span no plane."""
_NUMBER_FORMAT = "%.9g"
"""Nine digits: 10 micrometers at a kilometer."""


def load_points(
    path: str | os.PathLike[str],
    unit: str = "m",
    max_bytes: float = MAX_BYTES,
    scene_extent: tuple[float, float] = SCENE_EXTENT,
) -> Float[np.ndarray, "N 3"]:
    """Read the points of a file [m]; rows that are not finite are dropped, their number is logged.

    Points are: in a text file the columns named x, y, z, or the first three; in a mesh the vertices; in an .npz
    the array ``points``, or the only one, or the points of a scan log; in a 3DTK scan (.3d) its points in a
    right-handed frame with z up (it is always in centimeters, so `unit` has no effect).

    Args:
        path: .xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj .3d, each also followed by .gz or .bz2.
        unit: "m", "cm" or "mm"; "auto" selects the one that makes the extent that of a scene, if only one does.
        max_bytes: most bytes that the file may hold uncompressed, and its points in memory (24 bytes each); a
            larger file is refused before the memory is allocated.
        scene_extent: smallest and largest extent of a scene [m], for the unit "auto".

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds fewer than three points; the
            message names the file and the reason.
    """
    points, num_dropped = read_points(path, unit, max_bytes, scene_extent)
    if num_dropped:
        _logger.warning("%s: dropped %d rows that are not finite, kept %d", path, num_dropped, len(points))
    return points


def read_points(
    path: str | os.PathLike[str],
    unit: str = "m",
    max_bytes: float = MAX_BYTES,
    scene_extent: tuple[float, float] = SCENE_EXTENT,
) -> tuple[Float[np.ndarray, "N 3"], int]:
    """Read points as `load_points` does; return them and the number of rows dropped as not finite.

    Raises:
        ScanError: see `load_points`.
    """
    path = Path(path)
    if unit not in (*UNITS, "auto"):
        raise ScanError(f"{path}: unknown unit {unit!r}; there are: {', '.join(UNITS)}, auto")
    kind = ""
    try:
        with open_bounded(path, max_bytes) as file:
            kind = file.suffix
            if kind not in _READERS:
                raise ScanError(f"unknown kind {kind or '(no suffix)'}; there are: {' '.join(_READERS)}")
            points = _READERS[kind](file)
    except (ScanError, UnreadableFileError) as error:
        raise ScanError(f"{path}: {error}") from error
    except Exception as error:  # the libraries raise every kind of error on broken bytes
        raise ScanError(f"{path}: not a readable {kind} file: {error}") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise ScanError(f"{path}: holds an array of shape {points.shape}, not [N, 3] points")
    finite = np.asarray(np.isfinite(points).all(axis=1))
    if finite.sum() < _MIN_POINTS:
        raise ScanError(
            f"{path}: {len(points)} points, {finite.sum()} of them finite; at least {_MIN_POINTS} are needed"
        )
    if not finite.all():
        points = points[finite]
    if kind != ".3d":
        points *= UNITS[unit] if unit != "auto" else _guess_scale(path, points, scene_extent)
    return points, int(len(finite) - len(points))


def save_points(path: str | os.PathLike[str], points: ArrayLike) -> Path:
    """Write points `[N, 3]` [m] as .ply (binary), .xyz, .txt, .csv, .npy or .npz, atomically.

    Raises:
        ScanError: the points have another shape, the suffix is unknown, or the folder cannot be written to.
    """
    path = Path(path)
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ScanError(f"{path}: points must have shape [N, 3], not {points.shape}")
    if path.suffix not in _WRITERS:
        raise ScanError(f"{path}: cannot write {path.suffix!r}; there are: {' '.join(_WRITERS)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as temporary, temporary.open("wb") as file:
            _WRITERS[path.suffix](file, points)
    except OSError as error:
        raise ScanError(f"{path}: cannot be written: {error}") from error
    return path


def _guess_scale(path: Path, points: Float[np.ndarray, "N 3"], scene_extent: tuple[float, float]) -> float:
    smallest, largest = scene_extent
    extent = float(np.ptp(points, axis=0).max())
    fitting = [name for name, scale in UNITS.items() if smallest <= extent * scale <= largest]
    if len(fitting) != 1:
        found = f"{' and '.join(fitting)} both fit" if fitting else "none of m, cm, mm fits"
        raise ScanError(f"{path}: cannot guess the unit of an extent of {extent:g}: {found}; give unit=")
    _logger.info("%s: the unit is %s, by its extent", path, fitting[0])
    return UNITS[fitting[0]]


def _read_npy(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    return _first_columns(read_array(file.stream, file.size), file)


def _read_npz(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    names = find_npz_names(file.stream)
    if {"ranges", "angles", "poses"} <= set(names):
        log = read_npz(file.stream, ("ranges", "angles", "poses"), file.max_bytes)
        point_rows.check_num_points(file, log["ranges"].size)
        return ScanLog(log["ranges"], log["angles"], log["poses"]).points()
    if "points" not in names and len(names) != 1:
        raise ScanError(f"holds the arrays {', '.join(names) or '(none)'}, none of them called points")
    name = "points" if "points" in names else names[0]
    return _first_columns(read_npz(file.stream, (name,), file.max_bytes)[name], file)


def _first_columns(array: Shaped[np.ndarray, "*axes"], file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    has_names = {"x", "y", "z"} <= set(array.dtype.names or ())
    point_rows.check_num_points(file, array.size if has_names else len(np.atleast_1d(array)))
    if has_names:
        return np.stack([array[name].astype(float).ravel() for name in "xyz"], axis=1)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] < 3:
        raise ScanError(f"holds {array.dtype} of shape {array.shape}, not [N, 3] numbers")
    return array[:, :3].astype(np.float64)


def _read_3dtk(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    return to_right_handed(read_text(file))


def _write_text(file: BinaryIO, points: Float[np.ndarray, "N 3"], **options: str) -> None:
    np.savetxt(file, points, fmt=_NUMBER_FORMAT, **options)


_READERS: dict[str, Callable[[BoundedFile], Float[np.ndarray, "N 3"]]] = {
    ".xyz": read_text,
    ".txt": read_text,
    ".csv": read_text,
    ".dat": read_text,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".vtk": read_vtk,
    ".obj": read_obj,
    ".3d": _read_3dtk,
}
_WRITERS: dict[str, Callable[[BinaryIO, Float[np.ndarray, "N 3"]], None]] = {
    ".ply": write_ply,
    ".xyz": _write_text,
    ".txt": _write_text,
    ".csv": functools.partial(_write_text, delimiter=",", header="x,y,z", comments=""),
    ".npy": functools.partial(np.save, allow_pickle=False),
    ".npz": lambda file, points: np.savez_compressed(file, points=points),
}
