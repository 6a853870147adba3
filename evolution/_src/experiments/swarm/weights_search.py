"""CMA-ES over the weights of the behaviors: robots that dock sooner, so that a swarm assembles faster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import radians
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.errors import RunError
from evolution._src.search.cmaes import Space, Strategy
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_counts, check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.swarm.behavior.hearing import HearingConfig
from symbrion_gym._src.swarm.behavior.machine import BehavingSwarm, Machine
from symbrion_gym._src.swarm.behavior.memory import Memory, Mode, make_plan, make_ticket
from symbrion_gym._src.swarm.behavior.sensing import make_scout
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights, list_bounds
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.world import DECISION

APART = 5.0
"""Distance between pairs, which all run at once [m]: farther than a beacon is heard."""
CHECK_EVERY = 10
"""Decisions between two looks at who has locked."""


class DockingTimes(NamedTuple):
    """Results of docking trials, one row each.

    Attributes:
        position: start position, 1 to 5 as in the hardware's trials.
        locked: whether the front dock locked.
        seconds: from LocateBeacon to Locking [s]; nan where it did not lock.
        recoveries: failed attempts.
    """

    position: Int[np.ndarray, " T"]
    locked: Bool[np.ndarray, " T"]
    seconds: Float[np.ndarray, " T"]
    recoveries: Int[np.ndarray, " T"]


@dataclass(frozen=True)
class TrialSetup:
    """Start conditions and parameters of the trials.

    The coordinates of the hardware's start positions are not known: `distances` were fitted to the times of trials
    without recoveries. `sides` and the small errors of the start are estimates.

    Attributes:
        distances: from the recruiter's dock to the center of the other robot, positions 1 to 3 [m].
        sides: of positions 1 to 3, left, middle and right, from the axis of the dock [rad].
        headings: of positions 4 (as 2) and 5 (as 3), off the direction to the dock, in turn [rad].
        spread: standard deviations of start position [m] and heading [rad].
        duration: a trial that takes longer has failed [s]; the longest of the robots took 242 s in all.
        weights: of the behaviors.
        hearing: how well robots hear.
    """

    distances: tuple[float, float, float] = (1.15, 0.88, 0.62)
    sides: tuple[float, float, float] = (radians(10), 0.0, radians(-10))
    headings: tuple[float, ...] = (radians(45), radians(135), radians(-45), radians(-135))
    spread: tuple[float, float] = (0.01, 0.05)
    duration: float = 240.0
    weights: BehaviorWeights = field(default_factory=BehaviorWeights)
    hearing: HearingConfig = field(default_factory=HearingConfig)


def run_docking_trials(
    positions: Int[np.ndarray, " T"],
    setup: TrialSetup | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> DockingTimes:
    """Run trials from start positions, all at once and out of each other's hearing, on level ground."""
    setup, count = setup or TrialSetup(), len(positions)
    world = KinematicWorld(_make_floor(count), 2 * count, make_scout())
    world.reset(_place(positions, setup, np.random.default_rng((seed, 5))), seed)
    machine = Machine(make_plan(snake(2)), 2 * count, setup.weights)
    swarm = BehavingSwarm(world, machine, setup.hearing, seed, _begin(count))
    seconds = np.full(count, np.nan)
    recoveries = np.zeros(count, np.int64)
    steps = round(setup.duration / DECISION)
    for step in range(steps):
        swarm.step()
        mode = swarm.memory.mode[1::2]
        is_new = np.isnan(seconds) & (mode == Mode.LOCK)
        seconds = np.where(is_new, world.time, seconds)
        recoveries = np.where(np.isnan(seconds) | is_new, swarm.memory.recoveries[1::2], recoveries)
        if step % CHECK_EVERY == 0:
            progress("docking trials", step / steps)
            if not np.isnan(seconds).any():
                break
    return DockingTimes(np.asarray(positions), ~np.isnan(seconds), seconds, recoveries)


def _make_floor(count: int) -> Arena:
    """Return level ground for so many pairs."""
    rows = int(np.ceil(np.sqrt(count)))
    course = Course(pit=0.0, floor=APART * (rows + 1), width=APART * (rows + 1))
    return Arena.from_course(course, "floor")


def _place(
    positions: Int[np.ndarray, " T"], setup: TrialSetup, rng: np.random.Generator
) -> Float[np.ndarray, "M 3"]:
    """Return poses of recruiters (even rows) and of the robots that come (odd rows)."""
    count = len(positions)
    rows = int(np.ceil(np.sqrt(count)))
    foot = Course(pit=0.0).ramp_feet[0]
    grid = np.stack(np.divmod(np.arange(count), rows), axis=-1) * APART
    dock = np.stack([foot - APART - grid[:, 0], grid[:, 1] - APART * (rows - 1) / 2], axis=-1)
    like = np.where(positions > 3, positions - 2, positions) - 1
    distance, side = np.array(setup.distances)[like], np.array(setup.sides)[like]
    turn = np.where(positions > 3, np.resize(setup.headings, count), 0.0)
    poses = np.zeros((2 * count, 3))
    poses[::2, :2] = dock
    noise = rng.standard_normal((count, 3))
    way = np.stack([-np.cos(side), np.sin(side)], axis=-1)
    back = np.array([0.0525, 0.0])
    poses[1::2, :2] = dock - back + distance[:, None] * way + setup.spread[0] * noise[:, :2]
    poses[1::2, 2] = -side + turn + setup.spread[1] * noise[:, 2]
    return poses


def _begin(count: int) -> Memory:
    """Return the memory of pairs: one recruits and has accepted the other."""
    numbers = np.arange(2 * count)
    memory = Memory.begin(2 * count)
    even = numbers % 2 == 0
    memory = memory.start(even, Mode.RECRUIT, role=0, leader=numbers[even], roles=1)
    accepted = np.where(even, make_ticket(np.ones_like(numbers), numbers + 1), 0)
    memory = memory.start(~even, Mode.LOCATE_BEACON)
    return memory._replace(ticket=accepted, unseen=np.zeros(2 * count), silent=np.zeros(2 * count))


EVOLVED = (
    "locate_speed", "lookahead", "align_distance", "align_angle", "align_offset", "dock_speed", "dock_time",
    "recover_speed", "recover_time",
)  # fmt: skip
"""The weights of locating, aligning, docking and recovering, which take most of the time of an assembly."""
START_POSITIONS = 5
"""Start positions of the docking trials."""


@dataclass(frozen=True)
class WeightsConfig:
    """Configuration of `evolve_weights`.

    Attributes:
        seed: decides everything: equal seeds give equal results.
        names: the weights that evolve; the others keep their values.
        pairs: docking trials of a candidate, all at once; a generation meets the same ones, each generation others.
        duration: a trial that takes longer counts as this long [s].
        population_size: candidates of a generation.
        generations: how many.
        sigma: first step size, as a share of the range of each weight.
        base: where the search begins.

    Raises:
        RunError: a value is out of range, or there is no such weight.
    """

    seed: int = 0
    names: tuple[str, ...] = EVOLVED
    pairs: int = 15
    duration: float = 60.0
    population_size: int = 8
    generations: int = 6
    sigma: float = 0.15
    base: BehaviorWeights = field(default_factory=BehaviorWeights)

    def __post_init__(self) -> None:
        check_counts(self, ("pairs", "population_size", "generations"), RunError)
        check_positive(self, ("duration", "sigma"), RunError)
        if self.seed < 0:
            raise RunError(f"seed is {self.seed}; give 0 or more")
        unknown = sorted(set(self.names) - set(list_bounds()))
        if unknown or not self.names:
            raise RunError(f"names are {self.names}; give some of: {', '.join(list_bounds())}")


class WeightsResult(NamedTuple):
    """What evolved.

    Attributes:
        weights: at the mean of the last distribution.
        fitness: of all candidates in turn: the mean time to lock, negated [s].
    """

    weights: BehaviorWeights
    fitness: Float[np.ndarray, " C"]


def evolve_weights(config: WeightsConfig, progress: Progress = silent) -> WeightsResult:
    """Evolve weights with which two robots dock sooner, in docking trials as on the hardware, on level ground.

    Pairs stand for the assembly: many of them are simulated at once, and their times vary less from seed to seed than
    those of whole swarms. Whether a swarm of many robots gains as well is for `find_gathering_time` to judge.
    """
    names, count = config.names, len(config.names)
    start = tuple(config.base.to_genotype(names).tolist())
    space = Space(names, (0.0,) * count, (1.0,) * count, start, (1.0,) * count)
    strategy = Strategy(space, config.sigma, config.population_size, config.seed)
    rows = []
    for generation in range(config.generations):
        genotypes = strategy.ask()
        weights = [BehaviorWeights.from_genotype(each, names, config.base) for each in genotypes]
        trial_seed = int(np.random.SeedSequence((config.seed, generation)).generate_state(1)[0])
        fitness = -find_docking_times(weights, config, trial_seed)
        strategy.tell(genotypes, fitness)
        rows.append(fitness)
        progress("weights", (generation + 1) / config.generations)
    best = BehaviorWeights.from_genotype(np.clip(strategy.mean, 0.0, 1.0), names, config.base)
    return WeightsResult(best, np.concatenate(rows))


def find_docking_times(
    weights: Sequence[BehaviorWeights], config: WeightsConfig, seed: int
) -> Float[np.ndarray, " P"]:
    """Return the mean times that pairs of robots take to dock [s]; one that does not counts as `duration`.

    The pairs of all candidates are simulated at once.
    """
    positions = np.tile(1 + np.arange(config.pairs) % START_POSITIONS, len(weights))
    stacked = BehaviorWeights.stack(weights, 2 * config.pairs)
    times = run_docking_trials(
        positions, replace(TrialSetup(), duration=config.duration, weights=stacked), seed
    )
    seconds = np.where(times.locked, times.seconds, config.duration)
    return seconds.reshape(len(weights), config.pairs).mean(axis=1)
