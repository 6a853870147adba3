"""Point files of every kind as they stand: .xyz .txt .csv .asc .dat .pts .npy .npz .ply .pcd .vtk .obj .3d .las .laz,
also compressed by gzip or bzip2, and .e57 .stl .off .glb .gltf .dae.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float, Shaped

from reconstruction._src.base.bounded_read import (
    BoundedFile,
    UnreadableFileError,
    check_size,
    find_npz_names,
    open_bounded,
    read_array,
    read_npz,
)
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.e57 import read_e57
from reconstruction._src.scans.las import read_las
from reconstruction._src.scans.mesh_files import CONVERTERS, read_mesh_points
from reconstruction._src.scans.pcd import read_pcd
from reconstruction._src.scans.ply import read_ply
from reconstruction._src.scans.point_rows import RawPoints
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.scan_3dtk import to_right_handed
from reconstruction._src.scans.text_points import read_obj, read_text, read_vtk

_MIN_POINTS = 3  # Fewer points span no plane


def read_raw(path: Path, max_bytes: float) -> RawPoints:
    """Read what a file holds, in its own frame; rows may hold nan."""
    kind = find_kind(path)
    try:
        if kind in _PATH_READERS:
            raw = _read_plain(path, kind, max_bytes)
        else:
            with open_bounded(path, max_bytes) as file:
                if kind not in _READERS:
                    raise ScanError(_refuse_kind(kind))
                raw = _READERS[kind](file)
    except MissingExtraError:
        raise
    except (ScanError, UnreadableFileError) as error:
        raise ScanError(f"{path}: {error}") from error
    except Exception as error:  # the libraries raise every kind of error on broken bytes
        raise ScanError(f"{path}: not a readable {kind} file: {error}") from error
    points = raw.points
    if points.ndim != 2 or points.shape[1] != 3:
        raise ScanError(f"{path}: holds an array of shape {points.shape}, not [N, 3] points")
    num_finite = int(np.isfinite(points).all(axis=1).sum())
    if num_finite < _MIN_POINTS:
        raise ScanError(
            f"{path}: {len(points)} points, {num_finite} of them finite; at least {_MIN_POINTS} are needed"
        )
    return raw


def find_kind(path: Path) -> str:
    """Return the ending that says what a file holds, in lower case: that before .gz or .bz2."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if suffixes and suffixes[-1] in _PACKINGS:
        suffixes.pop()
    return suffixes[-1] if suffixes else ""


def _refuse_kind(kind: str) -> str:
    if kind in CONVERTERS:
        return f"{kind} is not read; {CONVERTERS[kind]}"
    return f"unknown kind {kind or '(no suffix)'}; there are: {' '.join((*_READERS, *_PATH_READERS))}"


def _read_plain(path: Path, kind: str, max_bytes: float) -> RawPoints:
    """Read a file whose library needs its path."""
    if not path.is_file():
        raise ScanError("is a folder, not a file" if path.is_dir() else "there is no such file")
    if path.suffix.lower() in _PACKINGS:
        raise ScanError(f"a packed {kind} file is not read; unpack it first")
    if not path.stat().st_size:
        raise ScanError("is empty")
    check_size(path.stat().st_size, max_bytes)
    raw = _PATH_READERS[kind](path, max_bytes)
    check_size(raw.points.nbytes, max_bytes)
    return raw


def _read_npy(file: BoundedFile) -> RawPoints:
    return RawPoints(_first_columns(read_array(file.stream, file.size), file))


def _read_npz(file: BoundedFile) -> RawPoints:
    names = find_npz_names(file.stream)
    if {"ranges", "angles", "poses"} <= set(names):
        colors = ("colors",) if "colors" in names else ()
        log = read_npz(file.stream, ("ranges", "angles", "poses", *colors), file.max_bytes)
        point_rows.check_num_points(file, log["ranges"].size)
        known = log.get("colors")
        return find_log_points(ScanLog(log["ranges"], log["angles"], log["poses"], colors=known))
    if "points" not in names and len(names) != 1:
        raise ScanError(f"holds the arrays {', '.join(names) or '(none)'}, none of them called points")
    name = "points" if "points" in names else names[0]
    extras = [extra for extra in _NPZ_EXTRAS if extra in names and name == "points"]
    arrays = read_npz(file.stream, (name, *extras), file.max_bytes)
    points = _first_columns(arrays.pop(name), file)
    known = Cloud(np.zeros(points.shape), **arrays)  # refuses what does not belong together
    return RawPoints(points, known.colors, known.viewpoints, known.seen_from)


def _first_columns(array: Shaped[np.ndarray, "*axes"], file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    has_names = {"x", "y", "z"} <= set(array.dtype.names or ())
    point_rows.check_num_points(file, array.size if has_names else len(np.atleast_1d(array)))
    if has_names:
        return np.stack([array[name].astype(float).ravel() for name in "xyz"], axis=1)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] < 3:
        raise ScanError(f"holds {array.dtype} of shape {array.shape}, not [N, 3] numbers")
    return array[:, :3].astype(np.float64)


def _read_3dtk(file: BoundedFile) -> RawPoints:
    return RawPoints(to_right_handed(read_text(file).points), meters=1.0, has_fixed_unit=True, up="z")


def find_log_points(log: ScanLog) -> RawPoints:
    """Return the points of a log with the position of each scan as a viewpoint; equal positions count once."""
    positions = log.poses[:, :3, 3]
    _, first, index = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # in the order of the scans, not of the coordinates
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    seen_from = rank[index.ravel()][np.nonzero(log.is_valid)[0]]
    return RawPoints(log.points(), log.point_colors, positions[first[order]], seen_from, meters=1.0, up="z")


_NPZ_EXTRAS = ("colors", "viewpoints", "seen_from")  # Arrays of an .npz that go with its array ``points``
_PACKINGS = (".gz", ".bz2")
_READERS: dict[str, Callable[[BoundedFile], RawPoints]] = {
    ".xyz": read_text,
    ".txt": read_text,
    ".csv": read_text,
    ".asc": read_text,
    ".dat": read_text,
    ".pts": read_text,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".vtk": read_vtk,
    ".obj": read_obj,
    ".3d": _read_3dtk,
    ".las": read_las,
    ".laz": read_las,
}
_PATH_READERS: dict[str, Callable[[Path, float], RawPoints]] = {
    ".e57": read_e57,
    ".stl": read_mesh_points,
    ".off": read_mesh_points,
    ".glb": read_mesh_points,
    ".gltf": read_mesh_points,
    ".dae": read_mesh_points,
}
