"""The arena and the organism that the options of an environment name."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course
from symbrion_gym.arenas.loading import load_arena
from symbrion_gym.assets import SCANNED_PITS
from symbrion_gym.environment.config import MAX_MODULES, SnakePitConfig
from symbrion_gym.environment.organism_options import SCOUT_OPTIONS, apply_options
from symbrion_gym.errors import ArenaError, OrganismError
from symbrion_gym.robot.body_plans import load_organism
from symbrion_gym.robot.organism import Organism
from symbrion_gym.robot.scout_constants import ScoutConfig

_RESIZABLE = ("truth", "simple", *SCANNED_PITS)
"""Named arenas whose pit has a width of choice."""


def find_arena(config: SnakePitConfig) -> Arena:
    """Return the arena of the options; `pit` resizes the arenas made in code.

    Raises:
        ArenaError: there is no such arena, or its pit cannot be resized.
    """
    arena = config.arena
    if isinstance(arena, Arena):
        if config.pit is not None and getattr(arena.course, "pit", None) != config.pit:
            raise ArenaError(f"the pit of a ready arena cannot be set to {config.pit}; build another arena")
        return arena
    if not isinstance(arena, str | Path):
        raise ArenaError(f"arena must be a name, a path or an Arena, got {arena!r}")
    is_named = arena in _RESIZABLE
    pit = config.default_pit if is_named and config.pit is None else config.pit
    if pit is None:
        return load_arena(arena)
    if is_named:
        return load_arena(arena, course=Course(pit=pit))
    loaded = load_arena(arena)
    if getattr(loaded.course, "pit", None) != config.pit:
        raise ArenaError(
            f"arena {str(arena)!r} has its own pit; pit={config.pit} works with named courses only"
        )
    return loaded


def find_organism(config: SnakePitConfig, friction: float) -> Organism:
    """Return the organism of the options, with the constants of its modules that they name.

    Args:
        config: the options.
        friction: sliding friction of the arena, which holds unless options or organism say otherwise.

    Raises:
        OrganismError: there is no such organism, or it cannot be.
        OptionError: an option contradicts the organism.
    """
    if isinstance(config.modules, str | Path):
        raise OrganismError(
            f"modules must be a number or an Organism, got {config.modules!r}; names go to organism"
        )
    organism = load_organism(config.modules if config.organism is None else config.organism)
    if organism.num_modules > MAX_MODULES:
        raise OrganismError(
            f"{organism.num_modules} modules are too many; at most {MAX_MODULES} are possible"
        )
    usual = {entry.name: entry.default for entry in fields(SnakePitConfig)}
    wanted = {name: value for name in SCOUT_OPTIONS if (value := getattr(config, name)) != usual[name]}
    if organism.scout.friction == ScoutConfig.friction:
        wanted = {"friction": friction} | wanted
    return apply_options(organism, wanted)
