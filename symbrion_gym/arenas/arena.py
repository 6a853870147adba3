"""Arenas: convex pieces to touch, an exact surface to see, and what is known about both."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import trimesh

from reconstruction.files.printable import make_printable
from reconstruction.geometry.elevation import Elevation
from reconstruction.progress import Progress, silent
from symbrion_gym.arenas.cache import find_versions, get_or_make
from symbrion_gym.arenas.checks import check_friction, check_name
from symbrion_gym.arenas.course import Course, StairsCourse, make_simple_surface
from symbrion_gym.arenas.folder import load_arena_folder
from symbrion_gym.arenas.saving import save_arena
from symbrion_gym.arenas.spec import make_arena_spec
from symbrion_gym.assets import NAMED_ARENAS, SCANNED_PITS, find_assets
from symbrion_gym.contact.builder import Contact, ContactOptions, make_contact
from symbrion_gym.contact.kinds import CONTACT_KINDS, HeightField
from symbrion_gym.contact.mesh_repair import load_surface, repair_mesh
from symbrion_gym.contact.quality import ArenaQuality
from symbrion_gym.errors import ArenaError


@dataclass(frozen=True)
class Arena:
    """A world without a robot.

    Attributes:
        name: what it is called in files and messages.
        pieces: convex solids, for contact.
        surface: the exact surface, for rays and pictures.
        quality: distances of the pieces from the surface.
        friction: sliding friction of the ground.
        course: the exact course behind it, where there is one: pit edges, start and goal.
        kind: the kind of contact geometry.
        height_field: in place of pieces, for the kind "hfield".
        provenance: what it was made of, with which options and versions.

    Raises:
        ArenaError: name, friction or kind cannot be, or the kind does not go with the height field.
    """

    name: str
    pieces: list[trimesh.Trimesh]
    surface: trimesh.Trimesh
    quality: ArenaQuality
    friction: float = 0.7
    course: Course | StairsCourse | None = None
    kind: str = "convex"
    height_field: HeightField | None = None
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_name(self.name)
        check_friction(self.friction)
        if self.kind not in CONTACT_KINDS:
            raise ArenaError(f"kind is {self.kind!r}; there are: {', '.join(CONTACT_KINDS)}")
        if (self.kind == "hfield") != (self.height_field is not None):
            raise ArenaError(f"kind is {self.kind!r}; 'hfield' has a height field, and no other kind has one")

    @classmethod
    def from_course(cls, course: Course | StairsCourse, name: str = "truth") -> Arena:
        """Make the exact arena of a course: its pieces are contact and surface to the last digit."""
        pieces = course.pieces()
        return cls(
            name=name,
            pieces=pieces,
            surface=course.surface(),
            quality=ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(pieces)),
            friction=course.friction,
            course=course,
            provenance={"course": course.as_dict()},
        )

    @cached_property
    def elevation(self) -> Elevation:
        """Heights of the exact surface."""
        return Elevation(self.surface)

    def height(self, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
        """Return the height of the exact surface at each (x, y) [m]; NaN outside of it."""
        return self.elevation.height(x, y)

    def spec(self) -> mujoco.MjSpec:
        """Return a new spec: contact pieces in group 3, the surface in group 2, lights; angles in radians."""
        return make_arena_spec(self)

    def save(self, folder: str | Path) -> None:
        """Write the arena as a folder that MuJoCo's viewer opens (`arena.xml`).

        Raises:
            ArenaError: the folder holds something else.
        """
        save_arena(self, folder)

    @classmethod
    def load(cls, folder: str | Path) -> Arena:
        """Read what `save` wrote.

        Raises:
            ArenaError: the folder holds no arena, or a damaged one.
        """
        return cls(**load_arena_folder(folder))


def make_arena(
    mesh: trimesh.Trimesh | str | Path,
    *,
    accuracy: float = 0.003,
    max_pieces: int = 64,
    kind: str = "convex",
    course: Course | StairsCourse | None = None,
    name: str | None = None,
    friction: float | None = None,
    thickness: float = 0.2,
    seed: int = 0,
    time_limit: float = 120.0,
    cache: bool | str | Path = True,
    progress: Progress = silent,
) -> Arena:
    """Make an arena of a surface: convex pieces to touch that follow it, and the surface itself to see.

    Planes found in a terrain make convex slabs, their union a closed solid, coacd of that the pieces; where these
    are worse than the slabs, the slabs are kept. Any other shape goes to coacd as it is. What was reached stands
    in `Arena.quality`; how, and why so, in `Arena.provenance`.

    Args:
        mesh: a terrain open at its rim, or any other surface or body, or a file of it; metres, z up.
        accuracy: distance between pieces and surface that is good enough [m].
        max_pieces: no more convex pieces than these, where that can be had.
        kind: contact geometry, one of "convex", "primitives", "hfield", "prisms".
        course: the course that was scanned, where it is known: its pit edges, start and goal are kept.
        name: what to call it; the file's name unless given.
        friction: sliding friction; the course's, or 0.7, unless given.
        thickness: how far pieces reach below the lowest ground [m].
        seed: of coacd's search.
        time_limit: building ends by then, with what there is or an error [s].
        cache: whether to keep pieces in the user's cache, or the folder to keep them in.
        progress: called with what is being done and the share done.

    Raises:
        ArenaError: the mesh cannot be used, or an option is out of range.
    """
    options = ContactOptions(accuracy, max_pieces, kind, thickness, seed, time_limit)
    source = "mesh"
    if not isinstance(mesh, trimesh.Trimesh):
        source = make_printable(Path(mesh).name)
        name = name or make_printable(Path(mesh).stem)
        mesh = load_surface(mesh)
    progress("repairing the mesh", 0.0)
    num_faces = len(mesh.faces)
    try:
        mesh = repair_mesh(mesh)
    except ArenaError as error:
        raise ArenaError(f"{source}: {error}") from error

    def make() -> Contact:
        return make_contact(mesh, options, progress)

    folder = Path(cache) if isinstance(cache, str | Path) else None
    contact = make() if cache is False else get_or_make(mesh, options, make, folder)
    progress("done", 1.0)
    if friction is None:
        friction = course.friction if course is not None else 0.7
    about = {
        "source": source,
        "num_faces": num_faces,
        "options": options.as_dict(),
        "versions": find_versions(),
        **contact.notes,
    }
    return Arena(
        name or "arena",
        contact.pieces,
        mesh,
        contact.quality,
        friction,
        course,
        kind,
        contact.height_field,
        about,
    )


def load_arena(name: str | Path, course: Course | StairsCourse | None = None, **options: Any) -> Arena:
    """Return a named arena, or one from a folder or a mesh file.

    Args:
        name: "truth", "simple" and "stairs" are made in code; "gsrm" and "gg" come with the package. Anything
            else is a path: a folder that `Arena.save` wrote, or a mesh file for `make_arena`. A folder of yours
            with one of these names is `./gsrm`.
        course: other sizes, for the arenas made in code; which of the scans, by its pit, for those that come with
            the package; what was scanned, for a mesh file.
        options: of `make_arena`, for a mesh file.

    Raises:
        ArenaError: there is no such arena.
    """
    if name in ("truth", "simple", "stairs"):
        return _make_exact(str(name), course)
    path = _find_scanned(str(name), course) if name in NAMED_ARENAS else Path(name)
    try:
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


def name_scanned(name: str, pit: float) -> str:
    """Return the folder of a scanned arena that comes with the package: "gsrm", or "gsrm-0.40" for a pit of 0.40 m."""
    return name if pit == SCANNED_PITS[name][0] else f"{name}-{pit:.2f}"


def _find_scanned(name: str, course: Course | StairsCourse | None) -> Path:
    pits = SCANNED_PITS[name]
    pit = pits[0] if course is None else getattr(course, "pit", None)
    if pit not in pits:
        widths = " and ".join(f"{width:.2f}" for width in pits)
        raise ArenaError(
            f"arena {name!r} comes with pits of {widths} m, got {pit}; scan a course of your own"
        )
    return find_assets() / "arenas" / name_scanned(name, pit)


def _make_exact(name: str, course: Course | StairsCourse | None) -> Arena:
    course = course or (StairsCourse() if name == "stairs" else Course())
    exact = Arena.from_course(course, name)
    return replace(exact, surface=make_simple_surface(course)) if name == "simple" else exact
