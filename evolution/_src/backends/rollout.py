"""Jobs tried in the environment: many trials at once, in a vector environment for each stretch of the arena.

When a trial ends, the next one starts in its sub-environment, so that no thread waits for the slowest genotype. The
result of a trial depends on its genotype and its conditions only, whatever the other sub-environments run.
"""

import logging
from collections import Counter, OrderedDict, defaultdict, deque
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Float

from evolution._src.backends.scoring import Outcome
from evolution._src.backends.settings import CONDITIONS, MAX_ENVIRONMENTS
from evolution._src.backends.trials import (
    FAILED_PROGRESS,
    Job,
    Trials,
    find_arena_key,
    find_trial_controller,
    make_failure,
    prepare_arena,
)
from evolution._src.controllers.protocol import Controller, reset_rows
from evolution._src.errors import NoEnvironmentError, RunError
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import Organism

if TYPE_CHECKING:
    from symbrion_gym._src.environment.warp.device_vector_env import DeviceVectorEnv

logger = logging.getLogger(__name__)

_BATCH_SIZES = (8, 12, 16, 24, 36, 48)
"""Sub-environments of a vector environment; the smallest size that takes all trials is used, or a larger one that is
compiled already. Few sizes mean few compilations."""
_TICKS_BETWEEN_LOOKS = 16
"""Whether all episodes on a device have ended is looked up this often, as looking waits for the device."""
_DIFFERENT = ("arena", "randomization", "count", "seed")
"""Fields in which trials that share an environment may differ, the name of the arena among them."""
_environments: OrderedDict[Hashable, OrganismVectorEnv] = OrderedDict()
"""Vector environments of this process, the one used last at the end."""


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
    records: dict[str, np.ndarray] | None = None


def simulate(jobs: Sequence[Job], threads: int = 1, engine: str = "mujoco") -> list[Outcome]:
    """Try jobs in the environment."""
    groups: dict[Hashable, tuple[Trials, dict[float, list[Trial]]]] = {}
    for index, job in enumerate(jobs):
        key = _find_environment_key(job.trials)
        _, stretches = groups.setdefault(key, (job.trials, defaultdict(list)))
        for trial in split_job(index, job):
            stretches[trial.stretch].append(trial)
    results: dict[tuple[int, int], TrialResult] = {}
    for first, stretches in groups.values():
        controller = find_trial_controller(first)
        together = [
            _Rows(_find_environment(first, stretch, len(own), threads, engine), controller, own)
            for stretch, own in stretches.items()
        ]
        if getattr(together[0].environment, "array", "numpy") == "jax":
            for rows in together:
                results |= _run_on_device(rows, controller)
        else:
            results |= _run_trials(together, controller)
    return [
        _summarize([results[index, number] for number in range(job.trials.count)])
        for index, job in enumerate(jobs)
    ]


def simulate_on_device(jobs: Sequence[Job], threads: int = 1) -> list[Outcome]:
    """Try jobs on a GPU in single precision, all trials of a stretch of the arena at once; see `simulate`."""
    return simulate(jobs, threads, engine="warp")


def simulate_bodies(jobs: Sequence[Job], threads: int = 1) -> list[Outcome]:
    """Try jobs; those of a body whose environment cannot be made fail, as where no way is wide enough for it."""
    try:
        return simulate(jobs, threads)
    except NoEnvironmentError as error:
        places: dict[Organism, list[int]] = defaultdict(list)
        for place, job in enumerate(jobs):
            places[job.trials.find_organism()].append(place)
        if len(places) == 1:
            _warn_of_body(jobs[0].trials.find_organism().num_modules, str(error))
            return [make_failure(job.trials, str(error)) for job in jobs]
    outcomes: dict[int, Outcome] = {}
    for own in places.values():
        outcomes |= zip(own, simulate_bodies([jobs[place] for place in own], threads), strict=True)
    return [outcomes[place] for place in range(len(jobs))]


@lru_cache(maxsize=1000)
def _warn_of_body(modules: int, error: str) -> None:
    """Log once what is wrong with a body."""
    logger.warning("a body of %d modules counts as failed: %s", modules, error)


def warm_up(trials: Trials, num_jobs: int, threads: int, engine: str = "mujoco") -> None:
    """Compile the environment in which jobs will be tried, which also checks arena, body, start and goal."""
    job = Job(np.zeros(len(find_trial_controller(trials).parameters)), trials)
    for stretch, count in Counter(trial.stretch for trial in split_job(0, job)).items():
        environment = _find_environment(trials, stretch, num_jobs * count, threads, engine)
        first = np.arange(environment.num_envs) == 0  # the first trial begins there anyway
        try:
            environment.reset(options={"reset_mask": first})
        except ValueError as error:
            raise NoEnvironmentError(f"the environment cannot be made: {error}") from error


def _find_environment_key(trials: Trials) -> Hashable:
    """Return what trials must have in common to share an environment."""
    others = [getattr(trials, each.name) for each in fields(trials) if each.name not in _DIFFERENT]
    return find_arena_key(trials.arena), *others


def make_environment_options(trials: Trials) -> dict[str, Any]:
    """Return the options of the environment in which trials take place."""
    options: dict[str, Any] = {"sensors": find_trial_controller(trials).sensors}
    if trials.has_parameter("stuck_time"):
        options["stuck_time"] = trials.rollout.stuck_time
    if trials.descriptors:
        options["recorders"] = trials.descriptors
    body = trials.modules if trials.organism is None else trials.organism
    return options | trials.make_options() | {"arena": prepare_arena(trials.arena), "modules": body}


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


def _find_environment(
    conditions: Trials, stretch: float, num_trials: int, threads: int, engine: str
) -> OrganismVectorEnv:
    """Return a large enough environment, a new one or one that was used before."""
    same = (_find_environment_key(conditions), stretch, threads, engine)
    on_device, sizes = engine != "mujoco", list(_BATCH_SIZES)
    if on_device:  # it takes all trials at once: this many, or as many as one was made for before
        sizes = sorted({num_trials, *(size for _, size in _environments if size > num_trials)})  # pyright: ignore[reportGeneralTypeIssues]
    size = next((size for size in sizes if size >= num_trials), sizes[-1])
    larger = [(same, each) for each in sizes if each >= size and (same, each) in _environments]
    key = larger[0] if larger else (same, size)
    if key not in _environments:
        while len(_environments) >= MAX_ENVIRONMENTS * len(conditions.randomization.stretch):
            _environments.popitem(last=False)[1].close()
        controller = find_trial_controller(conditions)
        make = partial(_make_device_environment, controller) if on_device else OrganismVectorEnv
        try:
            options: dict[str, Any] = make_environment_options(conditions) | {"stretch": stretch}
            _environments[key] = make(
                num_envs=size,
                num_threads=None if on_device else threads,
                autoreset_mode=AutoresetMode.DISABLED,
                **options,
            )
        except (ValueError, TypeError) as error:  # no genotype is to blame
            raise NoEnvironmentError(f"the environment cannot be made: {error}") from error
    _environments.move_to_end(key)
    return _environments[key]


class _Rows:
    """Which trial runs in each sub-environment of an environment, with which genotype."""

    def __init__(self, environment: Any, controller: Controller, trials: Sequence[Trial]) -> None:
        self.environment, self.waiting = environment, deque(trials)
        self.running: list[Trial | None] = [None] * environment.num_envs
        self.genotypes = np.zeros((environment.num_envs, len(controller.parameters)))
        self.effort = np.zeros(environment.num_envs)

    def start(self, free: Iterable[int]) -> Float[Any, "E O"]:
        """Start waiting trials in free sub-environments; return the observations of all."""
        count = self.environment.num_envs
        mask, seeds = np.zeros(count, dtype=bool), [None] * count
        options: dict[str, list[float | None]] = {name: [None] * count for name in CONDITIONS}
        for row in free:
            if not self.waiting:
                break
            trial = self.running[row] = self.waiting.popleft()
            genes = trial.genotype[: self.genotypes.shape[1]]
            mask[row], self.genotypes[row], self.effort[row] = True, genes, 0.0
            seeds[row] = trial.seed  # pyright: ignore[reportCallIssue, reportArgumentType]
            for name in CONDITIONS:
                options[name][row] = trial.conditions.get(name, 0.0)
        return self.environment.reset(seed=seeds, options={**options, "reset_mask": mask})[0]

    def end(self, row: int, info: Mapping[str, Any]) -> dict[tuple[int, int], TrialResult]:
        """Return the result of the trial in a sub-environment, which is free then; nothing where it was free."""
        trial, self.running[row] = self.running[row], None
        if trial is None:
            return {}
        kept = self.environment.read_records(row) if self.environment.config.recorders else None
        result = TrialResult(
            success=bool(info["success"][row]),
            progress=float(info["progress"][row]),
            effort=float(self.effort[row]),
            seconds=float(info["time"][row]),
            diverged=bool(info["diverged"][row]),
            records=kept and {name: np.asarray(each, np.float64) for name, each in kept.items()},
        )
        return {(trial.job, trial.number): result}


def _run_trials(groups: Sequence[_Rows], controller: Controller) -> dict[tuple[int, int], TrialResult]:
    """Run the trials of several environments side by side; the controller acts in all of them at once."""
    ends = np.cumsum([len(rows.running) for rows in groups]).tolist()
    parts = [slice(*pair) for pair in pairwise([0, *ends])]
    first = groups[0].environment
    shape, structure = first.single_action_space.shape, first.observation_structure
    state = controller.begin(ends[-1])
    results: dict[tuple[int, int], TrialResult] = {}
    seen = np.concatenate([rows.start(range(len(rows.running))) for rows in groups])
    genotypes = np.concatenate([rows.genotypes for rows in groups])
    while any(any(rows.running) for rows in groups):
        actions, state = controller.act(seen, genotypes, structure, state)
        if actions.shape[1:] != shape:
            raise RunError(
                f"controller {controller.name!r} returns {actions.shape[-1]} numbers for an action of {shape[-1]}; "
                "give a controller that drives the tracks, too, or leave out track_control"
            )
        seen = seen.copy()  # a controller may keep the last one
        for rows, part in zip(groups, parts, strict=True):
            if not any(rows.running):
                continue
            seen[part], _, terminated, truncated, info = rows.environment.step(actions[part])
            rows.effort -= info.get("reward_effort", 0.0)
            ended = (terminated | truncated).nonzero()[0].tolist()
            for row in ended:
                results |= rows.end(row, info)
            if ended and rows.waiting:
                state = reset_rows(controller, state, [part.start + row for row in ended])
                seen[part], genotypes[part] = rows.start(ended), rows.genotypes
    return results


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


def _make_device_environment(controller: Controller, **options: Any) -> Any:
    """Return an environment whose physics is on a device, and all else if it can be."""
    try:
        environment: Any = make_vector_env(backend="warp", array="jax", **options)
        _check_controller(controller, environment)
    except (TaskError, OptionError, TypeError, AttributeError) as error:
        logger.info("observations, rewards and controllers are computed on the host: %s", error)
        return make_vector_env(backend="warp", **options)
    return environment


def _check_controller(controller: Controller, environment: "DeviceVectorEnv") -> None:
    """Trace a controller."""
    import jax

    num, shape = environment.num_envs, (environment.num_envs, len(controller.parameters))
    seen, genes = (
        jax.ShapeDtypeStruct(each, np.float32) for each in (environment.observation_space.shape, shape)
    )
    try:
        actions, _ = jax.eval_shape(_make_act(controller, environment), seen, genes, controller.begin(num))
    except Exception as error:  # whatever a controller of a user raises: it then acts on the host
        raise TypeError(f"controller {controller.name!r} does not run on a device: {error}") from error
    if actions.shape != environment.action_space.shape:
        raise TypeError(f"controller {controller.name!r} returns actions of shape {actions.shape}")


def _make_act(controller: Controller, environment: "DeviceVectorEnv") -> Any:
    structure = environment.observation_structure
    return lambda seen, genes, state: controller.act(seen, genes, structure, state)


def _run_on_device(rows: _Rows, controller: Controller) -> dict[tuple[int, int], TrialResult]:
    """Run trials side by side on a device, which has room for all of them."""
    import jax
    import jax.numpy as jnp

    environment: DeviceVectorEnv = rows.environment
    observation = rows.start(range(environment.num_envs))
    act = jax.jit(_make_act(controller, environment))

    @jax.jit
    def add_up(effort: Any, running: Any, spent: Any, ended: Any) -> tuple[Any, Any]:
        return effort - jnp.where(running, spent, 0.0), running & ~ended

    with jax.default_device(environment.batch.jax_device):
        state = jax.tree.map(jnp.asarray, controller.begin(environment.num_envs))
        genes = jnp.asarray(rows.genotypes, dtype=jnp.float32)
        effort, running = jnp.zeros(environment.num_envs), environment.find_running()
        info, tick = {}, 0
        while tick % _TICKS_BETWEEN_LOOKS or bool(running.any()):
            actions, state = act(observation, genes, state)
            observation, _, terminated, truncated, info = environment.step(actions)
            spent = info.get("reward_effort", jnp.zeros_like(effort))
            effort, running = add_up(effort, running, spent, terminated | truncated)
            tick += 1
    rows.effort = np.asarray(effort, dtype=float)
    last = {name: np.asarray(info[name]) for name in ("success", "progress", "time", "diverged")}
    return dict(item for row in range(environment.num_envs) for item in rows.end(row, last).items())
