"""A warning before a search on a way that is not drivable ground."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, cast

import evolution as ev
from reconstruction.quantities import format_count
from symbrion_gym.assets import NAMED_ARENAS

if TYPE_CHECKING:
    from symbrion_gym.robot.organism import Organism
    from symbrion_gym.tasks.route import StartName

logger = logging.getLogger(__name__)
TASK = "traverse"
"""The task whose way is to be drivable: of others, such as climb and cross_gap, crossing is the point."""


def warn_of_way(
    config: ev.EvolutionConfig | ev.BodyEvolutionConfig, smallest: Organism, largest: Organism
) -> None:
    """Log one line if the way of a search over a scan leaves drivable ground; a task that fails says so itself.

    Args:
        config: the search.
        smallest: its shortest body.
        largest: its longest one.
    """
    episode = config.episode
    if episode.task != TASK or not isinstance(config.arena, str) or config.arena in NAMED_ARENAS:
        return
    import symbrion_gym as sg
    from evolution.backends.prepared_arenas import prepare_arena
    from symbrion_gym.tasks.drivable_way import find_broken_traverse

    arena, goal = prepare_arena(config.arena), episode.goal
    assert isinstance(arena, sg.Arena)
    if isinstance(goal, str):  # a known object
        return
    try:
        way = find_broken_traverse(
            arena, smallest, largest, cast("StartName", episode.start or "floor"), goal
        )
    except sg.ArenaError:
        return
    if way is None:
        return
    bodies = format_count(largest.num_modules, "module")
    if smallest.num_modules < largest.num_modules:
        bodies = f"bodies of {smallest.num_modules} to {bodies}"
    remedy = f"`symbrion view {config.arena}` shows where to drive"
    if way.other is not None:
        start, goal = (" ".join(f"{value:g}" for value in place) for place in way.other)
        remedy = f"a straight way on such ground, in place of --task {TASK}: --start {start} --goal {goal}"
    logger.warning(
        "the way of --task traverse, from %s to %s, leaves the ground on which %s are known to drive (steps, slopes, "
        "gaps): many fail there, perhaps all; %s",
        *(way.start, way.finish, bodies, remedy),
    )
