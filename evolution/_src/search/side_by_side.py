"""Several runs of evolution at once, whose samples are tried in one batch: many populations fill a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from threading import Condition

from evolution._src.backends import rollout
from evolution._src.backends.making import LOCAL_BACKENDS
from evolution._src.backends.prepared_arenas import prepare_arena
from evolution._src.backends.simulation import Simulate
from evolution._src.backends.trials import Job, Outcome
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.record import VALIDATION
from evolution._src.search.run import Run
from reconstruction._src.base.progress import Progress, silent


def evolve_side_by_side(
    configs: Sequence[EvolutionConfig], *, simulate: Simulate | None = None, progress: Progress = silent
) -> list[Run]:
    """Run evolution for several configurations at once, and try the samples of all of them in one batch.

    Each population waits until the others have samples as well. Everything else, validation on the C engine included,
    is that of `evolve`; as the outcome of a trial does not depend on what is tried beside it, each run is the one that
    `evolve` would give with its configuration: to the bit with backend "batch", in distribution on a GPU.

    Args:
        configs: the runs, all with one backend of this process: "warp" or "batch". Seeds, bodies, controllers and
            arenas may differ; trials of one arena, body and task share a batch.
        simulate: the function that tries jobs; None means physics.
        progress: called with the progress of the arenas.

    Raises:
        RunError: there are no configurations, they differ in their backend, or a run failed.
        MissingExtraError: the extra `gpu` is not installed, which "warp" needs.
    """
    _check_backends(configs)
    if simulate is None:
        for config in configs:
            for stage in config.all_stages:
                prepare_arena(stage.arena, progress)
    is_on_device = configs[0].backend == "warp"
    meeting = _Meeting(len(configs), simulate, is_on_device)
    with ThreadPoolExecutor(len(configs)) as threads:
        runs = [threads.submit(meeting.run, number, config) for number, config in enumerate(configs)]
        return [run.result() for run in runs]


def _check_backends(configs: Sequence[EvolutionConfig]) -> None:
    """Refuse what cannot run in one batch.

    Raises:
        RunError: there are no configurations, or they differ in their backend, or it has other processes.
    """
    backends = sorted({config.backend for config in configs})
    if len(backends) != 1 or backends[0] not in LOCAL_BACKENDS:
        raise RunError(
            f"backends are {backends}; runs side by side need one of {' and '.join(LOCAL_BACKENDS)}, the same for all"
        )


class _Meeting:
    """Where populations wait for each other. One of them runs at a time: pycma draws from one global generator.

    Args:
        count: number of populations.
        simulate: the function that tries jobs; None means physics.
        is_on_device: whether samples are tried on a device.
    """

    def __init__(self, count: int, simulate: Simulate | None, is_on_device: bool) -> None:
        self._running, self._is_on_device, self._simulate = count, is_on_device, simulate
        self._condition = Condition()
        self._waiting: dict[int, tuple[Sequence[Job], int]] = {}
        self._found: dict[int, list[Outcome] | Exception] = {}

    def run(self, number: int, config: EvolutionConfig) -> Run:
        """Run one population to its end."""
        with self._condition:
            try:
                return evolve(config, simulate=partial(self._try, number))
            finally:
                self._running -= 1
                self._begin_if_complete()

    def _try(self, number: int, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        """Try jobs of a population: candidates at once on the C engine, samples with those of all others."""
        if all(job.trials.seed[1:2] == (VALIDATION,) for job in jobs):
            return (self._simulate or rollout.simulate)(jobs, threads)
        self._waiting[number] = jobs, threads
        self._begin_if_complete()
        self._condition.wait_for(lambda: number in self._found)
        found = self._found.pop(number)
        if isinstance(found, Exception):
            raise found
        return found

    def _begin_if_complete(self) -> None:
        """Try what waits once every running population waits, in the order of their numbers."""
        if not self._waiting or len(self._waiting) < self._running:
            return
        numbers = sorted(self._waiting)
        jobs = [job for number in numbers for job in self._waiting[number][0]]
        try:
            outcomes = iter(self._run_all(jobs, max(threads for _, threads in self._waiting.values())))
            self._found |= {number: [next(outcomes) for _ in self._waiting[number][0]] for number in numbers}
        except Exception as error:  # of one population; each tries its jobs one by one then
            self._found |= dict.fromkeys(numbers, error)
        self._waiting.clear()
        self._condition.notify_all()

    def _run_all(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        physics = rollout.simulate_on_device if self._is_on_device else rollout.simulate
        return (self._simulate or physics)(jobs, threads)
