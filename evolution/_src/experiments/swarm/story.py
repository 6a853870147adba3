"""The story of a swarm: scattered robots gather into an organism, cross the pit, part and go on."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evolution._src.champions.docked import DockedChampion
from evolution._src.errors import RunError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_counts, check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.swarm.behavior.machine import BehavingSwarm, Machine, Recorder, Track
from symbrion_gym._src.swarm.behavior.memory import PART, Memory, Mode, make_plan
from symbrion_gym._src.swarm.behavior.sensing import make_scout
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.placing import UPRIGHT, Field, find_across, find_field, scatter
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands

if TYPE_CHECKING:
    from evolution._src.search.validation import Champion

LEAST_ROBOTS = 2
BASELINE_TIME = 300.0  # A swarm that may not dock explores for so long [s]


@dataclass(frozen=True)
class StoryConfig:
    """Configuration of `tell_story`.

    Raises:
        RunError: a value is out of range.
    """

    arena: str = "gsrm"  # a name, folder or file of an arena with a pit
    seed: int = 0  # decides everything: equal seeds give equal results
    num_robots: int = 8  # Scouts; all of them form one snake
    docks: bool = True  # whether they may dock; without, they only explore, as a baseline
    gather_time: float = 2400.0  # longest time until the organism is whole [s]
    cross_time: float = 120.0  # longest crossing [s]
    part_time: float = 120.0  # longest time until all have gone on [s]
    weights: BehaviorWeights = field(default_factory=BehaviorWeights)  # of the behaviors

    def __post_init__(self) -> None:
        check_counts(self, ("num_robots",), RunError)
        if self.num_robots < LEAST_ROBOTS:
            raise RunError(f"num_robots is {self.num_robots}; an organism needs at least {LEAST_ROBOTS}")
        if self.seed < 0:
            raise RunError(f"seed is {self.seed}; give 0 or more")
        check_positive(self, ("gather_time", "cross_time", "part_time"), RunError)

    def describe(self) -> dict[str, Any]:
        """Return what decides the results, for JSON."""
        return json.loads(json.dumps(dataclasses.asdict(self)))


@dataclass(frozen=True)
class SwarmRunConfig:
    """Configuration of `run_swarm`."""

    folder: Path  # output folder
    story: StoryConfig = field(default_factory=StoryConfig)  # the story of the first seed
    trials: int = 0  # stories with other seeds, `story.seed + 1` on, without film
    # file or folder of the champion that crosses; None to evolve one in the arena
    champion: Path | None = None
    generations: int = 30  # limit of its evolution
    workers: int = 1  # threads of its evolution; the results do not depend on their number
    film: bool = True  # whether to film the first story
    allow: tuple[str, ...] = ()  # modules of yours that the champion names and that may be imported


HOLD_TIME = 0.3
"""All modules are beyond the pit for so long before the organism parts [s], as the task of the snake has it."""
FALLEN = -0.3  # A module whose up axis has less height has rolled over, likewise


@dataclass(frozen=True)
class Story:
    """What became of a swarm."""

    config: StoryConfig  # of the story
    success: bool  # every robot beyond the pit, undocked and upright
    reason: str  # what it failed at; "" for a success
    gathered: float  # when the organism was whole [s]; nan if never
    crossed: float  # when it was beyond the pit [s]; likewise
    ended: float  # [s]
    recoveries: int  # failed attempts to dock, of all robots
    across: int  # how many robots are beyond the pit at the end, undocked and upright
    track: Track  # where all were, with what they did

    def as_dict(self) -> dict[str, Any]:
        """Return the figures, for JSON; nan as None."""
        times = {name: getattr(self, name) for name in ("gathered", "crossed", "ended")}
        return {
            "seed": self.config.seed,
            "arena": self.config.arena,
            "robots": self.config.num_robots,
            "docks": self.config.docks,
            "success": self.success,
            "reason": self.reason,
            **{name: round(value, 3) if np.isfinite(value) else None for name, value in times.items()},
            "recoveries": self.recoveries,
            "across": self.across,
        }


def tell_story(
    config: StoryConfig, arena: Arena, champion: Champion | None, progress: Progress = silent
) -> Story:
    """Run a story from the scattered start to the end."""
    field = find_field(arena, config.num_robots)
    swarm = _begin(config, arena, field)
    gathered = _gather(swarm, config, progress)
    tracks, crossed = [swarm.recorder.read()], float("nan")
    reason = "" if np.isfinite(gathered) else f"no whole organism within {config.gather_time:g} s"
    world: KinematicWorld = swarm.world  # pyright: ignore[reportAssignmentType]
    if not reason and champion is not None:
        progress("crossing", 0.8)
        reason, crossed, track = _cross(world, swarm.memory, field, champion, config)
        tracks.append(track)
        if not reason:
            progress("parting", 0.95)
            tracks.append(_part(world, swarm.machine, swarm.memory, config))
    track = Track.join(*tracks)
    across = find_across(world.state, field, world.scout)
    stands = bool(np.isfinite(crossed) and across.all())
    if not reason and not stands:
        reason = f"{int((~across).sum())} robots are not beyond the pit, undocked and upright"
    recoveries = int(swarm.memory.recoveries.sum())
    ended = float(track.time[-1])
    return Story(config, stands, reason, gathered, crossed, ended, recoveries, int(across.sum()), track)


def _begin(config: StoryConfig, arena: Arena, field: Field) -> BehavingSwarm:
    count = config.num_robots
    world = KinematicWorld(arena, count, make_scout())
    world.reset(scatter(field, count, arena, np.random.default_rng((config.seed, 3))), config.seed)
    machine = Machine(make_plan(snake(count)), count, config.weights, config.docks)
    return BehavingSwarm(world, machine, seed=config.seed)


def _gather(swarm: BehavingSwarm, config: StoryConfig, progress: Progress) -> float:
    """Return when the organism was whole [s]; nan if it never was."""
    steps = round(config.gather_time / DECISION)
    for step in range(steps):
        swarm.step()
        if step % 100 == 0:
            progress("gathering", 0.8 * step / steps)
        if swarm.machine.is_complete(swarm.memory):
            return float(swarm.world.time)
    return float("nan")


def _cross(
    kinematic: KinematicWorld, memory: Memory, field: Field, champion: Champion, config: StoryConfig
) -> tuple[str, float, Track]:
    """Let the organism cross in full contact; return why not, when it was across [s], and its track."""
    from symbrion_gym._src.swarm.dynamic.motion import Motion
    from symbrion_gym._src.swarm.dynamic.world import DynamicWorld

    state = kinematic.state
    zero = np.zeros((kinematic.num_robots, 3))
    world = DynamicWorld(kinematic.arena, kinematic.num_robots)
    world.begin(Motion(state.position, state.rotation, zero, zero, state.hinge, zero[:, 0]), state.links)
    world.time = kinematic.time
    modules = np.argsort(memory.role).tolist()
    start = float(field.find_way(state.position)[modules[0]])
    driver = DockedChampion(champion, world, modules, start)
    idle, recorder, held = SwarmCommands.make_idle(kinematic.num_robots), Recorder(), 0.0
    reason = f"not across within {config.cross_time:g} s"
    for tick in range(round(config.cross_time / driver.dt)):
        driver.step(idle)
        if tick % round(DECISION / driver.dt) == 0:
            recorder.add(world, memory.mode)
        up, way = world.state.rotation[:, 2, 2], field.find_way(world.state.position)
        held = held + driver.dt if (way > field.route.finish).all() and (up > UPRIGHT).all() else 0.0
        if held >= HOLD_TIME:
            reason = ""
            break
        if (up < FALLEN).any() or not np.isfinite(way).all():
            reason = "the organism rolled over"
            break
        if (world.state.position[:, 2] < field.route.lowest).any():
            reason = "the organism fell off the side"
            break
    recorder.add(world, memory.mode)
    kinematic.set_state(world.state, world.time)
    return reason, float("nan") if reason else float(world.time), recorder.read()


def _part(kinematic: KinematicWorld, machine: Machine, memory: Memory, config: StoryConfig) -> Track:
    """Undock all robots and let them go on."""
    told = memory._replace(goes=np.full(kinematic.num_robots, PART))
    swarm = BehavingSwarm(kinematic, machine, seed=config.seed + 1, memory=told)
    for _ in range(round(config.part_time / DECISION)):
        swarm.step()
        if (swarm.memory.mode == Mode.REST).all():
            break
    return swarm.recorder.read()
