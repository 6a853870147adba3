"""Arenas by name, or from a folder or a mesh file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from reconstruction._src.base.printable import make_printable
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse, make_simple_surface
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.assets import NAMED_ARENAS, SCANNED, find_assets
from symbrion_gym._src.errors import ArenaError


def load_arena(
    name: str | Path, course: Course | StairsCourse | None = None, pit: float | None = None, **options: Any
) -> Arena:
    """Return a named arena, or one from a folder or a mesh file.

    Args:
        name: "truth", "simple" and "stairs" are made in code; "gsrm" and "gg" come with the package. Anything
            else is a path: a folder that `Arena.save` wrote, or a mesh file for `make_arena`. A folder of yours
            with one of these names is `./gsrm`.
        course: other sizes, for the arenas made in code; for a mesh file see `make_arena`.
        pit: width of the pit of "truth" or "simple" [m], in place of a course with nothing else changed.
        options: options of `make_arena`, for a mesh file.

    Raises:
        ArenaError: there is no such arena, or none with such a pit.
    """
    if pit is not None and (course is not None or name not in ("truth", "simple")):
        raise ArenaError(
            f"pit={pit} is an option of truth and simple, without a course; scan a course of your own"
        )
    if name in ("truth", "simple", "stairs"):
        return _make_exact(str(name), course if pit is None else Course(pit=pit))
    path = find_assets() / "arenas" / name if name in SCANNED else Path(name)
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


def _make_exact(name: str, course: Course | StairsCourse | None) -> Arena:
    course = course or (StairsCourse() if name == "stairs" else Course())
    exact = Arena.from_course(course, name)
    return replace(exact, surface=make_simple_surface(course)) if name == "simple" else exact
