"""The story of a swarm: scattered robots gather into an organism, cross the pit, part and go on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from evolution._src.champions.docked import DockedChampion
from evolution._src.errors import RunError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.swarm.behavior.machine import BehavingSwarm, Machine, Track
from symbrion_gym._src.swarm.behavior.memory import PART, Mode, make_plan
from symbrion_gym._src.swarm.behavior.sensing import make_scout
from symbrion_gym._src.swarm.dynamic.transfer import Motion
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.placing import UPRIGHT, Field, find_across, find_field, scatter
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands

if TYPE_CHECKING:
    from evolution._src.search.validation import Champion

LEAST_ROBOTS = 2
CROSS_TIME = 120.0  # Longest crossing [s]
PART_TIME = 120.0  # Longest time until all have gone on [s]
HOLD_TIME = 0.3
"""All modules are beyond the pit for so long before the organism parts [s], as the task of the snake has it."""
FALLEN = -0.3  # A module whose up axis has less height has rolled over, likewise


@dataclass(frozen=True)
class StoryConfig:
    """Configuration of `tell_story`; equal ones give equal results."""

    arena: str = "gsrm"  # a name, folder or file of an arena with a pit
    seed: int = 0  # of all random numbers
    num_robots: int = 8  # Scouts; all of them form one snake
    docks: bool = True  # whether they may dock; without, they only explore, as a baseline
    gather_time: float = 2400.0  # longest time until the organism is whole [s]

    def __post_init__(self) -> None:
        if self.num_robots < LEAST_ROBOTS:
            raise RunError(f"num_robots is {self.num_robots}; an organism needs at least {LEAST_ROBOTS}")
        if self.seed < 0:
            raise RunError(f"seed is {self.seed}; give 0 or more")
        check_positive(self, ("gather_time",), RunError)


class Figures(TypedDict):
    """What `tell_story` returns of a story, as read from a file."""

    seed: int
    docks: bool
    success: bool
    reason: str
    gathered: float | None  # [s]
    crossed: float | None  # [s]
    recoveries: int
    across: int


def tell_story(
    config: StoryConfig, arena: Arena, champion: Champion | None, progress: Progress = silent
) -> tuple[dict[str, Any], Track]:
    """Run a story from the scattered start to the end."""
    field, count = find_field(arena, config.num_robots), config.num_robots
    world = KinematicWorld(arena, count, make_scout())
    world.reset(scatter(field, count, world, np.random.default_rng((config.seed, 3))), config.seed)
    swarm = BehavingSwarm(world, Machine(make_plan(snake(count)), count, config.docks), seed=config.seed)
    gathered, crossed = _gather(swarm, config.gather_time, progress), None
    reason = f"no whole organism within {config.gather_time:g} s" if gathered is None else ""
    if gathered is not None and champion is not None:
        progress("crossing", 0.8)
        reason = _cross(swarm, world, field, champion)
        if not reason:
            crossed = world.time
            progress("parting", 0.95)
            _part(swarm, world, config.seed)
    across = find_across(world.state, field)
    success = crossed is not None and bool(across.all())
    if not reason and not success:
        reason = f"{int((~across).sum())} robots are not beyond the pit, undocked and upright"
    track = swarm.recorder.read()
    figures = {
        "seed": config.seed,
        "arena": config.arena,
        "robots": count,
        "docks": config.docks,
        "success": success,
        "reason": reason,
        "gathered": None if gathered is None else round(gathered, 3),
        "crossed": None if crossed is None else round(crossed, 3),
        "ended": round(float(track.time[-1]), 3),
        "recoveries": int(swarm.memory.recoveries.sum()),
        "across": int(across.sum()),
    }
    return figures, track


def _gather(swarm: BehavingSwarm, longest: float, progress: Progress) -> float | None:
    """Return when the organism was whole [s]; None if it never was."""
    steps = round(longest / DECISION)
    for step in range(steps):
        swarm.step()
        if step % 100 == 0:
            progress("gathering", 0.8 * step / steps)
        if swarm.machine.is_complete(swarm.memory):
            return swarm.world.time
    return None


def _cross(swarm: BehavingSwarm, kinematic: KinematicWorld, field: Field, champion: Champion) -> str:
    """Let the organism cross in full contact, and the kinematic world go on from there; return why not, or nothing."""
    state, mode = kinematic.state, swarm.memory.mode
    still = np.zeros((kinematic.num_robots, 3))
    world = DynamicWorld(kinematic.arena, kinematic.num_robots)
    motion = Motion(state.position, state.rotation, still, still, state.hinge, still[:, 0])
    world.begin(motion, state.links, kinematic.time)
    modules = np.argsort(swarm.memory.role).tolist()
    driver = DockedChampion(champion, world, modules, float(field.find_way(state.position)[modules[0]]))
    idle, held, reason = SwarmCommands.make_idle(kinematic.num_robots), 0.0, ""
    for tick in range(round(CROSS_TIME / driver.dt)):
        driver.step(idle)
        if tick % round(DECISION / driver.dt) == 0:
            swarm.recorder.add(world, mode)
        up, way = world.state.rotation[:, 2, 2], field.find_way(world.state.position)
        held = held + driver.dt if (way > field.route.finish).all() and (up > UPRIGHT).all() else 0.0
        if (up < FALLEN).any() or not np.isfinite(way).all():
            reason = "the organism rolled over"
        elif (world.state.position[:, 2] < field.route.lowest).any():
            reason = "the organism fell off the side"
        if held >= HOLD_TIME or reason:
            break
    else:
        reason = f"not across within {CROSS_TIME:g} s"
    swarm.recorder.add(world, mode)
    kinematic.set_state(world.state, world.time)
    return reason


def _part(swarm: BehavingSwarm, kinematic: KinematicWorld, seed: int) -> None:
    """Undock all robots and let them go on."""
    told = swarm.memory._replace(goes=np.full(kinematic.num_robots, PART))
    parting = BehavingSwarm(kinematic, swarm.machine, 1.0, seed + 1, told, swarm.recorder)
    for _ in range(round(PART_TIME / DECISION)):
        parting.step()
        if (parting.memory.mode == Mode.REST).all():
            break
