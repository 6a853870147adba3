"""The loop: ask for genotypes, try them, tell their fitness, validate candidates, record everything.

A run resumes by replaying its recorded generations through the same code, with outcomes from the record instead of
physics; so what follows is bit-identical.
"""

import logging
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from evolution._src.backends.cluster import LOCAL_BACKENDS, Backend, make_backend
from evolution._src.backends.outcome import check_tried
from evolution._src.backends.rollout import warm_up
from evolution._src.backends.scoring import compute_fitness
from evolution._src.backends.settings import BodyConfig, TrialConfig, take_fields
from evolution._src.backends.simulation import Simulate
from evolution._src.backends.trials import Job, Trials, prepare_arena
from evolution._src.controllers.source import ControllerSource
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import HISTORY, SAMPLE, TIMES, VALIDATION, Entry, Record
from evolution._src.search.restarting_search import RestartingSearch
from evolution._src.search.run import Run, RunFolder, find_champion, is_solved
from evolution._src.search.validation import Champion
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.progress import Progress, silent

OnGeneration = Callable[[Run], None]
"""Called with the run so far after each generation; the last row of `run.history` has the latest numbers."""

logger = logging.getLogger(__name__)


def evolve(
    config: EvolutionConfig,
    *,
    simulate: Simulate | None = None,
    on_generation: OnGeneration | None = None,
    progress: Progress = silent,
) -> Run:
    """Run evolution from its beginning.

    Args:
        config: configuration of the run; `config.folder` must not contain a run yet.
        simulate: the function that tries jobs; None means physics.
        on_generation: called with the run so far after each generation.
        progress: called with the progress of the run.

    Raises:
        RunError: the folder contains a run, cannot be written or is being written by another run.
    """
    if config.must_be_restorable:
        config.to_json()  # refuses what no file and no other process could restore, before anything is written
    if simulate is None and config.generations:
        prepare(config, progress)
    if config.folder is None:
        return _run(config, Record(), None, simulate, on_generation, progress)
    folder = RunFolder(config.folder)
    with folder.lock():
        folder.begin(config)
        return _run(config, Record(), folder, simulate, on_generation, progress)


def resume(
    folder: str | Path,
    *,
    simulate: Simulate | None = None,
    on_generation: OnGeneration | None = None,
    progress: Progress = silent,
    allow: Collection[str] = (),
    **changes: Any,
) -> Run:
    """Continue a run as if it had never stopped.

    Args:
        folder: folder of the run.
        simulate: the function that tries jobs; None means physics.
        on_generation: called with the run so far after each new generation.
        progress: called with the progress of the run.
        allow: modules of yours that the folder names and that may be imported; a folder runs no other code.
        changes: new values of `generations`, `workers`, `backend`, `address` or `stop_when_solved`.

    Raises:
        RunError: there is no run, or it is damaged, contradicts its configuration, or is being written.
    """
    allowed = set(EvolutionConfig.RUNTIME) - {"folder"}
    if not set(changes) <= allowed:
        raise RunError(f"{sorted(set(changes) - allowed)} cannot change in a run; {sorted(allowed)} can")
    run_folder = RunFolder(folder)
    if not run_folder.has_run():
        raise RunError(f"{folder} contains no run; evolve begins one")
    with run_folder.lock():
        stored = run_folder.read_config()
        config = replace(stored, folder=str(folder), **changes).restore(allow)
        record = run_folder.read_record(config)
        if simulate is None and config.generations > record.num_generations:
            prepare(config, progress)
        if config != stored:
            run_folder.write_config(config)
        return _run(config, record, run_folder, simulate, on_generation, progress)


def prepare(config: EvolutionConfig, progress: Progress = silent) -> None:
    """Build the arenas of a run, with progress, and check body, start and goal by compiling the first environment."""
    if config.backend == "warp":
        require_extras("backend 'warp'", "gpu")
    prepare_arena(config.arena, progress)
    trials = Trials(
        **take_fields(config, TrialConfig), **take_fields(config, BodyConfig), count=config.trials
    )
    is_here, engine = config.backend in LOCAL_BACKENDS, "warp" if config.backend == "warp" else "mujoco"
    progress("compiling the environment", 0.0)
    warm_up(trials, config.population_size if is_here else 1, config.workers if is_here else 1, engine)


def load_run(folder: str | Path) -> Run:
    """Read a run without continuing it; also while another process writes it.

    Nothing that a user wrote is imported: the record of a run with a controller of a user is read, but not replayed.

    Raises:
        RunError: there is no run, or it is damaged or contradicts its configuration.
    """
    run_folder = RunFolder(folder)
    config = run_folder.read_config()
    if isinstance(config.controller, ControllerSource):
        return run_folder.read_run(config)
    evolution = _Evolution(config, run_folder.read_record(config), None)
    evolution.replay()
    return evolution.make_run(Path(folder))


def _run(
    config: EvolutionConfig,
    record: Record,
    folder: RunFolder | None,
    simulate: Simulate | None,
    on_generation: OnGeneration | None,
    progress: Progress,
) -> Run:
    backend = make_backend(config.backend, config.workers, config.address, simulate)
    judge = make_backend("batch", config.workers, None, simulate) if config.backend == "warp" else None
    try:
        evolution = _Evolution(config, record, backend, judge)
        evolution.replay()
        path = folder.path if folder else None
        run = evolution.make_run(path)
        if folder and run.history.size:
            folder.write(run)
        while not evolution.is_over():
            evolution.step()
            run = evolution.make_run(path)
            if folder:
                folder.write(run)
            if on_generation:
                on_generation(run)
            progress(f"generation {len(run.history)}", len(run.history) / max(config.generations, 1))
        return run
    finally:
        backend.close()


class _Evolution:
    """One run in progress; `judge` tries candidates for the champion, where `backend` is not exact."""

    def __init__(
        self, config: EvolutionConfig, past: Record, backend: Backend | None, judge: Backend | None = None
    ) -> None:
        self._search = RestartingSearch(config)
        self._strategy = self._search.strategy
        self._config, self._past, self._backend = config, past, backend
        self._judge = judge or backend
        self._record = Record()
        self._replayed: list[Entry] | None = None
        self._wall_seconds = 0.0

    def replay(self) -> None:
        """Replay the recorded generations."""
        for entries, row in self._past.generations():
            self._replayed = list(entries)
            self.step()
            self._wall_seconds = float(row["wall_seconds"])
            replayed = self._record.history[-1]
            differs = any(replayed[name] != row[name] for name in HISTORY.names or () if name not in TIMES)
            if self._replayed or differs:
                raise self._mismatch(int(row["generation"]))
            self._record.set_wall_seconds(self._wall_seconds)
        self._replayed = None

    def is_over(self) -> bool:
        """Return whether the run has ended."""
        if self._record.num_generations >= self._config.generations:
            return True
        return self._config.stop_when_solved and self._is_solved()

    def step(self) -> None:
        """Run one generation."""
        began = time.perf_counter()
        generation = self._record.num_generations
        population_size, restarts = self._strategy.population_size, self._strategy.restarts
        genotypes, mean = self._strategy.ask(), self._strategy.mean
        samples = self._try(SAMPLE, list(enumerate(genotypes)), self._config.trials)
        fitness = np.array([entry.fitness for entry in samples])
        self._strategy.tell(genotypes, fitness)
        validated = self._validate(samples, mean)
        entries = samples + validated
        self._wall_seconds += time.perf_counter() - began
        row = self._make_row(samples, entries) | {
            "population_size": population_size,
            "restarts": restarts,
            "validated": len({entry.index for entry in validated}),
        }
        self._record.add_generation(entries, row)
        champion = self._find_champion()
        if champion is not None:
            self._record.set_champion(champion.successes, champion.trials)
        self._search.restart_if_stagnant(self._record.entries, generation + 1)

    def _make_row(self, samples: Sequence[Entry], entries: Sequence[Entry]) -> dict[str, float]:
        """Return most of a generation's row of the history, from its samples and all its entries."""
        generation = self._record.num_generations
        before = self._record.history[-1] if generation else np.zeros(1, dtype=HISTORY)[0]
        fitness = np.array([entry.fitness for entry in samples])
        return {
            "generation": generation,
            "evaluations": int(before["evaluations"]) + len(samples),
            "wall_seconds": round(self._wall_seconds, 3),
            "best": fitness.max(),
            "median": np.median(fitness),
            "sigma": self._strategy.sigma,
            "successes": sum(all(entry.outcome.succeeded) for entry in samples),
            "trials": int(before["trials"]) + sum(entry.outcome.trials for entry in entries),
            "champion_successes": 0,
            "champion_trials": 0,
            "failures": sum(bool(entry.outcome.error) for entry in samples),
        }

    def make_run(self, folder: Path | None) -> Run:
        """Return the run so far."""
        names = self._search.controller.parameters
        return Run(
            config=self._config,
            record=self._record,
            champion=find_champion(self._config, self._record, names),
            is_solved=self._is_solved(),
            folder=folder,
        )

    def _try(
        self, kind: int, numbered: Sequence[tuple[int, Float[np.ndarray, " G"]]], count: int, block: int = 0
    ) -> list[Entry]:
        """Try genotypes, or take their outcomes from the record."""
        if self._replayed is not None:
            return self._take_recorded(kind, numbered)
        backend = self._judge if kind == VALIDATION else self._backend
        if backend is None:
            raise RuntimeError("a run that is only read has no backend")
        jobs = [self._make_job(kind, index, genotype, count, block) for index, genotype in numbered]
        outcomes = backend.run(jobs)
        if kind == SAMPLE and not self._record.num_generations:  # later on, the genotypes may be to blame
            check_tried(outcomes)
        return [
            Entry(
                generation=self._record.num_generations,
                kind=kind,
                index=index,
                genotype=genotype,
                fitness=compute_fitness(self._config.scoring, outcome, self._config.find_organism()),
                outcome=outcome,
            )
            for (index, genotype), outcome in zip(numbered, outcomes, strict=True)
        ]

    def _make_job(
        self, kind: int, index: int, genotype: Float[np.ndarray, " G"], count: int, block: int
    ) -> Job:
        """Return the trials of a genotype; candidates have conditions of their own in each round (`block`)."""
        config, is_validation = self._config, kind == VALIDATION
        own_seed = (index + 1, block) if is_validation else ()
        seed = (config.seed, kind, self._record.num_generations, *own_seed)
        settings = take_fields(config, TrialConfig) | take_fields(config, BodyConfig)
        if is_validation and config.validation_start != config.find_start():
            settings["start"] = config.validation_start
        return Job(genotype, Trials(**settings, count=count, seed=seed))

    def _take_recorded(
        self, kind: int, numbered: Sequence[tuple[int, Float[np.ndarray, " G"]]]
    ) -> list[Entry]:
        assert self._replayed is not None
        taken, self._replayed = self._replayed[: len(numbered)], self._replayed[len(numbered) :]
        if len(taken) < len(numbered) or any(
            entry.kind != kind or entry.index != index or not np.array_equal(entry.genotype, genotype)
            for entry, (index, genotype) in zip(taken, numbered, strict=True)
        ):
            raise self._mismatch(self._record.num_generations)
        return taken

    def _validate(self, samples: Sequence[Entry], mean: Float[np.ndarray, " G"]) -> list[Entry]:
        """Try the candidates under new conditions, while enough trials succeed."""
        validation = self._config.validation
        fitness = np.array([entry.fitness for entry in samples])
        indices = validation.select_candidates(fitness, [entry.outcome for entry in samples])
        genotypes = [*(entry.genotype for entry in samples), mean]
        remaining = [(index, genotypes[index]) for index in indices]
        tried: list[Entry] = []
        for block, count in enumerate(validation.rounds):
            tried += self._try(VALIDATION, remaining, count, block)
            remaining = [
                (index, genotype)
                for index, genotype in remaining
                if _compute_success_rate(tried, index) >= validation.continue_share
            ]
        return tried

    def _find_champion(self) -> Champion | None:
        return find_champion(self._config, self._record, self._search.controller.parameters)

    def _is_solved(self) -> bool:
        return is_solved(self._config, self._find_champion())

    def _mismatch(self, generation: int) -> RunError:
        return RunError(
            f"generation {generation} of {self._config.folder or 'this run'} does not replay as recorded: "
            "the record was changed, or NumPy, cma or the processor differ from those it began with "
            "(config.json); resume it where it began, or start again in another folder"
        )


def _compute_success_rate(entries: Sequence[Entry], index: int) -> float:
    flags = [succeeded for entry in entries if entry.index == index for succeeded in entry.outcome.succeeded]
    return sum(flags) / len(flags)
