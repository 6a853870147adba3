"""What a search over a scan warns of: a way that leaves drivable ground."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, cast

import evolution as ev
import symbrion_gym as sg
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.errors import ArenaError

if TYPE_CHECKING:
    import evolution as ev
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.tasks.paths import Pair
    from symbrion_gym._src.tasks.route import StartName

logger = logging.getLogger(__name__)


TASK = "traverse"
"""The task whose way is to be drivable: of others, such as climb and cross_gap, crossing is the point."""


def warn_of_way(
    config: ev.EvolutionConfig | ev.BodyEvolutionConfig, smallest: Organism, largest: Organism
) -> None:
    """Log one line if the way of a search over a scan leaves drivable ground; a task that fails says so itself."""
    if config.task != TASK or not isinstance(config.arena, str) or config.arena in NAMED_ARENAS:
        return
    from evolution._src.backends.trials import prepare_arena
    from symbrion_gym._src.tasks.paths import find_broken_traverse

    arena, goal = prepare_arena(config.arena), config.goal
    assert isinstance(arena, sg.Arena)
    if isinstance(goal, str):  # a known object
        return
    start = cast("StartName", config.start or "floor")
    bodies = format_count(largest.num_modules, "module")
    try:
        way = find_broken_traverse(arena, smallest, largest, start, goal)
    except ArenaError:
        return
    if way is None:
        return
    if smallest.num_modules < largest.num_modules:
        bodies = f"bodies of {smallest.num_modules} to {bodies}"
    remedy = (
        f"`symbrion view {config.arena}` shows where to drive" if way.other is None else _name_way(way.other)
    )
    logger.warning(
        "the way of --task %s, from %s to %s, leaves the ground on which %s are known to drive (steps, slopes, gaps): "
        "many fail there, perhaps all; %s",
        *(TASK, way.start, way.finish, bodies, remedy),
    )


def _name_way(way: Pair) -> str:
    """Return the options of a way."""
    start, goal = (" ".join(f"{value:g}" for value in place) for place in way)
    return f"a straight way that can be driven, in place of --task {TASK}: --start {start} --goal {goal}"
