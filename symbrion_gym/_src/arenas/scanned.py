"""What an arena is made of: a surface wound towards free space, and the readings behind it where they are known."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.base.printable import make_printable
from reconstruction._src.geometry.manifold import make_winding
from reconstruction._src.geometry.mesh_repair import repair_mesh
from reconstruction._src.geometry.orientation import (
    find_up_axis,
    is_y_likely,
    looks_down_below,
    orient_to_viewpoints,
)
from reconstruction._src.geometry.rows import compute_area_vectors, compute_areas
from reconstruction._src.geometry.sampling import count_votes, sample_area
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.frames import UP_AXES, RawPoints, describe_odd_size, find_offset, to_meters
from reconstruction._src.surfaces.far_faces import select_faces
from symbrion_gym._src.arenas.surface_file import check_has_surface
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality, RayMesh
from symbrion_gym._src.contact.reach import Reach
from symbrion_gym._src.contact.visibility import measure_visibility
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.traversability.footprint import SLOPE_LIMIT

if TYPE_CHECKING:
    from reconstruction._src.knowledge.slip.patches import FrictionEstimate
    from reconstruction._src.reconstruction import Reconstruction

_WITH_AXIS = (".glb", ".gltf", ".dae")  # Formats that say which axis points up
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
    # axis of its file that points up, as user, file or surface say; None: nothing says it
    up: str | None = None
    cut: str = ""  # what was cut off as far from every reading, in words; nothing where nothing was
    colored: Cloud | None = None  # points with colors, in the frame of the mesh; None: its colors are unknown
    # that of the ground, as robots felt it by their slip; None: nobody did
    friction: "FrictionEstimate | None" = None


class MeshFrame(NamedTuple):
    """The frame of a mesh, where the user says it."""

    unit: str | None = None  # name of its unit; None: what the file says, or meters
    up: str | None = None  # axis that points up; None: what the file says, or z
    scale: float = 1.0  # a further factor


def take_surface(
    surface: "Reconstruction | trimesh.Trimesh | str | Path",
    viewpoints: ArrayLike | None = None,
    frame: MeshFrame | None = None,
) -> ScannedSurface:
    """Return a reconstruction, a mesh, or a file of either as a surface near the origin of its frame."""
    scanned = _take(surface, frame or MeshFrame())
    if viewpoints is not None:
        scanned = _look_from(scanned, _check_viewpoints(viewpoints) - np.array(scanned.offset))
    return _recenter(scanned)


def repair_surface(scanned: ScannedSurface) -> trimesh.Trimesh:
    """Return the repaired mesh, its winding kept where that tells where free space is."""
    try:
        return repair_mesh(scanned.mesh, keeps_winding=scanned.is_oriented, drops_slivers=True)
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


_SEEN = 0.3
"""A place farther from every reading than this was not seen [m]: three Scouts, on whose way it can hide nothing."""


def find_unseen(mesh: trimesh.Trimesh, points: Float[np.ndarray, "N 3"] | None) -> tuple[int, ...]:
    """Return the faces of a mesh that are far from every reading; none where the readings are not known."""
    if points is None:
        return ()
    tree = cKDTree(points)

    def is_far(places: Float[np.ndarray, "M 3"]) -> Bool[np.ndarray, " M"]:
        return np.isinf(tree.query(places, distance_upper_bound=_SEEN)[0])

    found = select_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), is_far)
    return tuple(np.flatnonzero(found).tolist())


def _take(surface: "Reconstruction | trimesh.Trimesh | str | Path", frame: MeshFrame) -> ScannedSurface:
    from reconstruction._src.reconstruction import Reconstruction
    from reconstruction._src.scans.mesh_files import load_mesh

    name, is_file = "mesh", isinstance(surface, str | Path)
    try:
        if isinstance(surface, str | Path):
            path = Path(surface)
            name = make_printable(path.name)
            check_has_surface(path)
            if path.suffix.lower() != ".npz":
                mesh = load_mesh(path, *frame)
                _check_size(name, np.asarray(mesh.vertices), frame)
                if frame.up is None:
                    _turn_upright(mesh, path, name)
                x, y, z = map(float, mesh.metadata["offset"])
                colored = sample_mesh_colors(mesh, np.asarray(mesh.vertices))
                return ScannedSurface(mesh, name, offset=(x, y, z), up=mesh.metadata["up"], colored=colored)
            surface = Reconstruction.load(path)
        if not isinstance(surface, trimesh.Trimesh):
            return _take_reconstruction(surface, name if is_file else "reconstruction", frame)
        vertices = np.asarray(surface.vertices, dtype=np.float64)
        if np.shape(vertices)[1:] != (3,):
            raise ArenaError(f"{name}: vertices have three coordinates, not {vertices.shape}")
        placed = to_meters(vertices, RawPoints(vertices), *frame)
        _check_size(name, placed, frame)
    except (ReconstructionError, ScanError) as error:
        raise ArenaError(str(error)) from error
    mesh = surface if placed is vertices else trimesh.Trimesh(placed, surface.faces, process=False)
    return ScannedSurface(mesh, name, up=frame.up, colored=sample_mesh_colors(surface, placed))


def _check_size(name: str, vertices: Float[np.ndarray, "V 3"], frame: MeshFrame) -> None:
    """Refuse a mesh whose size is none of a robot's place, and whose unit nobody said."""
    odd = describe_odd_size(vertices) if np.isfinite(vertices).all() else None
    if odd and frame.unit is None and frame.scale == 1.0:
        remedy = "give its --unit or --scale, or --unit m if that is right (in Python unit=)"
        raise ArenaError(f"{name}: {odd}; {remedy}")


def _turn_upright(mesh: trimesh.Trimesh, path: Path, name: str) -> None:
    """Turn a mesh whose floors face along another axis than up, and log it; refuse one that may have y up."""
    told = mesh.metadata["up"] or "z"
    to_file, shift = np.array(UP_AXES[told], dtype=np.float64), 2 - "xyz".index(told[-1])
    vertices, faces = np.asarray(mesh.vertices) @ to_file, np.asarray(mesh.faces)
    areas = np.roll(compute_area_vectors(vertices, faces), shift, axis=1)  # what is told to be up comes last
    axis = find_up_axis(areas, np.roll(vertices[faces].mean(axis=1), shift, axis=1))
    if axis is None:
        if path.suffix.lower() not in _WITH_AXIS and is_y_likely(areas, vertices):
            raise ArenaError(
                f"{name}: y or z may point up; give --up y, as phones write, or -y, z or -z (in Python up=)"
            )
        return
    up = axis[:-1] + "xyz"["xyz".index(axis[-1]) - shift]
    _logger.warning("%s: %s is taken for up, as floors face along it; --up says otherwise", name, up)
    axes = np.array(UP_AXES[up], dtype=np.float64)
    mesh.vertices = vertices @ axes.T
    mesh.metadata = {"offset": axes @ to_file.T @ mesh.metadata["offset"], "up": up}


def _take_reconstruction(made: "Reconstruction", name: str, frame: MeshFrame) -> ScannedSurface:
    if frame != MeshFrame():
        raise ArenaError(
            f"{name}: a reconstruction is in meters, z up; give unit, up and scale where the points are read "
            "(`symbrion reconstruct`, rc.load_cloud)"
        )
    readings, mesh = made.readings, made.mesh
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if made.viewpoints is None and looks_down_below(vertices, faces):
        _logger.warning(
            "%s: without viewpoints its lowest level surface is taken for a floor, seen from above", name
        )
        mesh = trimesh.Trimesh(vertices, faces[:, ::-1], process=False)
    return ScannedSurface(
        mesh,
        name,
        True,
        readings.points,
        readings.viewpoints,
        readings.seen_from,
        made.dropped,
        (float(made.offset[0]), float(made.offset[1]), float(made.offset[2])),
        made.notes.get("up"),
        str(made.notes.get("cut", "")),
        made.colored_readings,
        made.friction,
    )


def _check_viewpoints(viewpoints: ArrayLike) -> Float[np.ndarray, "K 3"]:
    try:
        array = np.atleast_2d(np.asarray(viewpoints, dtype=np.float64))
    except (TypeError, ValueError):
        array = np.zeros((0, 3))
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
        points = np.zeros((0, 3))
        if np.isfinite(mesh.vertices).all() and mesh.area > 0:  # else the repair refuses it
            points, seen_from = simulate_readings(mesh, viewpoints)
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = make_winding(vertices, np.asarray(mesh.faces, dtype=np.int64))
    turned, _ = orient_to_viewpoints(vertices, faces, points, viewpoints, seen_from)
    mesh = trimesh.Trimesh(turned.vertices, turned.faces, process=False)
    return replace(scanned, mesh=mesh, viewpoints=viewpoints, seen_from=None, is_oriented=True)


def _recenter(scanned: ScannedSurface) -> ScannedSurface:
    """Return a surface near the origin: what is far off is moved by whole meters."""
    vertices = np.asarray(scanned.mesh.vertices, dtype=np.float64)
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    is_place = vertices.ndim == 2 and len(finite) and float(np.abs(finite).max()) <= _FARTHEST
    step = find_offset(finite) if is_place else np.zeros(3)  # the repair refuses what is no place
    if not step.any():
        return scanned
    total = np.array(scanned.offset) + step
    return replace(
        scanned,
        mesh=trimesh.Trimesh(vertices - step, scanned.mesh.faces, process=False),
        points=None if scanned.points is None else scanned.points - step,
        viewpoints=None if scanned.viewpoints is None else scanned.viewpoints - step,
        colored=None if scanned.colored is None else scanned.colored.shift(step),
        offset=(float(total[0]), float(total[1]), float(total[2])),
    )


def add_scan_quality(
    quality: ArenaQuality,
    scanned: ScannedSurface,
    contact: Sequence[trimesh.Trimesh] | HeightField,
    surface: trimesh.Trimesh,
    zone: Reach | None = None,
) -> ArenaQuality:
    """Return the quality of an arena with the shares of beams, of free space and of dropped readings, within reach.

    What the scan does not tell stays None: beams and free space without viewpoints. With viewpoints and without
    readings, exact readings of the surface take their place.
    """
    points, seen_from = scanned.points, scanned.seen_from
    off = None if points is None else _measure_readings(points, surface)
    quality = replace(quality, dropped=scanned.dropped, readings=off)
    if scanned.viewpoints is None:
        return quality
    if points is None:
        points, seen_from = simulate_readings(surface, scanned.viewpoints)
    if zone is not None:
        is_near = zone.measure_excess(points) <= 0
        points, seen_from = points[is_near], None if seen_from is None else seen_from[is_near]
    seen = measure_visibility(points, scanned.viewpoints, seen_from, contact, surface)
    return quality if seen is None else replace(quality, **seen._asdict())


_NUM_READINGS = 5000  # Readings whose distance from the surface is measured


def _measure_readings(points: Float[np.ndarray, "N 3"], surface: trimesh.Trimesh) -> float | None:
    """Return the median distance of readings from a surface where it is level; None where it is nowhere [m]."""
    chosen = np.random.default_rng(0).permutation(len(points))[:_NUM_READINGS]
    distances, face, _ = find_nearest(points[chosen], np.asarray(surface.vertices), np.asarray(surface.faces))
    is_level = surface.face_normals[face, 2] > np.cos(SLOPE_LIMIT)
    return float(np.median(distances[is_level])) if is_level.any() else None


_NUM_SAMPLES = 200_000  # Points on the faces of a colored mesh: 1 cm apart on 20 m²
_logger = logging.getLogger(__name__)


def sample_mesh_colors(mesh: trimesh.Trimesh, vertices: Float[np.ndarray, "V 3"]) -> Cloud | None:
    """Return points on a mesh with its colors: those of its vertices, its faces or its texture; None without colors.

    One plain color for all, as a texture without a picture gives, is that of a program, not of a scan.
    """
    visual: Any = mesh.visual
    faces = np.asarray(mesh.faces)
    if visual is None or not visual.defined or not len(faces) or not np.isfinite(vertices).all():
        return None
    material = getattr(visual, "material", None)
    pictures = [getattr(material, name, None) for name in ("image", "baseColorTexture")]
    if material is not None and (visual.uv is None or pictures == [None, None]):
        return None
    ends = np.cumsum(compute_areas(vertices, faces))
    if not ends[-1] > 0:
        return None
    place = (np.arange(_NUM_SAMPLES) + 0.5) / _NUM_SAMPLES * ends[-1]
    face = np.minimum(np.searchsorted(ends, place), len(faces) - 1)
    corners, weights = faces[face], np.random.default_rng(0).dirichlet(np.ones(3), _NUM_SAMPLES)
    try:
        if material is not None:
            uv = np.asarray(visual.uv)[corners]
            colors = visual.material.to_color(np.einsum("sk,ski->si", weights, uv))
        elif visual.kind == "face":
            colors = np.asarray(visual.face_colors)[face]
        else:
            colors = np.asarray(visual.vertex_colors)[corners].astype(np.float64)
            colors = np.round(np.einsum("sk,ski->si", weights, colors))
    except Exception as error:  # trimesh needs a library for pictures, and files name some that are not there
        _logger.warning("the colors of the mesh are left out: %s", error)
        return None
    rgb = np.ascontiguousarray(np.asarray(colors)[:, :3], dtype=np.uint8)
    return Cloud(np.einsum("sk,ski->si", weights, vertices[corners]), rgb)
