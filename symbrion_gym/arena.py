"""Arenas: convex pieces to touch, an exact surface to see, and what is known about both."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import trimesh

from reconstruction.progress import Progress, silent
from symbrion_gym.arena_quality import ArenaQuality, measure_arena
from symbrion_gym.arena_spec import make_arena_spec
from symbrion_gym.course import Course, StairsCourse, make_simple_surface
from symbrion_gym.elevation import Elevation
from symbrion_gym.errors import ArenaError
from symbrion_gym.planes import find_planes
from symbrion_gym.slabs import make_slabs

NAMED_ARENAS = ("truth", "simple", "stairs", "gsrm", "gg")


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
        provenance: what it was made of, with which options and versions.
    """

    name: str
    pieces: list[trimesh.Trimesh]
    surface: trimesh.Trimesh
    quality: ArenaQuality
    friction: float = 0.7
    course: Course | StairsCourse | None = None
    kind: str = "convex"
    provenance: dict[str, Any] = field(default_factory=dict)

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
    progress: Progress = silent,
) -> Arena:
    """Make an arena of a surface: convex pieces to touch that follow it, and the surface itself to see.

    Args:
        mesh: a terrain open at its rim or a closed body, or a file of it; metres, z up.
        accuracy: distance between pieces and surface that is good enough [m].
        max_pieces: no more contact pieces than these.
        kind: contact geometry.
        course: the course that was scanned, where it is known: its pit edges, start and goal are kept.
        name: what to call it; the file's name unless given.
        friction: sliding friction; the course's, or 0.7, unless given.
        thickness: how far pieces reach below the lowest ground [m].
        progress: called with what is being done and the share done.

    Raises:
        ArenaError: the mesh cannot be used.
    """
    if not isinstance(mesh, trimesh.Trimesh):
        path = Path(mesh)
        name = name or path.stem
        mesh = trimesh.load_mesh(path)
    start = time.perf_counter()
    progress("planes", 0.1)
    pieces = make_slabs(mesh, find_planes(mesh, accuracy), accuracy, max_pieces, thickness)
    progress("quality", 0.9)
    quality = measure_arena(pieces, mesh, seconds=time.perf_counter() - start)
    if friction is None:
        friction = course.friction if course is not None else 0.7
    return Arena(name or "arena", pieces, mesh, quality, friction, course, kind)


def load_arena(name: str | Path, course: Course | StairsCourse | None = None) -> Arena:
    """Return a named arena, or one from a folder.

    Args:
        name: "truth", "simple" and "stairs" are made in code; "gsrm" and "gg" come with the package.
        course: sizes other than the usual ones, for the arenas made in code.

    Raises:
        ArenaError: there is no such arena.
    """
    if name == "truth":
        return Arena.from_course(course or Course(), "truth")
    if name == "stairs":
        return Arena.from_course(course or StairsCourse(), "stairs")
    if name == "simple":
        course = course or Course()
        exact = Arena.from_course(course, "simple")
        return Arena(
            name="simple",
            pieces=exact.pieces,
            surface=make_simple_surface(course),
            quality=exact.quality,
            friction=course.friction,
            course=course,
            provenance=exact.provenance,
        )
    raise ArenaError(f"no arena {str(name)!r}; there are: {', '.join(NAMED_ARENAS)}")
