"""Arenas by name, from folders, and made of surfaces."""

import logging
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.printable import make_printable
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.tiles.folder import INDEX, TiledSurface
from symbrion_gym._src.arenas.arena import Arena, color_arena
from symbrion_gym._src.arenas.cache import find_versions, get_or_make
from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.arenas.course import Course, StairsCourse, make_simple_surface
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch
from symbrion_gym._src.arenas.primitives import add_solids_to_contact, find_arena_primitives, take_solids_out
from symbrion_gym._src.arenas.scanned import (
    MeshFrame,
    add_scan_quality,
    find_two_sided,
    find_unseen,
    repair_surface,
    take_surface,
)
from symbrion_gym._src.assets import NAMED_ARENAS, SCANNED, find_assets
from symbrion_gym._src.contact.builder import make_contact
from symbrion_gym._src.contact.distances import find_accuracy
from symbrion_gym._src.contact.kinds import Contact, ContactOptions
from symbrion_gym._src.contact.reach import Reach
from symbrion_gym._src.errors import ArenaError

if TYPE_CHECKING:
    from reconstruction._src.knowledge.slip.patches import EstimatedPatch, FrictionEstimate
    from reconstruction._src.reconstruction import Reconstruction

_ASSUMED_FRICTION = 0.7  # Rubber tracks on a hard floor, about; a scan does not show it


class GroundFriction(NamedTuple):
    """The friction of a ground."""

    friction: float  # sliding friction outside of all patches
    source: str  # see `Arena.friction_source`
    friction_map: FrictionMap | None  # patches with another friction, or None


def choose_friction(
    friction: float | None,
    friction_map: FrictionMap | None,
    course: Course | StairsCourse | None,
    felt: "FrictionEstimate | None",
) -> GroundFriction:
    """Return the friction of an arena: what is given goes before the course, this before what robots felt.

    Of what they felt the largest patch is the ground outside of the others.
    """
    if friction is not None:
        return GroundFriction(friction, "given", friction_map)
    if course is not None:
        return GroundFriction(course.friction, "exact", friction_map or course.friction_map)
    if felt is None:
        return GroundFriction(_ASSUMED_FRICTION, "assumed", friction_map)
    ground, *others = felt.patches
    patches = tuple(_make_patch(patch) for patch in others if len(patch.rectangles))
    friction_map = friction_map or FrictionMap(patches, ground.half_width)
    return GroundFriction(_clip(ground.friction), "estimated", friction_map)


def _make_patch(patch: "EstimatedPatch") -> FrictionPatch:
    outlines = tuple(((x0, y0), (x1, y0), (x1, y1), (x0, y1)) for x0, y0, x1, y1 in patch.rectangles.tolist())
    return FrictionPatch(_clip(patch.friction), outlines, patch.half_width)


def _clip(friction: float) -> float:
    return float(np.clip(friction, *FRICTION_LIMITS))


_MOST_VIEWPOINTS = 64  # As many positions of the scanner are kept with an arena, evenly spread over the scan
_NO_COLORS = (
    "images of environments and MuJoCo's viewer show an arena of the kind 'mixed' without its colors, which "
    "`symbrion view` and cameras do see; the kind 'convex' shows them everywhere"
)

logger = logging.getLogger(__name__)


def make_arena(
    surface: "Reconstruction | trimesh.Trimesh | str | Path",
    *,
    accuracy: float | None = None,
    reach: float | None = 1.2,
    for_size: float = 0.105,
    max_pieces: int = 2200,
    kind: str = "auto",
    viewpoints: ArrayLike | None = None,
    unit: str | None = None,
    up: str | None = None,
    scale: float = 1.0,
    course: Course | StairsCourse | None = None,
    name: str | None = None,
    friction: float | None = None,
    friction_map: FrictionMap | None = None,
    seed: int = 0,
    cache: bool | str | Path = True,
    progress: Progress = silent,
) -> Arena:
    """Make an arena of a surface: convex pieces for contact that follow it, and the surface itself for rays.

    A terrain of few planes becomes slabs, rough ground a height field, any other surface convex patches of its own,
    thickened away from free space; coacd decomposes a closed body where that gives as good a result. The arena's
    `kind` is "hfield" where a height field was chosen. `Arena.quality` says what was reached, `Arena.provenance` how:
    `passes`, `accuracy`, `is_reached`, `worst`, `warnings`, and `cut`, what of the surface was cut off before.

    Args:
        surface: a reconstruction, whose viewpoints tell where free space is; a mesh; or a file of either; meters,
            z up. Open terrain may be wound either way, closed meshes too; other open meshes must be wound so that
            their faces look at free space, unless viewpoints are given.
        accuracy: mean distance between contact and surface that is good enough [m]; None: about the noise and
            spacing of the scan, but from 1/35 to a tenth of `for_size`, 3 to 10.5 mm.
        reach: height above ground up to which contact has that accuracy [m]; higher up, pieces are accurate to
            5 cm. Distances, beams and free space in `quality` are those within reach. None: everywhere.
        for_size: size of the smallest wheel or body that will drive there [m].
        max_pieces: no more convex pieces than these.
        kind: contact geometry, one of "auto", "convex" (pieces, never a height field), "hfield", "prisms",
            "mixed" (boxes, spheres, cylinders and rectangles in place of triangles, for rays too).
        viewpoints: `[3]` or `[K, 3]` positions of the sensor, in the coordinates of the scan [m], z up.
        unit: of a mesh: "m", "cm", "mm", "ft", "us-ft" or "in"; None: what its file says, meters where it does not.
        up: axis of a mesh that points up: "x", "y", "z", "-x", "-y" or "-z"; None: what its file says, or z.
        scale: a further factor on all lengths of a mesh.
        course: the course that an exact surface, as a drawn one, is known to be: its pit edges, start and goal are
            kept. Never that behind a scan, on whose surface they are found.
        name: what to call it; the file's name unless given.
        friction: sliding friction, everywhere; unless given the course's, that which robots felt by their slip
            (`Reconstruction.friction`: then `friction_map` has its patches), or 0.7, as is assumed of a scan
            (`friction_source`).
        friction_map: patches with another friction; unless given those of the course or of the reconstruction.
        seed: seed of coacd's search.
        cache: whether to keep pieces in the user's cache, or the folder to keep them in.
        progress: called with what is being done and the share done.

    A surface with colors (a reconstruction of colored points, a mesh with colors) gives an arena with a texture.

    Raises:
        ArenaError: the surface cannot be used, an option is out of range, a reconstruction comes with a course, or
            coacd took longer than the time limit. Equal input gives equal arenas, however fast the machine is.
    """
    if course is not None and not isinstance(surface, trimesh.Trimesh | str | Path):
        raise ArenaError("course is the truth behind a scan, of which an arena knows nothing; leave it out")
    scanned = take_surface(surface, viewpoints, MeshFrame(unit, up, scale))
    ground = choose_friction(friction, friction_map, course, scanned.friction)
    if kind == "auto" and ground.friction_map is not None and ground.friction_map.patches:
        kind = "convex"  # a height field has one friction
    options = ContactOptions(accuracy, max_pieces, kind, seed, reach, for_size)
    if name is None and isinstance(surface, str | Path):
        name = make_printable(Path(surface).stem)
    progress("repairing the mesh", 0.0)
    mesh = repair_surface(scanned)
    wanted = accuracy or find_accuracy(mesh, for_size, scanned.points)
    zone = None if reach is None else Reach(mesh, reach, for_size)
    touched, sides, has_rest = mesh, find_two_sided(scanned, mesh), True
    primitives = find_arena_primitives(mesh, seed) if kind == "mixed" else None
    if primitives is not None:
        is_rest = take_solids_out(mesh, primitives)
        has_rest = bool(is_rest.any())
        if has_rest and not is_rest.all():
            touched = trimesh.Trimesh(mesh.vertices, mesh.faces[is_rest], process=False)
            touched.remove_unreferenced_vertices()
            sides = None if sides is None else sides[is_rest]

    def make() -> Contact:
        return make_contact(touched, options, wanted, progress, sides, zone)

    folder = Path(cache) if isinstance(cache, str | Path) else None
    key = replace(options, accuracy=wanted)
    contact = make() if cache is False else get_or_make(touched, key, make, folder, sides)
    if primitives is not None:
        contact = add_solids_to_contact(contact, mesh, primitives, has_rest)
    shapes = contact.pieces if contact.height_field is None else contact.height_field
    quality = add_scan_quality(contact.quality, scanned, shapes, mesh, zone)
    warnings = list(contact.notes.get("warnings", ()))
    if primitives is not None and scanned.colored is not None:
        warnings.append(_NO_COLORS)
    for warning in warnings:
        logger.warning("%s", warning)
    about = {
        "source": scanned.source,
        "num_faces": len(scanned.mesh.faces),
        "options": asdict(options),
        "versions": find_versions(),
        **contact.notes,
        "warnings": warnings,
        **({"cut": scanned.cut} if scanned.cut else {}),
        "viewpoints": _choose_positions(scanned.viewpoints),
        "up": scanned.up,
    }
    made_kind = "convex" if contact.height_field is None else "hfield"
    arena = Arena(
        name or "arena",
        contact.pieces,
        mesh,
        quality,
        ground.friction,
        course,
        made_kind if kind == "auto" else kind,
        contact.height_field,
        about,
        scanned.offset,
        ground.source,
        friction_map=ground.friction_map,
        primitives=primitives,
        unseen=find_unseen(mesh, scanned.points),
    )
    if scanned.colored is not None:
        arena = color_arena(arena, scanned.colored)
    progress("done", 1.0)
    return arena


def _choose_positions(viewpoints: Float[np.ndarray, "K 3"] | None) -> list[list[float]] | None:
    """Return the positions of a scanner that are kept with an arena, to 1 mm; None where they are unknown."""
    if viewpoints is None or not len(viewpoints):
        return None
    count = min(len(viewpoints), _MOST_VIEWPOINTS)
    kept = np.unique(np.linspace(0, len(viewpoints) - 1, count).astype(int))
    return np.round(viewpoints[kept], 3).tolist()


def load_arena(
    name: str | Path, course: Course | StairsCourse | None = None, pit: float | None = None, **options: Any
) -> Arena:
    """Return a named arena, or one from a folder or a mesh file.

    Args:
        name: "truth", "simple" and "stairs" are made in code; "gsrm" and "gg" come with the package. Anything
            else is a path: a folder that `Arena.save` wrote, a mesh file for `make_arena`, or a folder of tiles for
            `load_tiles`. A folder of yours with one of these names is `./gsrm`.
        course: other sizes, for the arenas made in code; for a mesh file see `make_arena`.
        pit: width of the pit of "truth" or "simple" [m], in place of a course with nothing else changed.
        options: options of `make_arena` or `load_tiles`, for a mesh file or tiles.

    Raises:
        ArenaError: there is no such arena, or none with such a pit.
    """
    if pit is not None and (course is not None or name not in ("truth", "simple")):
        raise ArenaError(f"a pit of {pit} is an option of truth and simple, without a course")
    if name in ("truth", "simple", "stairs"):
        default = StairsCourse() if name == "stairs" else Course() if pit is None else Course(pit=pit)
        exact = Arena.from_course(course or default, str(name))
        return replace(exact, surface=make_simple_surface(course or default)) if name == "simple" else exact
    path = find_assets() / "arenas" / name if name in SCANNED else Path(name)
    try:
        if (path / INDEX).is_file():
            return load_tiles(path, **options)
        if path.is_dir():
            return Arena.load(path)
        if path.is_file() and path.name == "arena.json":
            return Arena.load(path.parent)
        if path.is_file():
            return make_arena(path, course=course, **options)
    except OSError as error:
        raise ArenaError(f"{make_printable(path, 200)}: cannot be read ({error.strerror})") from error
    raise ArenaError(
        f"no arena {make_printable(name, 200)!r}: neither a folder nor a mesh file, "
        f"nor one of {', '.join(NAMED_ARENAS)}"
    )


def load_tiles(
    folder: str | Path, center: ArrayLike | None = None, radius: float = 25.0, **options: Any
) -> Arena:
    """Return an arena of the tiles around a place; the others are not read.

    Args:
        folder: a folder by `rc.reconstruct_tiles` or `symbrion reconstruct --tile`.
        center: (x, y) of the place, in the frame of the tiles: coordinates of the scan minus the offset [m]; None: the
            middle of all tiles.
        radius: tiles that a circle of this radius touches are part of the arena, whole [m].
        options: options of `make_arena`.

    Raises:
        ArenaError: no tiles, or none near; or the arena cannot be built.
    """
    try:
        tiles = TiledSurface.load(folder)
        mesh = tiles.mesh(center, radius)
    except ReconstructionError as error:
        raise ArenaError(str(error)) from error
    arena = make_arena(mesh, **{"name": Path(folder).resolve().name, **options})
    provenance = arena.provenance | {"offset": list(tiles.offset)}
    return replace(arena, provenance=provenance, offset=tiles.offset)
