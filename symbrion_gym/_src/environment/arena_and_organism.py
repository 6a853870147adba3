"""The arena and the organism that the options of an environment name."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import COURSES, make_course
from symbrion_gym._src.arenas.loading import load_arena
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.environment.config import MAX_MODULES, EnvironmentConfig
from symbrion_gym._src.environment.organism_options import SCOUT_OPTIONS, apply_options
from symbrion_gym._src.errors import ArenaError, OrganismError
from symbrion_gym._src.robot.body_plans import load_organism
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig

logger = logging.getLogger(__name__)
_MADE_IN_CODE = ("truth", "simple", "stairs")
_RESIZABLE = ("truth", "simple")
"""Named arenas whose pit has a width of choice."""


def find_arena(config: EnvironmentConfig) -> Arena:
    """Return the arena of the options; `pit` resizes the arenas made in code."""
    arena = config.arena
    if isinstance(arena, Arena):
        if config.pit is not None and getattr(arena.course, "pit", None) != config.pit:
            raise ArenaError(f"the pit of a ready arena cannot be set to {config.pit}; build another arena")
        return arena
    if not isinstance(arena, str | Path):
        raise ArenaError(f"arena must be a name, a path or an Arena, got {arena!r}")
    if arena in _MADE_IN_CODE and (config.course or arena in config.default_course):
        return _make_course_arena(str(arena), config)
    if config.course:
        raise ArenaError(
            f"sizes of a course go with an arena made in code, {', '.join(_MADE_IN_CODE)}, not with {str(arena)!r}"
        )
    is_named = arena in _RESIZABLE
    pit = config.default_pit if is_named and config.pit is None else config.pit
    if pit is None:
        return _load(arena, config)
    if is_named:
        return load_arena(arena, pit=pit)
    loaded = _load(arena, config)
    if getattr(loaded.course, "pit", None) != config.pit:
        raise ArenaError(
            f"arena {str(arena)!r} has its own pit; pit={config.pit} works with named courses only"
        )
    return loaded


def _make_course_arena(name: str, config: EnvironmentConfig) -> Arena:
    """Return an arena made in code in other sizes."""
    sizes = {**config.default_course.get(name, {}), **config.course}
    kind = "stairs"
    if name != "stairs":
        kind = "pit"
        pit = config.default_pit if config.pit is None else config.pit
        sizes |= {} if pit is None else {"pit": pit}
    elif config.pit is not None:
        raise ArenaError(f"arena 'stairs' has no pit; leave out pit={config.pit}")
    return load_arena(name, course=make_course({"kind": kind, **_complete(kind, sizes)}))


def _complete(kind: str, sizes: Mapping[str, Any]) -> dict[str, Any]:
    """Return all sizes of a course; those that are not given are its defaults."""
    return {**asdict(COURSES[kind]()), **sizes}


def _load(arena: str | Path, config: EnvironmentConfig) -> Arena:
    """Return a named arena, or one from a folder or a file; a surface in a file is made an arena, with progress."""
    if arena in NAMED_ARENAS or not Path(arena).is_file() or Path(arena).name == "arena.json":
        return load_arena(arena)
    logger.info("arena of %s: made once, then kept in the cache", arena)
    return load_arena(arena, progress=config.progress or _log_progress)


def _log_progress(message: str, fraction: float) -> None:
    logger.info("%3.0f %% %s", 100 * fraction, message)


def find_organism(config: EnvironmentConfig, friction: float) -> Organism:
    """Return the organism of the options, with the constants of its modules that they name."""
    if isinstance(config.modules, str | Path):
        raise OrganismError(
            f"modules must be a number or an Organism, got {config.modules!r}; names go to organism"
        )
    organism = load_organism(config.modules if config.organism is None else config.organism)
    if organism.num_modules > MAX_MODULES:
        raise OrganismError(
            f"{organism.num_modules} modules are too many; at most {MAX_MODULES} are possible"
        )
    usual = {entry.name: entry.default for entry in fields(EnvironmentConfig)}
    wanted = {name: value for name in SCOUT_OPTIONS if (value := getattr(config, name)) != usual[name]}
    if organism.scout.friction == ScoutConfig.friction:
        wanted = {"friction": friction} | wanted
    return apply_options(organism, wanted)
