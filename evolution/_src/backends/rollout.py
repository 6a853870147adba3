"""Jobs tried in the environment: many trials at once, in the sub-environments of one vector environment.

When a trial ends, the next one starts in its sub-environment, so that no thread waits for the slowest genotype. The
result of a trial depends on its genotype and its conditions only, whatever the other sub-environments run.
"""

from __future__ import annotations

import logging
from collections import OrderedDict, defaultdict, deque
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Float

from evolution._src.backends.outcome import FAILED_PROGRESS, Outcome
from evolution._src.backends.scoring import Records, as_records
from evolution._src.backends.settings import CONDITIONS, RolloutConfig
from evolution._src.backends.trials import (
    Job,
    Trials,
    find_arena_key,
    find_trial_controller,
    prepare_arena,
)
from evolution._src.controllers.protocol import Controller, reset_rows
from evolution._src.errors import NoEnvironmentError, RunError
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.randomization import LayoutError
from symbrion_gym._src.errors import OptionError, TaskError

if TYPE_CHECKING:
    from symbrion_gym._src.environment.warp.device_vector_env import DeviceVectorEnv

logger = logging.getLogger(__name__)

_TICKS_BETWEEN_LOOKS = 16
"""Whether all episodes have ended is looked up this often, as looking waits for the device."""


def make_device_environment(controller: Controller, stretches: Sequence[float], **options: Any) -> Any:
    """Return an environment whose physics is on a device, and all else if it can be."""
    if len(stretches) > 1:
        raise LayoutError(f"backend 'warp' holds one arena, and there are stretches {tuple(stretches)}")
    try:
        environment: Any = make_vector_env(backend="warp", array="jax", stretch=stretches[0], **options)
        _check_controller(controller, environment)
    except (TaskError, OptionError, TypeError, AttributeError) as error:
        logger.info("observations, rewards and controllers are computed on the host: %s", error)
        return make_vector_env(backend="warp", stretches=stretches, **options)
    return environment


def _check_controller(controller: Controller, environment: DeviceVectorEnv) -> None:
    """Trace a controller."""
    import jax

    num, shape = environment.num_envs, (environment.num_envs, len(controller.parameters))
    seen, genes = (
        jax.ShapeDtypeStruct(each, np.float32) for each in (environment.observation_space.shape, shape)
    )
    act = _make_act(controller, environment)
    try:
        actions, _ = jax.eval_shape(act, seen, genes, controller.begin(num))
    except Exception as error:  # whatever a controller of a user raises: it then acts on the host
        raise TypeError(f"controller {controller.name!r} does not run on a device: {error}") from error
    if actions.shape != environment.action_space.shape:
        raise TypeError(f"controller {controller.name!r} returns actions of shape {actions.shape}")


def _make_act(controller: Controller, environment: DeviceVectorEnv) -> Any:
    structure = environment.observation_structure
    return lambda seen, genes, state: controller.act(seen, genes, structure, state)


def is_on_device(environment: Any) -> bool:
    """Return whether observations and actions of an environment stay on a device."""
    return getattr(environment, "array", "numpy") == "jax"


def run_on_device(
    environment: DeviceVectorEnv, controller: Controller, genotypes: Float[np.ndarray, "N G"], begun: Any
) -> tuple[dict[str, np.ndarray], Float[np.ndarray, " N"]]:
    """Run one episode of every simulation; return the last `info` and the work of the hinges' reward."""
    import jax
    import jax.numpy as jnp

    device = environment.batch.jax_device
    act = jax.jit(_make_act(controller, environment))

    @jax.jit
    def add_up(effort: Any, running: Any, spent: Any, ended: Any) -> tuple[Any, Any]:
        return effort - jnp.where(running, spent, 0.0), running & ~ended

    with jax.default_device(device):
        state = jax.tree.map(jnp.asarray, controller.begin(environment.num_envs))
        genes = jnp.asarray(genotypes, dtype=jnp.float32)
        effort, running = jnp.zeros(environment.num_envs), environment.find_running()
        observation, info, tick = begun, {}, 0
        while tick % _TICKS_BETWEEN_LOOKS or bool(running.any()):
            actions, state = act(observation, genes, state)
            observation, _, terminated, truncated, info = environment.step(actions)
            spent = info.get("reward_effort", jnp.zeros_like(effort))
            effort, running = add_up(effort, running, spent, terminated | truncated)
            tick += 1
    names = ("success", "progress", "time", "diverged")
    return {name: np.asarray(info[name]) for name in names}, np.asarray(effort, dtype=float)


class Trial(NamedTuple):
    """One genotype under one set of conditions."""

    job: int  # index of the job it belongs to
    number: int  # number of the trial in its job
    genotype: Float[np.ndarray, " G"]  # genotype of the controller
    stretch: float  # factor on the length of the arena
    conditions: dict[str, float]  # reset options
    seed: int  # seed of the environment's own noise


class TrialResult(NamedTuple):
    """How a trial ended; units as in `Outcome`."""

    success: bool
    progress: float
    effort: float
    seconds: float
    diverged: bool
    records: Records | None = None


_environments: OrderedDict[Hashable, OrganismVectorEnv] = OrderedDict()
"""Vector environments of this process, the one used last at the end."""
_separate: set[Hashable] = set()  # Arenas whose stretched versions do not fit into one vector environment


def simulate_on_device(jobs: Sequence[Job], threads: int = 1) -> list[Outcome]:
    """Try jobs on a GPU in single precision, all trials of a stretch of the arena at once; see `simulate`."""
    return simulate(jobs, threads, engine="warp")


def simulate(
    jobs: Sequence[Job], threads: int = 1, config: RolloutConfig | None = None, engine: str = "mujoco"
) -> list[Outcome]:
    """Try jobs in the environment."""
    groups: dict[Hashable, list[Trial]] = defaultdict(list)
    for index, job in enumerate(jobs):
        key = find_environment_key(job.trials), job.trials.randomization.stretch
        groups[key] += split_job(index, job)
    results: dict[tuple[int, int], TrialResult] = {}
    for trials in groups.values():
        first = jobs[trials[0].job].trials
        controller = find_trial_controller(first)
        for environment, own_trials in _group_by_environment(
            first, trials, threads, config or first.rollout, engine
        ):
            results |= _run_trials(environment, controller, own_trials)
    return [
        _summarize([results[index, number] for number in range(job.trials.count)])
        for index, job in enumerate(jobs)
    ]


def warm_up(trials: Trials, num_jobs: int, threads: int, engine: str = "mujoco") -> None:
    """Compile the environment in which jobs will be tried, which also checks arena, body, start and goal."""
    job = Job(np.zeros(len(find_trial_controller(trials).parameters)), trials)
    expected = [trial for index in range(num_jobs) for trial in split_job(index, job)]
    for environment, _ in _group_by_environment(trials, expected, threads, trials.rollout, engine):
        first = np.arange(environment.num_envs) == 0  # the first trial begins there anyway
        try:
            environment.reset(options={"reset_mask": first})
        except ValueError as error:
            raise NoEnvironmentError(f"the environment cannot be made: {error}") from error


_DIFFERENT = ("arena", "randomization", "count", "seed")
"""Fields in which trials that share an environment may differ, the name of the arena among them."""


def find_environment_key(trials: Trials) -> Hashable:
    """Return what trials must have in common to share an environment."""
    others = [getattr(trials, each.name) for each in fields(trials) if each.name not in _DIFFERENT]
    return find_arena_key(trials.arena), *others


def make_environment_options(trials: Trials, stuck_time: float | None = None) -> dict[str, Any]:
    """Return the options of the environment in which trials take place."""
    sensors = find_trial_controller(trials).sensors
    stuck_time = trials.rollout.stuck_time if stuck_time is None else stuck_time
    patience = {"stuck_time": stuck_time} if trials.has_parameter("stuck_time") else {}
    options = {"sensors": sensors} | patience | trials.make_options()
    body = trials.modules if trials.organism is None else trials.organism
    if trials.descriptors:
        options["recorders"] = trials.descriptors
    return options | {"arena": prepare_arena(trials.arena), "modules": body}


def split_job(index: int, job: Job) -> list[Trial]:
    """Return the trials of a job, their conditions sampled from its seed."""
    sampled = job.trials.randomization.draw(job.trials.seed, job.trials.count)
    stretches = sampled.pop("stretch")
    seeds = np.random.SeedSequence(list(job.trials.seed)).generate_state(job.trials.count)
    return [
        Trial(
            job=index,
            number=number,
            genotype=job.genotype,
            stretch=float(stretches[number]),
            conditions={name: float(values[number]) for name, values in sampled.items()},
            seed=int(seeds[number]),
        )
        for number in range(job.trials.count)
    ]


def _group_by_environment(
    conditions: Trials, trials: Sequence[Trial], threads: int, config: RolloutConfig, engine: str
) -> Iterator[tuple[OrganismVectorEnv, list[Trial]]]:
    """Yield environments and their trials: one for all stretches, or one each where they are too different."""
    key = find_environment_key(conditions), engine
    stretches = tuple(sorted(set(conditions.randomization.stretch)))
    if (key, stretches) not in _separate:
        try:
            yield _find_environment(conditions, stretches, len(trials), threads, config, engine), list(trials)
            return
        except LayoutError:
            _separate.add((key, stretches))
    for stretch in stretches:
        own_trials = [trial for trial in trials if trial.stretch == stretch]
        if own_trials:
            count = len(own_trials)
            yield _find_environment(conditions, (stretch,), count, threads, config, engine), own_trials


def _find_environment(
    conditions: Trials,
    stretches: tuple[float, ...],
    num_trials: int,
    threads: int,
    config: RolloutConfig,
    engine: str,
) -> OrganismVectorEnv:
    """Return a large enough environment, a new one or one that was used before."""
    on_device = engine != "mujoco"
    sizes = _list_device_sizes(num_trials) if on_device else config.batch_sizes
    size = next((size for size in sizes if size >= num_trials), sizes[-1])
    same = (find_environment_key(conditions), config.stuck_time, stretches, threads, engine)
    larger = [(same, each) for each in sizes if each >= size and (same, each) in _environments]
    key = larger[0] if larger else (same, size)
    if key not in _environments:
        while len(_environments) >= config.max_environments:
            _environments.popitem(last=False)[1].close()
        try:
            controller = find_trial_controller(conditions)
            make = partial(make_device_environment, controller) if on_device else OrganismVectorEnv
            _environments[key] = make(
                num_envs=size,
                num_threads=None if on_device else threads,
                autoreset_mode=AutoresetMode.DISABLED,
                stretches=stretches,
                **make_environment_options(conditions, config.stuck_time),
            )
        except LayoutError:
            raise
        except (ValueError, TypeError) as error:  # no genotype is to blame
            raise NoEnvironmentError(f"the environment cannot be made: {error}") from error
    _environments.move_to_end(key)
    return _environments[key]


def _list_device_sizes(num_trials: int) -> list[int]:
    """Return the sizes of environments on a device that take all trials: this one, and those made for more before."""
    return sorted({num_trials, *(size for _, size in _environments if size > num_trials)})  # pyright: ignore[reportGeneralTypeIssues]


def _run_trials(
    environment: OrganismVectorEnv, controller: Controller, trials: Sequence[Trial]
) -> dict[tuple[int, int], TrialResult]:
    if is_on_device(environment):
        return _run_all(environment, controller, trials)
    num_envs = environment.num_envs
    shape = environment.action_space.shape or (num_envs,)
    structure, has_records = environment.observation_structure, bool(environment.config.recorders)
    waiting = deque(trials)
    running: list[Trial | None] = [None] * num_envs
    genotypes = np.zeros((num_envs, len(controller.parameters)))
    effort = np.zeros(num_envs)
    state = controller.begin(num_envs)
    results: dict[tuple[int, int], TrialResult] = {}
    observation = _start_trials(environment, waiting, running, genotypes, effort, range(num_envs))
    while len(results) < len(trials):
        actions, state = controller.act(observation, genotypes, structure, state)
        if actions.shape != shape:
            raise RunError(
                f"controller {controller.name!r} returns {actions.shape[-1]} numbers for an action of {shape[-1]}; "
                "give a controller that drives the tracks, too, or leave out track_control"
            )
        observation, _, terminated, truncated, info = environment.step(actions)
        effort -= info.get("reward_effort", 0.0)
        ended = (terminated | truncated).nonzero()[0].tolist()
        for row in ended:
            trial = running[row]
            if trial is not None:
                results[trial.job, trial.number] = TrialResult(
                    success=bool(info["success"][row]),
                    progress=float(info["progress"][row]),
                    effort=float(effort[row]),
                    seconds=float(info["time"][row]),
                    diverged=bool(info["diverged"][row]),
                    records=as_records(environment.read_records(row)) if has_records else None,
                )
                running[row] = None
        if ended and waiting:
            state = reset_rows(controller, state, ended)
            observation = _start_trials(environment, waiting, running, genotypes, effort, ended)
    return results


def _run_all(
    environment: OrganismVectorEnv, controller: Controller, trials: Sequence[Trial]
) -> dict[tuple[int, int], TrialResult]:
    """Run trials side by side on a device, which has room for all of them."""
    num_envs = environment.num_envs
    running: list[Trial | None] = [None] * num_envs
    genotypes = np.zeros((num_envs, len(controller.parameters)))
    begun = _start_trials(environment, deque(trials), running, genotypes, np.zeros(num_envs), range(num_envs))
    info, effort = run_on_device(cast(Any, environment), controller, genotypes, begun)
    return {
        (trial.job, trial.number): TrialResult(
            success=bool(info["success"][row]),
            progress=float(info["progress"][row]),
            effort=float(effort[row]),
            seconds=float(info["time"][row]),
            diverged=bool(info["diverged"][row]),
        )
        for row, trial in enumerate(running)
        if trial is not None
    }


def _start_trials(
    environment: OrganismVectorEnv,
    waiting: deque[Trial],
    running: list[Trial | None],
    genotypes: Float[np.ndarray, "E G"],
    effort: Float[np.ndarray, " E"],
    free: Iterable[int],
) -> Float[Any, "E O"]:
    """Start waiting trials in free sub-environments; return the observations of all."""
    mask = np.zeros(environment.num_envs, dtype=bool)
    options: dict[str, list[float | None]] = {name: [None] * environment.num_envs for name in CONDITIONS}
    seeds: list[int | None] = [None] * environment.num_envs
    stretches: list[float | None] = [None] * environment.num_envs
    for row in free:
        if not waiting:
            break
        trial = running[row] = waiting.popleft()
        mask[row], genotypes[row], effort[row] = True, trial.genotype[: genotypes.shape[1]], 0.0
        seeds[row] = trial.seed
        stretches[row] = trial.stretch
        for name in CONDITIONS:
            options[name][row] = trial.conditions.get(name, 0.0)
    observation, _ = environment.reset(
        seed=seeds, options={**options, "stretch": stretches, "reset_mask": mask}
    )
    return observation


def _summarize(results: Sequence[TrialResult]) -> Outcome:
    """Return the outcome of a job from its trials; a diverged one counts as far behind the start."""
    return Outcome(
        progress=float(np.mean([FAILED_PROGRESS if each.diverged else each.progress for each in results])),
        effort=float(np.mean([each.effort for each in results])),
        succeeded=tuple(each.success for each in results),
        seconds=float(np.sum([each.seconds for each in results])),
        diverged=sum(each.diverged for each in results),
        descriptors=tuple(each.records for each in results if each.records is not None),
    )
