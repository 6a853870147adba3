"""Jobs tried in the environment: many trials at once, as lanes of one vector environment.

A lane whose trial ends takes up the next one, so that no thread waits for the slowest genotype. What
comes of a trial depends on its genotype and its conditions alone, whatever runs in the other lanes.
"""

from collections import OrderedDict, defaultdict, deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode

from evolution.backends.trials import FAILED_PROGRESS, Job, Outcome, Trials
from evolution.controllers.controller import Controller, make_controller
from evolution.errors import RunError
from symbrion_gym.environment.models import LayoutError
from symbrion_gym.environment.vector import SnakePitVectorEnv

STUCK_TIME = 5.0
"""A memoryless body that has not moved on for this long [s] will not; the environment's own patience is
for those that may."""
LANES = (8, 16, 24, 36, 48)
_KEPT = 12

_environments: OrderedDict[Any, SnakePitVectorEnv] = OrderedDict()
_apart: set[Any] = set()
"""Arenas whose stretched versions do not share a batch."""


class Trial(NamedTuple):
    """One genotype under one set of conditions.

    Attributes:
        job: index of the job it belongs to.
        number: of the trial in its job.
        genotype: `[G]`.
        stretch: of the arena.
        conditions: reset options.
        seed: of the environment's own noise.
    """

    job: int
    number: int
    genotype: np.ndarray
    stretch: float
    conditions: dict[str, float]
    seed: int


class Ending(NamedTuple):
    """How a trial ended."""

    success: bool
    progress: float
    effort: float
    seconds: float
    diverged: bool


def simulate(jobs: Sequence[Job], threads: int = 1) -> list[Outcome]:
    """Try jobs in the environment.

    Args:
        jobs: genotypes and their trials.
        threads: of `mujoco.batch`; they change nothing but the time.

    Raises:
        RunError: the environment cannot be made.
    """
    groups: dict[Any, list[Trial]] = defaultdict(list)
    for index, job in enumerate(jobs):
        key = find_environment_key(job.trials), job.trials.randomisation.stretch
        groups[key] += split_job(index, job)
    endings: dict[tuple[int, int], Ending] = {}
    for trials in groups.values():
        first = jobs[trials[0].job].trials
        controller = make_controller(first.controller, first.modules)
        for environment, mine in _share_out(first, trials, threads):
            endings |= _run_lanes(environment, controller, mine)
    return [
        _summarise([endings[index, number] for number in range(job.trials.count)])
        for index, job in enumerate(jobs)
    ]


def find_environment_key(trials: Trials) -> Any:
    """Return what trials must have in common to share an environment."""
    arena = trials.arena if isinstance(trials.arena, str) else id(trials.arena)
    return arena, trials.modules, trials.controller, trials.start, trials.environment


def make_environment_options(trials: Trials) -> dict[str, Any]:
    """Return the options of the environment in which trials take place."""
    sensors = make_controller(trials.controller, trials.modules).sensors
    options = {"sensors": sensors, "stuck_time": STUCK_TIME} | dict(trials.environment)
    return options | {"arena": trials.arena, "modules": trials.modules, "start": trials.start}


def split_job(index: int, job: Job) -> list[Trial]:
    """Return the trials of a job, their conditions drawn from its seed."""
    drawn = job.trials.randomisation.draw(job.trials.seed, job.trials.count)
    stretches = drawn.pop("stretch")
    seeds = np.random.SeedSequence(list(job.trials.seed)).generate_state(job.trials.count)
    return [
        Trial(
            job=index,
            number=number,
            genotype=job.genotype,
            stretch=float(stretches[number]),
            conditions={name: float(values[number]) for name, values in drawn.items()},
            seed=int(seeds[number]),
        )
        for number in range(job.trials.count)
    ]


def _share_out(
    conditions: Trials, trials: Sequence[Trial], threads: int
) -> Iterator[tuple[SnakePitVectorEnv, list[Trial]]]:
    """Yield environments and their trials: one for all stretches, or one each where they are too different."""
    key, stretches = find_environment_key(conditions), tuple(sorted(set(conditions.randomisation.stretch)))
    if (key, stretches) not in _apart:
        try:
            yield _find_environment(conditions, stretches, len(trials), threads), list(trials)
            return
        except LayoutError:
            _apart.add((key, stretches))
    for stretch in stretches:
        mine = [trial for trial in trials if trial.stretch == stretch]
        if mine:
            yield _find_environment(conditions, (stretch,), len(mine), threads), mine


def _find_environment(
    conditions: Trials, stretches: tuple[float, ...], num_trials: int, threads: int
) -> SnakePitVectorEnv:
    """Return an environment with enough lanes, compiled anew or kept from before.

    Raises:
        LayoutError: the stretched arenas do not share a batch.
        RunError: it cannot be made.
    """
    lanes = next((size for size in LANES if size >= num_trials), LANES[-1])
    key = (find_environment_key(conditions), stretches, lanes, threads)
    if key not in _environments:
        while len(_environments) >= _KEPT:
            _environments.popitem(last=False)[1].close()
        try:
            _environments[key] = SnakePitVectorEnv(
                num_envs=lanes,
                num_threads=threads,
                autoreset_mode=AutoresetMode.DISABLED,
                stretches=stretches,
                **make_environment_options(conditions),
            )
        except LayoutError:
            raise
        except (ValueError, TypeError) as error:  # no genotype is to blame
            raise RunError(f"the environment cannot be made: {error}") from error
    _environments.move_to_end(key)
    return _environments[key]


def _run_lanes(
    environment: SnakePitVectorEnv, controller: Controller, trials: Sequence[Trial]
) -> dict[tuple[int, int], Ending]:
    lanes = environment.num_envs
    structure = environment.observation_structure
    waiting = deque(trials)
    running: list[Trial | None] = [None] * lanes
    genotypes = np.zeros((lanes, len(controller.parameters)))
    effort = np.zeros(lanes)
    state = controller.begin(lanes)
    endings: dict[tuple[int, int], Ending] = {}
    observation = _take_up(environment, waiting, running, genotypes, effort, range(lanes))
    while len(endings) < len(trials):
        actions, state = controller.act(observation, genotypes, structure, state)
        observation, _, terminated, truncated, info = environment.step(actions)
        effort -= info["reward_effort"]
        ended = (terminated | truncated).nonzero()[0].tolist()
        for lane in ended:
            trial = running[lane]
            if trial is not None:
                endings[trial.job, trial.number] = Ending(
                    success=bool(info["success"][lane]),
                    progress=float(info["progress"][lane]),
                    effort=float(effort[lane]),
                    seconds=float(info["time"][lane]),
                    diverged=bool(info["diverged"][lane]),
                )
                running[lane] = None
        if ended and waiting:
            state.silence[ended] = 0
            observation = _take_up(environment, waiting, running, genotypes, effort, ended)
    return endings


def _take_up(
    environment: SnakePitVectorEnv,
    waiting: deque[Trial],
    running: list[Trial | None],
    genotypes: np.ndarray,
    effort: np.ndarray,
    free: Any,
) -> np.ndarray:
    """Begin waiting trials in free lanes; return the observations of all."""
    mask = np.zeros(environment.num_envs, dtype=bool)
    names = ("friction", "torque_scale", "start_offset", "yaw")
    options: dict[str, Any] = {name: [None] * environment.num_envs for name in names}
    seeds: list[int | None] = [None] * environment.num_envs
    stretches: list[float | None] = [None] * environment.num_envs
    for lane in free:
        if not waiting:
            break
        trial = running[lane] = waiting.popleft()
        mask[lane], genotypes[lane], effort[lane] = True, trial.genotype[: genotypes.shape[1]], 0.0
        seeds[lane] = trial.seed
        stretches[lane] = trial.stretch
        for name in names:
            options[name][lane] = trial.conditions[name]
    observation, _ = environment.reset(
        seed=seeds, options={**options, "stretch": stretches, "reset_mask": mask}
    )
    return observation


def _summarise(endings: Sequence[Ending]) -> Outcome:
    """Return the outcome of a job from its trials; a diverged one counts as far behind the start."""
    return Outcome(
        progress=float(np.mean([FAILED_PROGRESS if each.diverged else each.progress for each in endings])),
        effort=float(np.mean([ending.effort for ending in endings])),
        succeeded=tuple(ending.success for ending in endings),
        seconds=float(np.sum([ending.seconds for ending in endings])),
        diverged=sum(ending.diverged for ending in endings),
    )
