"""The points of a file as one array, and arrays of points written to files. `load_cloud` keeps more of a file."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import MAX_BYTES
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.frames import UNITS, make_frame
from reconstruction._src.scans.ply import write_ply
from reconstruction._src.scans.point_files import read_raw

_logger = logging.getLogger(__name__)

SCENE_EXTENT = (2.0, 100.0)
"""Extent of a scene that a robot scans [m]: a room is larger than 2 m, and 100 m is the reach of its scanner.
Its ends are a factor of 50 apart, so m and cm never both fit."""
DROPPED = "%s: dropped %d rows that are not finite or marked as noise, kept %d"
"""What is logged about a file with rows that cannot be used."""
_GUESSED_UNITS = ("m", "cm", "mm")
"""Units that "auto" chooses from: feet and inches are too close to meters and centimeters."""
_NUMBER_FORMAT = "%.9g"  # Nine digits: 10 micrometers at a kilometer


def load_points(
    path: str | os.PathLike[str],
    unit: str | None = None,
    max_bytes: float = MAX_BYTES,
    scene_extent: tuple[float, float] = SCENE_EXTENT,
) -> Float[np.ndarray, "N 3"]:
    """Read the points of a file [m]; rows that are not finite are dropped, their number is logged.

    Points are: in a text file the columns named x, y, z, or the first three; in a mesh the vertices; in an .npz
    the array ``points``, or the only one, or the points of a scan log; in a 3DTK scan (.3d) its points in a
    right-handed frame with z up (it is always in centimeters, so `unit` has no effect). `load_cloud` reads colors
    and positions of the sensor as well, and keeps large coordinates exact.

    Args:
        path: .xyz .txt .csv .asc .dat .pts .npy .npz .ply .pcd .vtk .obj .3d .las .laz, each also followed by .gz
            or .bz2; .e57 .stl .off .glb .gltf .dae.
        unit: "m", "cm", "mm", "ft", "us-ft" or "in"; None: what the file says, meters where it does not; "auto"
            selects the one of m, cm and mm that makes the extent that of a scene, if only one does.
        max_bytes: most bytes that the file may hold uncompressed, and its points in memory (24 bytes each); a
            larger file is refused before the memory is allocated.
        scene_extent: smallest and largest extent of a scene [m], for the unit "auto".

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds fewer than three points; the
            message names the file and the reason.
        MissingExtraError: the library that reads this kind is not installed.
    """
    points, num_dropped = read_points(path, unit, max_bytes, scene_extent)
    if num_dropped:
        _logger.warning(
            "%s: dropped %d rows that are not finite or marked as noise, kept %d",
            path,
            num_dropped,
            len(points),
        )
    return points


def read_points(
    path: str | os.PathLike[str],
    unit: str | None = None,
    max_bytes: float = MAX_BYTES,
    scene_extent: tuple[float, float] = SCENE_EXTENT,
) -> tuple[Float[np.ndarray, "N 3"], int]:
    """Read points as `load_points` does; return them and how many were dropped as not finite or marked as noise."""
    path = Path(path)
    if unit not in (None, "auto", *UNITS):
        raise ScanError(f"{path}: unknown unit {unit!r}; there are: {', '.join(UNITS)}, auto")
    raw = read_raw(path, max_bytes)
    points = raw.points
    finite = np.asarray(np.isfinite(points).all(axis=1))
    if not finite.all():
        points = points[finite]
    named = None if unit == "auto" else unit
    if unit == "auto" and raw.meters is None:
        named = _guess_unit(path, points, scene_extent)
    return make_frame(raw, named).place(points), int(len(finite) - len(points)) + raw.num_ignored


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


def _guess_unit(path: Path, points: Float[np.ndarray, "N 3"], scene_extent: tuple[float, float]) -> str:
    smallest, largest = scene_extent
    extent = float(np.ptp(points, axis=0).max())
    fitting = [name for name in _GUESSED_UNITS if smallest <= extent * UNITS[name] <= largest]
    if len(fitting) != 1:
        found = f"{' and '.join(fitting)} both fit" if fitting else "none of m, cm, mm fits"
        raise ScanError(f"{path}: cannot guess the unit of an extent of {extent:g}: {found}; give unit=")
    _logger.info("%s: the unit is %s, by its extent", path, fitting[0])
    return fitting[0]


def _write_text(file: BinaryIO, points: Float[np.ndarray, "N 3"], **options: str) -> None:
    np.savetxt(file, points, fmt=_NUMBER_FORMAT, **options)


_WRITERS: dict[str, Callable[[BinaryIO, Float[np.ndarray, "N 3"]], None]] = {
    ".ply": write_ply,
    ".xyz": _write_text,
    ".txt": _write_text,
    ".csv": functools.partial(_write_text, delimiter=",", header="x,y,z", comments=""),
    ".npy": functools.partial(np.save, allow_pickle=False),
    ".npz": lambda file, points: np.savez_compressed(file, points=points),
}
