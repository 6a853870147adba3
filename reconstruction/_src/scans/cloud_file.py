"""Files of points of every kind, read as an array or as a cloud, in meters with z up; and arrays written to files."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Bool, Float, Shaped
from numpy.typing import ArrayLike

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import (
    MAX_BYTES,
    BoundedFile,
    UnreadableFileError,
    check_size,
    find_npz_names,
    name_file,
    open_bounded,
    read_array,
    read_npz,
)
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.frames import (
    UP_AXES,
    RawPoints,
    describe_odd_size,
    find_grid,
    find_offset,
    to_meters,
)
from reconstruction._src.scans.ground import find_heights_above_ground
from reconstruction._src.scans.mesh_files import CONVERTERS, MESH_ENDINGS, check_plain, find_kind, read_mesh
from reconstruction._src.scans.pcd import read_pcd
from reconstruction._src.scans.ply import read_ply, write_ply
from reconstruction._src.scans.point_rows import check_num_points
from reconstruction._src.scans.ros_bags import read_bag
from reconstruction._src.scans.scan import ScanLog, load_3dtk, read_3dtk_points, read_3dtk_pose
from reconstruction._src.scans.selection import crop
from reconstruction._src.scans.sensor_frame import (
    find_tilt,
    find_up,
    find_upright,
    has_ground_below,
    is_seen_from_origin,
    may_look_down,
)
from reconstruction._src.scans.survey_files import read_e57, read_las
from reconstruction._src.scans.text_points import read_obj, read_text, read_vtk

_logger = logging.getLogger(__name__)

_MIN_POINTS = 3  # Fewer points span no plane
_COARSE = 0.02  # A grid of larger steps hides what stops a robot [m]
_TALLEST = 2.0  # What is higher above the ground meets no robot [m]
_ROW_RANGE = 1000.0  # Farther than any automotive laser sees [m]; other .bin files have such numbers
_NPZ_EXTRAS = ("colors", "viewpoints", "seen_from")  # Arrays of an .npz that go with its array ``points``


def load_points(
    path: str | os.PathLike[str], unit: str | None = None, max_bytes: float = MAX_BYTES
) -> Float[np.ndarray, "N 3"]:
    """Read the points of a file [m]; rows that are not finite are dropped, their number is logged.

    Points are: in a text file the columns named x, y, z, or the first three; in a mesh the vertices; in an .npz
    the array ``points``, or the only one, or the points of a scan log; in a 3DTK scan (.3d) its points in a
    right-handed frame with z up (it is always in centimeters, so `unit` has no effect). `load_cloud` reads colors
    and positions of the sensor as well, and keeps large coordinates exact.

    Args:
        path: .xyz .txt .csv .asc .dat .pts .npy .npz .ply .pcd .vtk .obj .3d .las .laz .bin (rows of float32, as of
            KITTI), each also followed by .gz or .bz2; .e57 .bag .mcap .stl .off .glb .gltf .dae.
        unit: "m", "cm", "mm", "ft", "us-ft" or "in"; None: what the file says, meters where it does not.
        max_bytes: most bytes that the file may hold uncompressed, and its points in memory (24 bytes each); a
            larger file is refused before the memory is allocated.

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds fewer than three points; the
            message names the file and the reason.
        MissingExtraError: the library that reads this kind is not installed.
    """
    path = Path(path)
    return _make_cloud(path, _read_raw(path, max_bytes), unit).points


def load_cloud(
    path: str | os.PathLike[str],
    unit: str | None = None,
    up: str | None = None,
    scale: float = 1.0,
    max_bytes: float = MAX_BYTES,
    viewpoints: ArrayLike | None = None,
    any_size: bool = False,
    classes: Sequence[int] | None = None,
) -> Cloud:
    """Read the points of a file with their colors and the positions of the sensor, in meters and with z up.

    Viewpoints come from scan logs (each scan's position), 3DTK scans (`.3d` with `.pose`), VIEWPOINT of .pcd files,
    the poses of .e57 scans, and the arrays ``viewpoints`` and ``seen_from`` of an .npz with ``points``; else the
    scanner stood at the origin where hardly a reading hides another from there. What is found is logged. Coordinates
    far from the origin (1 km) are moved there by whole meters, as meshes keep single precision; `Cloud.offset` is what
    was subtracted.

    Rows that are not finite are dropped, and of a .las file what a robot on the ground neither drives on nor meets:
    noise, water, high vegetation, wires; where it has no classes, but echoes of several heights, what is more than 2 m
    above the ground (Zhang et al. 2003). Their number is logged. A warning is logged about a size that is none of a
    robot's scene.

    Args:
        path: a file of any kind that `load_points` reads. Of a mesh the vertices are the points: `load_mesh` keeps
            its faces.
        unit: "m", "cm", "mm", "ft", "us-ft" or "in"; None: what the file says (.las, .e57, .gltf, .dae, .3d), meters
            where it does not.
        up: axis of the file that points up: "x", "y", "z", "-x", "-y" or "-z"; None: what the file says (.gltf,
            .dae), "z" where it does not, or x or y where floors or a landscape face along it. A picture of a depth
            camera in its own frame and a tilted room are turned until their floor is level.
        scale: a further factor, for files whose unit has no name.
        max_bytes: most bytes that the file may hold unpacked, and its points in memory (24 bytes each).
        viewpoints: `[K, 3]` or `[3]` where the sensor stood, in meters with z up, before large coordinates are moved;
            they replace those of the file.
        any_size: do not warn about the size.
        classes: of the points that are read of a .las or .laz file, such as 2, ground (LAS 1.4, table 17).

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds fewer than three points; there is
            no such unit or axis; z may point down; or the viewpoints are no positions.
        MissingExtraError: the library that reads this kind is not installed.
    """
    path = Path(path)
    raw = _read_sweeps(path, max_bytes) if find_kind(path) == ".3d" else _read_raw(path, max_bytes, classes)
    cloud = _make_cloud(path, raw, unit, up, scale)
    step = find_grid(cloud.points)
    if step > _COARSE:
        _logger.warning(
            "%s: its points stand on a grid of %g mm: they tell no step that is lower", path, 1000 * step
        )
    if (up or raw.up) is None:
        cloud = _turn_upright(path, cloud)
    if viewpoints is not None:
        with name_file(path):
            cloud = cloud.replace(viewpoints=viewpoints, seen_from=None)
    elif cloud.viewpoints is None and is_seen_from_origin(cloud.points) and has_ground_below(cloud.points):
        text = (
            "%s: the scanner is taken to have stood at the origin, which sees all; --viewpoint says otherwise"
        )
        _logger.warning(text, path)
        cloud = cloud.select((cloud.points != 0.0).any(axis=1)).replace(viewpoints=np.zeros((1, 3)))
    if raw.has_cover:
        is_near = find_heights_above_ground(cloud.points) <= _TALLEST
        text = "%s: no point has a class; dropped %d more than %g m above the ground, kept %d; classes 0 1 keep all"
        _logger.warning(text, path, (~is_near).sum(), _TALLEST, is_near.sum())
        cloud = cloud.select(is_near)
    odd = None if any_size else describe_odd_size(cloud.points)
    if odd:
        _logger.warning("%s: %s; if that is wrong, give unit= or scale=", path, odd)
    return recenter(cloud)


def make_log_cloud(log: ScanLog) -> Cloud:
    """Return the points of a log, in its box where it has one, each seen from the position of its scan.

    Equal positions are one viewpoint.
    """
    raw = _find_log_points(log)
    cloud = Cloud(raw.points, raw.colors, raw.viewpoints, raw.seen_from)
    return cloud if log.box is None else crop(cloud, log.box)


def recenter(cloud: Cloud) -> Cloud:
    """Return a cloud whose large coordinates are moved to the origin, with `offset` grown by what was subtracted.

    Args:
        cloud: in meters.
    """
    offset = find_offset(cloud.points)
    if not offset.any():
        return cloud
    _logger.info("moved by %s m: points + offset are the file's coordinates", (-offset).tolist())
    return cloud.shift(offset)


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


def _make_cloud(
    path: Path, raw: RawPoints, unit: str | None, up: str | None = None, scale: float = 1.0
) -> Cloud:
    """Return the finite points of a file in meters with z up, without beams that did not return."""
    finite = np.isfinite(raw.points).all(axis=1)
    missed = _find_missed(raw) & finite
    is_kept = finite & ~missed
    num_kept = int(is_kept.sum())
    if num_kept < _MIN_POINTS:
        raise ScanError(
            f"{path}: {num_kept} of {len(raw.points)} points are finite and stand elsewhere than the sensor; "
            f"{_MIN_POINTS} are needed"
        )
    chosen = slice(None) if is_kept.all() else is_kept
    with name_file(path):
        cloud = Cloud(
            to_meters(raw.points[chosen], raw, unit, up, scale),
            None if raw.colors is None else raw.colors[chosen],
            None if raw.viewpoints is None else to_meters(raw.viewpoints, raw, unit, up, scale),
            None if raw.seen_from is None else raw.seen_from[chosen],
            up=up or raw.up,
        )
    num_dropped = int((~finite).sum()) + raw.num_ignored
    if missed.any():
        text = "%s: dropped %d beams without return, which stand where the sensor stood, kept %d"
        _logger.warning(text, path, missed.sum(), cloud.num_points)
    if num_dropped:
        why = "not finite, or of classes that are not wanted" if raw.num_ignored else "not finite"
        _logger.warning("%s: dropped %d rows that are %s, kept %d", path, num_dropped, why, cloud.num_points)
    return cloud


def _turn_upright(path: Path, cloud: Cloud) -> Cloud:
    """Return a camera's readings with a level floor, and others so that their level surfaces do not stand upright."""
    up = None
    is_there = cloud.viewpoints is None or not cloud.viewpoints.any()
    rotation = find_upright(cloud.points) if is_there else None
    if rotation is not None:
        text = "%s: a camera's readings, turned until the floor is level; --up says otherwise"
        _logger.warning(text, path)
    elif is_there and may_look_down(cloud.points):
        raise ScanError(
            f"{path}: a camera that looks down may have seen it; give --up -z if so, else another axis, such as z "
            "(up='-z')"
        )
    elif (up := find_up(cloud.points)) is not None:
        rotation = np.array(UP_AXES[up], dtype=np.float64)
        text = "%s: %s is taken for up, as a floor or a landscape faces along it; --up says otherwise"
        _logger.warning(text, path, up)
    elif (rotation := find_tilt(cloud.points)) is not None:
        _logger.warning("%s: tilted; turned until the floor is level; --up says otherwise", path)
    else:
        return cloud
    viewpoints = None if cloud.viewpoints is None else cloud.viewpoints @ rotation.T
    return cloud.replace(points=cloud.points @ rotation.T, viewpoints=viewpoints, up=up)


def _find_missed(raw: RawPoints) -> Bool[np.ndarray, " N"]:
    """Return which readings stand at the origin or at their own viewpoint, where these are more than one: no return."""
    missed = ~raw.points.any(axis=1)
    if raw.viewpoints is not None and (raw.seen_from is not None or len(raw.viewpoints) == 1):
        rows = 0 if raw.seen_from is None else raw.seen_from
        missed |= (raw.points == raw.viewpoints[rows]).all(axis=1)
    return missed & (missed.sum() > 1)


def _read_raw(path: Path, max_bytes: float, classes: Sequence[int] | None = None) -> RawPoints:
    """Read what a file holds, in its own frame; rows may hold nan."""
    kind = find_kind(path)
    if classes is not None and kind not in (".las", ".laz"):
        raise ScanError(f"{path}: only .las and .laz files have classes; leave out classes")
    try:
        if kind in _PATH_READERS:
            check_plain(path, kind, max_bytes)
            raw = _PATH_READERS[kind](path, max_bytes)
            check_size(raw.points.nbytes, max_bytes)
        else:
            with open_bounded(path, max_bytes) as file:
                if kind not in _READERS:
                    if kind in CONVERTERS:
                        raise ScanError(f"{kind} is not read; {CONVERTERS[kind]}")
                    known = " ".join((*_READERS, *_PATH_READERS))
                    raise ScanError(f"unknown kind {kind or '(no suffix)'}; there are: {known}")
                raw = _READERS[kind](file) if classes is None else read_las(file, classes)
    except MissingExtraError:
        raise
    except (ScanError, UnreadableFileError) as error:
        raise ScanError(f"{path}: {error}") from error
    except Exception as error:  # the libraries raise every kind of error on broken bytes
        reason = str(error).partition("\n")[0]
        raise ScanError(f"{path}: not a readable {kind} file: {reason}; copy or export it again") from error
    return raw


def _read_npz(file: BoundedFile) -> RawPoints:
    names = find_npz_names(file.stream)
    if {"ranges", "angles", "poses"} <= set(names):
        wanted = [name for name in ("ranges", "angles", "poses", "colors") if name in names]
        log = read_npz(file.stream, wanted, file.max_bytes)
        check_num_points(file, log["ranges"].size)
        return _find_log_points(ScanLog(**log))  # pyright: ignore[reportArgumentType]
    if "points" not in names and len(names) != 1:
        raise ScanError(f"holds the arrays {', '.join(names) or '(none)'}, none of them called points")
    name = "points" if "points" in names else names[0]
    extras = [extra for extra in _NPZ_EXTRAS if extra in names and name == "points"]
    arrays = read_npz(file.stream, (name, *extras), file.max_bytes)
    points = _first_columns(arrays.pop(name), file)
    known = Cloud(
        np.zeros(points.shape), arrays.get("colors"), arrays.get("viewpoints"), arrays.get("seen_from")
    )  # refuses what does not belong together
    return RawPoints(points, known.colors, known.viewpoints, known.seen_from)


def _read_float_rows(file: BoundedFile) -> RawPoints:
    """Read rows of float32, as data sets of driving and of rooms have them; what fits tells which.

    x, y, z, reflectance (KITTI; Geiger et al. 2013, IJRR 32(11), table 1), x, y, z, intensity, ring (nuScenes), or
    x, y, z, red, green, blue (ScanNet, SUN RGB-D).
    """
    check_num_points(file, file.size // 16)
    content = file.read_exactly(file.size)
    for width in (width for width in (6, 5, 4) if file.size % (4 * width) == 0):  # the strictest first
        rows = np.frombuffer(content, "<f4").reshape(-1, width)
        extras = rows[:, 3:]
        if not (
            (np.abs(rows[:, :3]) < _ROW_RANGE).all() and (extras >= 0).all() and np.isfinite(extras).all()
        ):
            continue
        largest, is_whole = extras.max(initial=0), extras == np.round(extras)
        if width == 6 and (largest <= 1 or (largest <= 255 and is_whole.all())):
            colors = np.round(extras * (255 if largest <= 1 else 1)).astype(np.uint8)
            return RawPoints(rows[:, :3].astype(np.float64), colors, meters=1.0, up="z")
        if width == 4 or (width == 5 and is_whole[:, 1].all()):
            return RawPoints(rows[:, :3].astype(np.float64), meters=1.0, up="z")
    raise ScanError(
        f"{file.size} bytes are no rows of float32, below {_ROW_RANGE:.0f} m and with reflectance (KITTI), intensity "
        f"and ring (nuScenes) or color; {CONVERTERS['.bin']}"
    )


def _first_columns(array: Shaped[np.ndarray, "*axes"], file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    has_names = {"x", "y", "z"} <= set(array.dtype.names or ())
    check_num_points(file, array.size if has_names else len(np.atleast_1d(array)))
    if has_names:
        return np.stack([array[name].astype(float).ravel() for name in "xyz"], axis=1)
    if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] < 3:
        raise ScanError(f"holds {array.dtype} of shape {array.shape}, not [N, 3] numbers")
    return array[:, :3].astype(np.float64)


def _find_log_points(log: ScanLog) -> RawPoints:
    """Return the points of a log with the position of each scan as a viewpoint; equal positions count once."""
    positions = log.poses[:, :3, 3]
    _, first, index = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # in the order of the scans, not of the coordinates
    rank = np.argsort(order)
    seen_from = rank[index.ravel()][np.nonzero(log.is_valid)[0]]
    return RawPoints(log.points(), log.point_colors, positions[first[order]], seen_from, meters=1.0, up="z")


def _read_sweeps(path: Path, max_bytes: float) -> RawPoints:
    """Read a 3DTK scan in the frame of its pose; of an ordered one without the beams that did not return.

    The points of a .3d stand in the scanner's own frame: without .pose, that is the frame of the cloud.
    """
    has_pose = path.with_suffix(".pose").is_file()
    if has_pose:
        try:
            raw = _find_log_points(load_3dtk(path, max_bytes))
            if len(raw.points):
                return raw._replace(has_fixed_unit=True)
        except ScanError:
            _logger.info("%s is not ordered in sweeps: read as points", path)
    raw = _read_raw(path, max_bytes)
    pose = read_3dtk_pose(path.with_suffix(".pose")) if has_pose else np.eye(4)
    return raw._replace(points=raw.points @ pose[:3, :3].T + pose[:3, 3], viewpoints=pose[None, :3, 3])


def _write_text(file: BinaryIO, points: Float[np.ndarray, "N 3"], **options: str) -> None:
    np.savetxt(file, points, fmt="%.9g", **options)  # nine digits: 10 micrometers at a kilometer


_READERS: dict[str, Callable[[BoundedFile], RawPoints]] = {
    **dict.fromkeys((".xyz", ".txt", ".csv", ".asc", ".dat", ".pts"), read_text),
    ".npy": lambda file: RawPoints(_first_columns(read_array(file.stream, file.size), file)),
    ".npz": _read_npz,
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".vtk": read_vtk,
    ".obj": read_obj,
    ".3d": lambda file: RawPoints(read_3dtk_points(file), meters=1.0, has_fixed_unit=True, up="z"),
    ".las": read_las,
    ".laz": read_las,
    ".bin": _read_float_rows,
}
_PATH_READERS: dict[str, Callable[[Path, float], RawPoints]] = {
    ".e57": read_e57,
    **dict.fromkeys((".bag", ".mcap"), read_bag),
    **dict.fromkeys(
        (".stl", ".off", ".glb", ".gltf", ".dae"), lambda path, max_bytes: read_mesh(path, max_bytes)[1]
    ),
}
POINT_ENDINGS = (
    *(kind for kind in _READERS if kind not in (".npz", ".ply", ".obj")),
    *(kind for kind in _PATH_READERS if kind not in MESH_ENDINGS),
)
"""Of files that hold points alone."""
_WRITERS: dict[str, Callable[[BinaryIO, Float[np.ndarray, "N 3"]], None]] = {
    ".ply": write_ply,
    ".xyz": _write_text,
    ".txt": _write_text,
    ".csv": functools.partial(_write_text, delimiter=",", header="x,y,z", comments=""),
    ".npy": functools.partial(np.save, allow_pickle=False),
    ".npz": lambda file, points: np.savez_compressed(file, points=points),
}
