"""The arena and the organism that the options of an environment name."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course
from symbrion_gym.arenas.loading import load_arena
from symbrion_gym.assets import SCANNED_PITS
from symbrion_gym.environment.config import EnvironmentConfig
from symbrion_gym.errors import ArenaError, OrganismError
from symbrion_gym.robot.organism import Organism, snake
from symbrion_gym.robot.scout_constants import ScoutConfig

_RESIZABLE = ("truth", "simple", *SCANNED_PITS)
"""Named arenas whose pit has a width of choice."""


def find_arena(config: EnvironmentConfig) -> Arena:
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


def find_organism(config: EnvironmentConfig, friction: float) -> Organism:
    """Return the organism of the options.

    Raises:
        OrganismError: neither a number of modules nor an Organism, or one that cannot be.
    """
    if isinstance(config.modules, Organism):
        return config.modules
    if not isinstance(config.modules, int | np.integer):
        raise OrganismError(f"modules must be a number or an Organism, got {config.modules!r}")
    scout = ScoutConfig(
        friction=friction,
        hinge_torque=config.hinge_torque,
        track_speed=config.track_speed,
        tracks=config.tracks,
    )
    return snake(int(config.modules), scout)
