"""Point files: .xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj .3d, also packed by gzip or bzip2."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.errors import ScanError
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.bounded_read import (
    MAX_BYTES,
    BoundedFile,
    UnreadableFileError,
    check_size,
    find_npz_names,
    open_bounded,
    read_array,
    read_npz,
)
from reconstruction.scans.pcd import read_pcd
from reconstruction.scans.ply import read_ply, write_ply
from reconstruction.scans.scan import Array, ScanLog
from reconstruction.scans.scan_3dtk import to_right_handed
from reconstruction.scans.text_points import read_obj, read_text, read_vtk

_LOG = logging.getLogger(__name__)

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres in one unit of the file."""
_SCENE = (2.0, 100.0)
"""Extent of what a robot scans [m]: what `unit="auto"` looks for."""
_MIN_POINTS = 3


def load_points(path: str | os.PathLike[str], unit: str = "m", max_bytes: float = MAX_BYTES) -> Array:
    """Read the points of a file, `[N, 3]` [m]; rows that are not finite are dropped, their number logged.

    Of a text file the columns named x, y, z count, or the first three; of a mesh the vertices; of an .npz the
    array ``points``, or the only one, or the points of a scan log; of a 3DTK scan (.3d) its right-handed form
    with z up (it is always in centimetres, so `unit` is not asked).

    Args:
        path: .xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj .3d, each also with .gz or .bz2 behind it.
        unit: "m", "cm" or "mm"; "auto" takes the one that makes a scene of 2 to 100 m, if only one does.
        max_bytes: the most that the file may hold unpacked, and its points in memory (24 bytes each); a file that
            grows beyond is refused before the memory is taken.

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds fewer than three points; the
            message names the file and the reason.
    """
    points, num_dropped = read_points(path, unit, max_bytes)
    if num_dropped:
        _LOG.warning("%s: dropped %d rows that are not finite, kept %d", path, num_dropped, len(points))
    return points


def read_points(
    path: str | os.PathLike[str], unit: str = "m", max_bytes: float = MAX_BYTES
) -> tuple[Array, int]:
    """Read points as `load_points` does; returns them and how many rows were dropped as not finite."""
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
    except Exception as error:  # the libraries beneath raise every kind of error on broken bytes
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
        points *= UNITS[unit] if unit != "auto" else _guess_scale(path, points)
    return points, int(len(finite) - len(points))


def save_points(path: str | os.PathLike[str], points: ArrayLike) -> Path:
    """Write points `[N, 3]` [m] as .ply (binary), .xyz, .txt, .csv, .npy or .npz; beside, and then renamed.

    Raises:
        ScanError: the points are no points, the suffix is unknown, or the folder cannot be written to.
    """
    path = Path(path)
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ScanError(f"{path}: points must have shape [N, 3], not {points.shape}")
    if path.suffix not in _WRITERS:
        raise ScanError(f"{path}: cannot write {path.suffix!r}; there are: {' '.join(_WRITERS)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as beside, beside.open("wb") as file:
            _WRITERS[path.suffix](file, points)
    except OSError as error:
        raise ScanError(f"{path}: cannot be written: {error}") from error
    return path


def _guess_scale(path: Path, points: Array) -> float:
    extent = float(np.ptp(points, axis=0).max())
    fitting = [name for name, scale in UNITS.items() if _SCENE[0] <= extent * scale <= _SCENE[1]]
    if len(fitting) != 1:
        found = f"{' and '.join(fitting)} both fit" if fitting else "none of m, cm, mm fits"
        raise ScanError(f"{path}: cannot guess the unit of an extent of {extent:g}: {found}; give unit=")
    _LOG.info("%s: taken to be in %s", path, fitting[0])
    return UNITS[fitting[0]]


def _read_npy(file: BoundedFile) -> Array:
    return _first_columns(read_array(file.stream, file.size), file)


def _read_npz(file: BoundedFile) -> Array:
    names = find_npz_names(file.stream)
    if {"ranges", "angles", "poses"} <= set(names):
        log = read_npz(file.stream, ("ranges", "angles", "poses"), file.max_bytes)
        check_size(24 * log["ranges"].size, file.max_bytes)
        return ScanLog(log["ranges"], log["angles"], log["poses"]).points()
    if "points" not in names and len(names) != 1:
        raise ScanError(f"holds the arrays {', '.join(names) or '(none)'}, none of them called points")
    name = "points" if "points" in names else names[0]
    return _first_columns(read_npz(file.stream, (name,), file.max_bytes)[name], file)


def _first_columns(array: np.ndarray, file: BoundedFile) -> Array:
    has_names = {"x", "y", "z"} <= set(array.dtype.names or ())
    check_size(24 * (array.size if has_names else len(np.atleast_1d(array))), file.max_bytes)
    if has_names:
        return np.stack([array[name].astype(float).ravel() for name in "xyz"], axis=1)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] < 3:
        raise ScanError(f"holds {array.dtype} of shape {array.shape}, not [N, 3] numbers")
    return array[:, :3].astype(np.float64)


def _read_3dtk(file: BoundedFile) -> Array:
    return to_right_handed(read_text(file))


_READERS: dict[str, Callable[[BoundedFile], Array]] = {
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
_WRITERS: dict[str, Callable] = {
    ".ply": write_ply,
    ".xyz": lambda file, points: np.savetxt(file, points, fmt="%.9g"),
    ".txt": lambda file, points: np.savetxt(file, points, fmt="%.9g"),
    ".csv": lambda file, points: np.savetxt(
        file, points, fmt="%.9g", delimiter=",", header="x,y,z", comments=""
    ),
    ".npy": lambda file, points: np.save(file, points, allow_pickle=False),
    ".npz": lambda file, points: np.savez_compressed(file, points=points),
}
