"""What an arena is made of: a surface wound towards free space, and the readings behind it where they are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.base.printable import make_printable
from reconstruction._src.geometry.mesh_repair import RepairConfig, repair_mesh
from reconstruction._src.geometry.orientation import orient_to_viewpoints
from reconstruction._src.geometry.sampling import count_votes, sample_area
from reconstruction._src.input_cloud import shift_frame
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.frames import RawPoints, describe_odd_size, find_offset, to_meters
from symbrion_gym._src.arenas.surface_colors import sample_mesh_colors
from symbrion_gym._src.arenas.surface_file import check_has_surface, load_surface
from symbrion_gym._src.contact.quality import RayMesh
from symbrion_gym._src.errors import ArenaError

if TYPE_CHECKING:
    from reconstruction._src.knowledge.slip.patches import FrictionEstimate
    from reconstruction._src.reconstruction import Reconstruction

_HIDDEN = 1e-3
"""A point of a surface is hidden where the surface is nearer to the viewpoint by more than this [m]."""


def simulate_readings(
    surface: trimesh.Trimesh, viewpoints: Float[np.ndarray, "K 3"], num_points: int = 20_000
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return exact readings of a surface whose scan is not known, and the viewpoint of each."""
    vertices = np.asarray(surface.vertices, dtype=np.float64)
    points = sample_area(vertices, np.asarray(surface.faces, dtype=np.int64), num_points)
    rays, found, seen_from = RayMesh([surface]), [], []
    for index, viewpoint in enumerate(viewpoints):
        ways = points - viewpoint
        ranges = np.maximum(np.linalg.norm(ways, axis=1), _HIDDEN)
        is_seen = rays.cast(np.tile(viewpoint, (len(points), 1)), ways / ranges[:, None]) >= ranges - _HIDDEN
        found.append(points[is_seen])
        seen_from.append(np.full(int(is_seen.sum()), index))
    return np.concatenate(found), np.concatenate(seen_from)


_WITH_FRAME = (".glb", ".gltf", ".dae")  # Formats that say which way is up and in which unit
_FARTHEST = 1e8  # Coordinates beyond this are no place on earth in meters: damaged [m]

_ONE_SIDED = 0.6
"""A face was seen from behind, too, where more than a fifth of its readings say so: this is ahead minus behind."""
_LOOKS_DOWN = -0.2  # Faces whose normal rises less look down, by 12 degrees or more: no noisy walls
_BEHIND = 1e-5  # Rays start this far behind a face, in extents of the mesh


@dataclass(frozen=True, eq=False)
class ScannedSurface:
    """A surface and what was scanned."""

    mesh: trimesh.Trimesh  # faces look at free space where `is_oriented` [m]
    source: str = "mesh"  # name of the file, or "mesh"
    is_oriented: bool = False  # whether the winding tells where free space is
    points: Float[np.ndarray, "N 3"] | None = None  # readings [m]; None: unknown
    viewpoints: Float[np.ndarray, "K 3"] | None = None  # positions of the sensor [m]
    seen_from: Int[np.ndarray, " N"] | None = None  # viewpoint of every reading
    dropped: float | None = None  # share of the readings that pre-processing dropped
    # what was subtracted from the coordinates of the scan [m]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cut: str = ""  # what was cut off as far from every reading, in words; nothing where nothing was
    colored: Cloud | None = None  # points with colors, in the frame of the mesh; None: its colors are unknown
    # that of the ground, as robots felt it by their slip; None: nobody did
    friction: FrictionEstimate | None = None


class MeshFrame(NamedTuple):
    """The frame of a mesh, where the user says it."""

    unit: str | None = None  # name of its unit; None: what the file says, or meters
    up: str | None = None  # axis that points up; None: what the file says, or z
    scale: float = 1.0  # a further factor


def take_surface(
    surface: Reconstruction | trimesh.Trimesh | str | Path,
    viewpoints: ArrayLike | None = None,
    frame: MeshFrame | None = None,
) -> ScannedSurface:
    """Return a reconstruction, a mesh, or a file of either as a surface near the origin of its frame."""
    scanned = _take(surface, frame or MeshFrame())
    if viewpoints is not None:
        scanned = _look_from(scanned, _check_viewpoints(viewpoints) - np.array(scanned.offset))
    return _recenter(scanned)


def repair_surface(scanned: ScannedSurface, config: RepairConfig) -> trimesh.Trimesh:
    """Return the repaired mesh, its winding kept where that tells where free space is."""
    try:
        return repair_mesh(scanned.mesh, replace(config, keeps_winding=scanned.is_oriented))
    except ReconstructionError as error:
        raise ArenaError(f"{scanned.source}: {error}") from error


def find_two_sided(scanned: ScannedSurface, mesh: trimesh.Trimesh) -> Bool[np.ndarray, " F"] | None:
    """Return which faces of the repaired mesh were seen from behind, too; None where nothing tells.

    Readings vote where their viewpoints are known. Without viewpoints an open surface is taken to look up: faces that
    look down and have the open sky behind them, such as the far side of a tree, were seen from there.
    """
    if scanned.viewpoints is None:
        return None if mesh.is_watertight else _find_backs_below_sky(mesh)
    if scanned.points is None:
        return None
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    votes, weights = count_votes(vertices, faces, scanned.points, scanned.viewpoints, scanned.seen_from)
    return np.asarray((weights > 0) & (votes < _ONE_SIDED * weights))


def _find_backs_below_sky(mesh: trimesh.Trimesh) -> Bool[np.ndarray, " F"]:
    """Return which faces look down with nothing above their backs."""
    found = mesh.face_normals[:, 2] < _LOOKS_DOWN
    starts = mesh.triangles_center[found] - _BEHIND * mesh.extents.max() * mesh.face_normals[found]
    ranges = RayMesh([mesh]).cast(starts, np.tile([0.0, 0.0, 1.0], (len(starts), 1)))
    found[found] = np.isinf(ranges)
    return found


def find_doubts(scanned: ScannedSurface) -> list[str]:
    """Return what a user may have meant otherwise: a size that is none of a robot's place, a room without viewpoint."""
    warnings = []
    vertices = np.asarray(scanned.mesh.vertices)
    if scanned.points is None and vertices.ndim == 2 and np.isfinite(vertices).all():
        odd = describe_odd_size(vertices)
        if odd:
            warnings.append(
                f"{scanned.source}: {odd}; a mesh is read in meters: give its unit or scale (--unit, --scale) if it is "
                "in another unit"
            )
    if not scanned.is_oriented and scanned.mesh.is_watertight and scanned.mesh.volume < 0:
        warnings.append(
            f"{scanned.source}: a closed mesh whose faces look inwards is taken as a solid body; if it is a room, "
            "give viewpoints (--viewpoint X Y Z)"
        )
    return warnings


def _take(surface: Reconstruction | trimesh.Trimesh | str | Path, frame: MeshFrame) -> ScannedSurface:
    if isinstance(surface, trimesh.Trimesh):
        placed = _place(surface, frame, "mesh")
        return ScannedSurface(placed, colored=sample_mesh_colors(surface, np.asarray(placed.vertices)))
    if isinstance(surface, str | Path):
        name = make_printable(Path(surface).name)
        check_has_surface(Path(surface))
        if Path(surface).suffix.lower() == ".npz":
            _check_no_frame(frame, name)
            from reconstruction._src.reconstruction import Reconstruction

            try:
                return _take_reconstruction(Reconstruction.load(surface), name)
            except ReconstructionError as error:
                raise ArenaError(str(error)) from error
        if Path(surface).suffix.lower() in _WITH_FRAME:
            return _take_file(Path(surface), name, frame)
        mesh = load_surface(surface)
        placed = _place(mesh, frame, name)
        return ScannedSurface(placed, name, colored=sample_mesh_colors(mesh, np.asarray(placed.vertices)))
    _check_no_frame(frame, "a reconstruction")
    return _take_reconstruction(surface, "reconstruction")


def _check_no_frame(frame: MeshFrame, name: str) -> None:
    if frame != MeshFrame():
        raise ArenaError(
            f"{name}: a reconstruction is in meters, z up; give unit, up and scale where the points are read "
            "(`symbrion reconstruct`, rc.load_cloud)"
        )


def _place(mesh: trimesh.Trimesh, frame: MeshFrame, name: str) -> trimesh.Trimesh:
    """Return a mesh in meters, z up; itself where it is."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if vertices.shape[1:] != (3,):
        raise ArenaError(f"{name}: vertices have three coordinates, not {vertices.shape[-1]}")
    try:
        placed = to_meters(vertices, RawPoints(vertices), *frame)
    except ScanError as error:
        raise ArenaError(str(error)) from error
    return mesh if placed is vertices else trimesh.Trimesh(placed, mesh.faces, process=False)


def _take_file(path: Path, name: str, frame: MeshFrame) -> ScannedSurface:
    """Return a mesh file in meters, z up, by what the user says, else its format."""
    from reconstruction._src.scans.mesh_files import load_mesh

    if not path.is_file():
        raise ArenaError(f"no mesh file {path}")
    try:
        mesh = load_mesh(path, *frame)
    except ScanError as error:
        raise ArenaError(str(error)) from error
    offset = np.asarray(mesh.metadata.get("offset", np.zeros(3)), dtype=np.float64)
    colored = sample_mesh_colors(mesh, np.asarray(mesh.vertices))
    return ScannedSurface(
        mesh, name, offset=(float(offset[0]), float(offset[1]), float(offset[2])), colored=colored
    )


def _take_reconstruction(made: Reconstruction, name: str) -> ScannedSurface:
    readings = made.readings
    return ScannedSurface(
        made.mesh,
        name,
        True,
        readings.points,
        readings.viewpoints,
        readings.seen_from,
        made.dropped,
        (float(made.offset[0]), float(made.offset[1]), float(made.offset[2])),
        str(made.notes.get("cut", "")),
        made.colored_readings,
        made.friction,
    )


def _check_viewpoints(viewpoints: ArrayLike) -> Float[np.ndarray, "K 3"]:
    try:
        array = np.atleast_2d(np.asarray(viewpoints, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ArenaError(f"viewpoints must be positions x, y, z, got {viewpoints!r}") from error
    if array.ndim != 2 or array.shape[1] != 3 or not len(array) or not np.isfinite(array).all():
        raise ArenaError(f"viewpoints must be one or more finite positions x, y, z, got {viewpoints!r}")
    return array


def _look_from(scanned: ScannedSurface, viewpoints: Float[np.ndarray, "K 3"]) -> ScannedSurface:
    """Return a surface whose components look to the viewpoints that saw them.

    Of a mesh without readings only what a viewpoint sees has a vote: the underside of a table that was seen from above
    has none, and stays the underside of its top.
    """
    mesh, points, seen_from = scanned.mesh, scanned.points, None
    if points is None:
        mesh = mesh.copy()
        mesh.merge_vertices(merge_tex=True, merge_norm=True)  # triangles of an .stl share none
        points, seen_from = _see(mesh, viewpoints)
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    turned, _ = orient_to_viewpoints(vertices, faces, points, viewpoints, seen_from)
    mesh = trimesh.Trimesh(turned.vertices, turned.faces, process=False)
    return replace(scanned, mesh=mesh, viewpoints=viewpoints, seen_from=None, is_oriented=True)


def _see(
    mesh: trimesh.Trimesh, viewpoints: Float[np.ndarray, "K 3"]
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return exact readings of a mesh; none of one that has no area or is damaged, which the repair refuses."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if not np.isfinite(vertices).all() or not mesh.area > 0:
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    return simulate_readings(mesh, viewpoints)


def _recenter(scanned: ScannedSurface) -> ScannedSurface:
    """Return a surface near the origin: what is far off is moved by whole meters."""
    vertices = np.asarray(scanned.mesh.vertices, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        return scanned  # the repair refuses it
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    if not len(finite) or float(np.abs(finite).max()) > _FARTHEST:
        return scanned
    step = find_offset(finite)
    if not step.any():
        return scanned
    total = np.array(scanned.offset) + step
    return replace(
        scanned,
        mesh=trimesh.Trimesh(vertices - step, scanned.mesh.faces, process=False),
        points=None if scanned.points is None else scanned.points - step,
        viewpoints=None if scanned.viewpoints is None else scanned.viewpoints - step,
        colored=None if scanned.colored is None else shift_frame(scanned.colored, step),
        offset=(float(total[0]), float(total[1]), float(total[2])),
    )
