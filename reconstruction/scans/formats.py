"""Point files: .xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj .3d, also packed by gzip or bzip2."""

from __future__ import annotations

import bz2
import gzip
import io
import logging
import os
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from plyfile import PlyData, PlyElement, PlyParseError

from reconstruction.atomic_write import write_atomically
from reconstruction.errors import ScanError
from reconstruction.scans.pcd import read_pcd
from reconstruction.scans.scan import Array
from reconstruction.scans.text_points import read_obj, read_text, read_vtk

_LOG = logging.getLogger(__name__)

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres in one unit of the file."""
_SCENE = (2.0, 100.0)
"""Extent of what a robot scans [m]: what `unit="auto"` looks for."""
_PACKED: dict[str, Callable[[bytes], bytes]] = {".gz": gzip.decompress, ".bz2": bz2.decompress}
_MIN_POINTS = 3


def load_points(path: str | os.PathLike[str], unit: str = "m") -> Array:
    """Read the points of a file, `[N, 3]` [m]; rows that are not finite are dropped, their number logged.

    Of a text file the columns named x, y, z count, or the first three; of a mesh the vertices; of an .npz the
    array ``points``, or the only one, or the points of a scan log; of a 3DTK scan (.3d) its right-handed form
    with z up (it is always in centimetres, so `unit` is not asked).

    Args:
        path: .xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj .3d, each also with .gz or .bz2 behind it.
        unit: "m", "cm" or "mm"; "auto" takes the one that makes a scene of 2 to 100 m, if only one does.

    Raises:
        ScanError: the file is absent, broken, of another kind, or holds fewer than three points; the message
            names the file and the reason.
    """
    points, num_dropped = read_points(path, unit)
    if num_dropped:
        _LOG.warning("%s: dropped %d rows that are not finite, kept %d", path, num_dropped, len(points))
    return points


def read_points(path: str | os.PathLike[str], unit: str = "m") -> tuple[Array, int]:
    """Read points as `load_points` does; returns them and how many rows were dropped as not finite."""
    path = Path(path)
    if unit not in (*UNITS, "auto"):
        raise ScanError(f"{path}: unknown unit {unit!r}; there are: {', '.join(UNITS)}, auto")
    kind, data = _unpack(path)
    if kind not in _READERS:
        raise ScanError(f"{path}: unknown kind {kind or '(no suffix)'}; there are: {' '.join(_READERS)}")
    try:
        points = np.asarray(_READERS[kind](data), dtype=np.float64)
    except ScanError as error:
        raise ScanError(f"{path}: {error}") from error
    except Exception as error:  # the readers beneath raise every kind of error on broken bytes
        raise ScanError(f"{path}: not a readable {kind} file: {error}") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise ScanError(f"{path}: holds an array of shape {points.shape}, not [N, 3] points")
    finite = np.asarray(np.isfinite(points).all(axis=1))
    if finite.sum() < _MIN_POINTS:
        raise ScanError(
            f"{path}: {len(points)} points, {finite.sum()} of them finite; at least {_MIN_POINTS} are needed"
        )
    points = points[finite]
    if kind != ".3d":
        points = points * (UNITS[unit] if unit != "auto" else _guess_scale(path, points))
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


def _unpack(path: Path) -> tuple[str, bytes]:
    """Return the kind of file (suffix before .gz or .bz2) and its unpacked bytes."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise ScanError(f"{path}: there is no such file") from error
    except IsADirectoryError as error:
        raise ScanError(f"{path}: is a folder, not a file of points") from error
    except (OSError, ValueError) as error:
        raise ScanError(f"{path}: cannot be read: {error}") from error
    if not data:
        raise ScanError(f"{path}: is empty")
    if suffixes and suffixes[-1] in _PACKED:
        try:
            data = _PACKED[suffixes.pop()](data)
        except (OSError, EOFError, ValueError, zlib.error, MemoryError) as error:
            raise ScanError(f"{path}: cannot be unpacked: {error}") from error
        if not data:
            raise ScanError(f"{path}: is empty once unpacked")
    return (suffixes[-1] if suffixes else ""), data


def _guess_scale(path: Path, points: Array) -> float:
    extent = float(np.ptp(points, axis=0).max())
    fitting = [name for name, scale in UNITS.items() if _SCENE[0] <= extent * scale <= _SCENE[1]]
    if len(fitting) != 1:
        found = f"{' and '.join(fitting)} both fit" if fitting else "none of m, cm, mm fits"
        raise ScanError(f"{path}: cannot guess the unit of an extent of {extent:g}: {found}; give unit=")
    _LOG.info("%s: taken to be in %s", path, fitting[0])
    return UNITS[fitting[0]]


def _read_npy(data: bytes) -> Array:
    array = np.load(io.BytesIO(data), allow_pickle=False)
    if not isinstance(array, np.ndarray):
        raise ScanError("holds several arrays; name it .npz")
    return _first_columns(array)


def _read_npz(data: bytes) -> Array:
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise ScanError("holds one bare array; name it .npy")
            arrays = {name: file[name] for name in file.files}
    except (zipfile.BadZipFile, OSError, zlib.error) as error:
        raise ScanError(f"not a readable .npz file: {error}") from error
    if {"ranges", "angles", "poses"} <= arrays.keys():
        from reconstruction.scans.scan import ScanLog

        return ScanLog(arrays["ranges"], arrays["angles"], arrays["poses"]).points()
    if "points" not in arrays and len(arrays) != 1:
        raise ScanError(f"holds the arrays {', '.join(arrays) or '(none)'}, none of them called points")
    return _first_columns(arrays.get("points", next(iter(arrays.values()))))


def _first_columns(array: np.ndarray) -> Array:
    if array.dtype.names and {"x", "y", "z"} <= set(array.dtype.names):
        return np.stack([array[name].astype(float).ravel() for name in "xyz"], axis=1)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] < 3:
        raise ScanError(f"holds {array.dtype} of shape {array.shape}, not [N, 3] numbers")
    return array[:, :3].astype(np.float64)


def _read_ply(data: bytes) -> Array:
    header = data[: data.find(b"end_header")].split()
    for i, word in enumerate(header[:-2]):
        if word == b"element" and not _is_plausible_count(header[i + 2], len(data)):
            raise ScanError(
                f"the header promises {header[i + 2].decode(errors='replace')} rows in {len(data)} bytes"
            )
    try:
        ply = PlyData.read(io.BytesIO(data))
    except (PlyParseError, UnicodeDecodeError) as error:
        raise ScanError(f"not a readable .ply file: {error}") from error
    if "vertex" not in ply:
        raise ScanError("the .ply file has no element vertex")
    vertex = ply["vertex"]
    missing = [name for name in "xyz" if name not in vertex.data.dtype.names]
    if missing:
        raise ScanError(f"the vertices of the .ply file have no {', '.join(missing)}")
    return np.stack([vertex[name] for name in "xyz"], axis=1).astype(np.float64)


def _is_plausible_count(word: bytes, size: int) -> bool:
    return word.isdigit() and int(word) <= size


def _read_3dtk(data: bytes) -> Array:
    from reconstruction.scans.scan_3dtk import to_right_handed

    return to_right_handed(read_text(data))


def _write_ply(file: io.BufferedWriter, points: Array) -> None:
    rows = np.rec.fromarrays(points.T, names="x,y,z")  # pyright: ignore[reportArgumentType]
    PlyData([PlyElement.describe(np.asarray(rows), "vertex")]).write(file)


_READERS: dict[str, Callable[[bytes], Array]] = {
    ".xyz": read_text,
    ".txt": read_text,
    ".csv": read_text,
    ".dat": read_text,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".ply": _read_ply,
    ".pcd": read_pcd,
    ".vtk": read_vtk,
    ".obj": read_obj,
    ".3d": _read_3dtk,
}
_WRITERS: dict[str, Callable] = {
    ".ply": _write_ply,
    ".xyz": lambda file, points: np.savetxt(file, points, fmt="%.9g"),
    ".txt": lambda file, points: np.savetxt(file, points, fmt="%.9g"),
    ".csv": lambda file, points: np.savetxt(
        file, points, fmt="%.9g", delimiter=",", header="x,y,z", comments=""
    ),
    ".npy": lambda file, points: np.save(file, points, allow_pickle=False),
    ".npz": lambda file, points: np.savez_compressed(file, points=points),
}
