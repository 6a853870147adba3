"""The loop: a search proposes genotypes, or bodies with genotypes; they are tried, and everything is recorded.

A run resumes by replaying its recorded generations through the same code, with outcomes from the record instead of
physics; so what follows is bit-identical.
"""

import time
from collections.abc import Callable, Collection, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evolution._src.backends.cluster import LOCAL_BACKENDS, Backend, make_backend
from evolution._src.backends.pool import Simulate
from evolution._src.backends.rollout import simulate_bodies, warm_up
from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import BodyConfig, TrialConfig, take_fields
from evolution._src.backends.trials import Job, Trials, check_tried, prepare_arena
from evolution._src.controllers.finding import ControllerSource
from evolution._src.errors import RunError
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.genome import make_row
from evolution._src.search.bodies.learning import BodySearch
from evolution._src.search.bodies.run import BodyRun, Confirmation, list_candidates, make_body_run
from evolution._src.search.cmaes import ControllerSearch, Run, make_run
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import try_attempts
from evolution._src.search.record import (
    CONFIRMATION,
    HISTORY,
    SAMPLE,
    TIMES,
    VALIDATION,
    Attempt,
    Entry,
    Record,
)
from evolution._src.search.run import RunFolder, load_champion
from evolution._src.search.validation import Validation
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import as_integers, format_count

OnGeneration = Callable[[Any], None]
"""Called with the run so far after each generation; the last row of `run.history` has the latest numbers."""
CANDIDATES = 8  # Bodies that are tried again unless another number is given
_MOST_CANDIDATES = 1000


def evolve(
    config: EvolutionConfig | BodyEvolutionConfig,
    *,
    simulate: Simulate | None = None,
    on_generation: OnGeneration | None = None,
    progress: Progress = silent,
) -> Run:
    """Evolve controllers of one body, or bodies that each learn a controller, from the beginning.

    Args:
        config: an `EvolutionConfig` has one body; a `BodyEvolutionConfig` searches for it. `config.folder` must not
            contain a run yet.
        simulate: the function that tries jobs; None means physics.
        on_generation: called with the run so far after each generation, or iteration of a search for bodies.
        progress: called with the progress of the run.

    Raises:
        RunError: the folder contains a run, cannot be written or is being written by another run, or the environment
            cannot be made.
        ArenaError: there is no such arena, or it cannot be built.
    """
    if config.must_be_restorable:
        config.to_json()  # refuses what no file and no other process could restore, before anything is written
    if simulate is None and config.length:
        _prepare(config, progress)
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
        progress: called with the progress of what was left of the run.
        allow: modules of yours that the folder names and that may be imported; a folder runs no other code.
        changes: new values of `generations` (`iterations` of a search for bodies), `workers`, `backend`, `address` or
            `stop_when_solved`.

    Raises:
        RunError: there is no run, or it is damaged, contradicts its configuration, is longer, or is being written.
    """
    run_folder = RunFolder(folder)
    if not run_folder.has_run():
        raise RunError(f"{folder} contains no run; evolve begins one")
    with run_folder.lock():
        stored = run_folder.read_config()
        allowed = set(stored.RUNTIME) - {"folder"}
        if not set(changes) <= allowed:
            raise RunError(f"{sorted(set(changes) - allowed)} cannot change in a run; {sorted(allowed)} can")
        # A file does not choose whom to connect to.
        config = replace(stored, folder=str(folder), **{"address": None, **changes}).restore(allow)
        record = run_folder.read_record(config)
        if f"{config.STEP}s" in changes and config.length < record.num_generations:
            have = format_count(record.num_generations, config.STEP)
            raise RunError(f"{config.STEP}s is {config.length}, but the run has {have}; give that or more")
        if simulate is None and config.length > record.num_generations:
            _prepare(config, progress)
        if config != stored:
            run_folder.write_config(config)
        return _run(config, record, run_folder, simulate, on_generation, progress)


def load_run(folder: str | Path, allow: Collection[str] = ()) -> Run:
    """Read a run without continuing it; also while another process writes it.

    Unless allowed, nothing that a user wrote is imported: the record of a run with a controller of a user is read, but
    not replayed, and what its bodies have learned is not known then.

    Args:
        folder: folder of the run.
        allow: as of `resume`.

    Raises:
        RunError: there is no run, or it is damaged or contradicts its configuration.
    """
    run_folder = RunFolder(folder)
    config = run_folder.read_config()
    config = config.restore(allow) if allow else config
    record = run_folder.read_record(config)
    if not isinstance(config.controller, ControllerSource) or config.controller.is_allowed:
        loop = _Loop(config, record, None)
        loop.replay()
        return loop.make_run(run_folder.path)
    champion = load_champion(folder) if record.num_generations else None
    if isinstance(config, BodyEvolutionConfig):
        return replace(make_body_run(config, record, (), run_folder.path), champion=champion)
    return make_run(config, record, champion.names if champion else (), run_folder.path)


def confirm(
    run: BodyRun,
    candidates: int = CANDIDATES,
    validation: Validation | None = None,
    simulate: Simulate | None = None,
    progress: Progress = silent,
) -> Confirmation:
    """Try the fittest bodies of a search again, on its arena, and return the most reliable one.

    An exam of few trials selects the luckiest of many bodies. So the fittest ones are tried under conditions that no
    body has met, round by round, and drop out once they fail too often, as candidates do in `evolve`. Of a run with a
    folder, the confirmed champion is stored there when all trials are done.

    Args:
        run: a search for bodies.
        candidates: largest number of bodies, each with the fittest genotype that it learned.
        validation: rounds of trials, the share of successes needed to go on, and where trials start unless the task or
            the run has a place of its own; None for the defaults.
        simulate: the function that tries jobs; None means physics.
        progress: called with the round and the share done.

    Returns:
        The candidate of the highest expected success rate; of equal ones the fittest. Equal runs give equal results,
        with any number of workers.

    Raises:
        RunError: no body has learned yet, there is no candidate, or the folder is being written or has changed since
            the run was read.
    """
    (candidates,) = as_integers("candidates", [candidates], 1, _MOST_CANDIDATES, RunError)
    if not run.results:
        raise RunError("no body has learned yet, or its controller is not allowed; resume, or allow it")
    config, record, rules = run.config, run.record, validation or Validation()
    chosen = list_candidates(run.results)[:candidates]
    folder = None if run.folder is None else RunFolder(run.folder)

    def attempt(index: int, block: int) -> Attempt:
        """Return a round of fresh trials of a candidate, as in the final test: close before a gap is easier."""
        body, count = chosen[index].body, rules.rounds[block]
        trials = config.make_trials(body, count, (CONFIRMATION, block))
        if isinstance(trials.find_start(), str):
            trials = replace(trials, start=rules.start)
        return Attempt(CONFIRMATION, index, Job(np.array(chosen[index].genotype), trials), body.text)

    def tries(attempts: Sequence[Attempt]) -> list[Entry]:
        progress(f"candidates left: {len(attempts)}", len(blocks) / len(rules.rounds))
        blocks.append(len(attempts))
        # the fitness of these is not read: a scoring of a user's, which may not be imported, is not needed
        return try_attempts(attempts, backend, Scoring(), record.num_generations)

    blocks: list[int] = []
    with nullcontext() if folder is None else folder.lock():
        if folder and folder.read_record(config).num_generations != record.num_generations:
            raise RunError(f"{run.folder} has changed since it was read; read it again")
        backend = make_backend(config.backend, config.workers, config.address, simulate or simulate_bodies)
        try:
            tried = rules.try_again(range(len(chosen)), attempt, tries)
        finally:
            backend.close()
        searched = [entry for entry in record.entries if entry.generation < record.num_generations]
        confirmed = make_body_run(
            config, Record([*searched, *tried], record.history), run.results, run.folder
        )
        if folder:
            folder.write(confirmed)
    assert confirmed.confirmation is not None
    return confirmed.confirmation


def _prepare(config: EvolutionConfig | BodyEvolutionConfig, progress: Progress) -> None:
    """Build the arena of a run, with progress, and check body, start and goal by compiling the first environment."""
    if config.backend == "warp":
        require_extras("backend 'warp'", "gpu")
    prepare_arena(config.arena, progress)
    progress("compiling the environment", 0.0)
    if isinstance(config, BodyEvolutionConfig):
        warm_up(config.make_trials(make_row(config.bodies.smallest), 1, ()), 1, 1)
        return
    settings = take_fields(config, TrialConfig, BodyConfig)
    is_here, engine = config.backend in LOCAL_BACKENDS, "warp" if config.backend == "warp" else "mujoco"
    jobs, workers = (config.population_size, config.workers) if is_here else (1, 1)
    warm_up(Trials(**settings, count=config.trials), jobs, workers, engine)


def _run(
    config: EvolutionConfig | BodyEvolutionConfig,
    record: Record,
    folder: RunFolder | None,
    simulate: Simulate | None,
    on_generation: OnGeneration | None,
    progress: Progress,
) -> Any:
    if isinstance(config, BodyEvolutionConfig):
        simulate = simulate or simulate_bodies
    backend = make_backend(config.backend, config.workers, config.address, simulate)
    judge = make_backend("batch", config.workers, None, simulate) if config.backend == "warp" else backend
    try:
        loop = _Loop(config, record, backend, judge, progress)
        loop.replay()
        path = folder.path if folder else None
        run = loop.make_run(path)
        if folder and run.history.size:
            folder.write(run)
        while not loop.is_over(run) and loop.step():
            run = loop.make_run(path)
            if folder:
                folder.write(run)
            if on_generation:
                on_generation(run)
            loop.report()
        return run
    finally:
        backend.close()


class _Loop:
    """One run in progress; `judge` tries candidates for the champion, where `backend` is not exact."""

    def __init__(
        self,
        config: EvolutionConfig | BodyEvolutionConfig,
        past: Record,
        backend: Backend | None,
        judge: Backend | None = None,
        progress: Progress = silent,
    ) -> None:
        is_for_bodies = isinstance(config, BodyEvolutionConfig)
        self._search = BodySearch(config) if is_for_bodies else ControllerSearch(config)
        self._config, self._past, self._progress = config, past, progress
        self._backend, self._judge = backend, judge
        self._record = Record()
        self._entries: list[Entry] = []  # of the generation that is running
        self._replayed: list[Entry] | None = None
        self._wall_seconds = 0.0

    def replay(self) -> None:
        """Replay the recorded generations."""
        for entries, row in self._past.generations():
            self._replayed = list(entries)
            if not self.step():
                raise self._mismatch(int(row["generation"]))
            self._wall_seconds = float(row["wall_seconds"])
            replayed = self._record.history[-1]
            differs = any(replayed[name] != row[name] for name in HISTORY.names or () if name not in TIMES)
            if self._replayed or differs:
                raise self._mismatch(int(row["generation"]))
            self._record.set_in_last_row(wall_seconds=self._wall_seconds)
        self._replayed = None
        self._record.entries += self._past.confirmation

    def is_over(self, run: Run) -> bool:
        """Return whether the run has ended."""
        if self._record.num_generations >= self._config.length:
            return True
        return run.is_solved and getattr(self._config, "stop_when_solved", False)

    def step(self) -> bool:
        """Run one generation, unless the search has come to its end."""
        began, record = time.perf_counter(), self._record
        generation = record.num_generations
        self._entries = []
        row = self._search.step(generation, self._try)
        if not row:
            return False
        self._wall_seconds += time.perf_counter() - began
        before = record.history[-1] if generation else np.zeros(1, dtype=HISTORY)[0]
        samples = [entry.outcome for entry in self._entries if entry.kind == SAMPLE]
        common = {
            "generation": generation,
            "evaluations": int(before["evaluations"]) + len(samples),
            "wall_seconds": round(self._wall_seconds, 3),
            "successes": sum(all(outcome.succeeded) for outcome in samples),
            "trials": int(before["trials"]) + sum(entry.outcome.trials for entry in self._entries),
            "champion_successes": 0,
            "champion_trials": 0,
            "failures": sum(bool(outcome.error) for outcome in samples),
        }
        record.add_generation(self._entries, row | common)
        champion = self.make_run(None).champion
        if champion is not None:
            counts = champion.successes, champion.trials
            record.set_in_last_row(champion_successes=counts[0], champion_trials=counts[1])
        return True

    def make_run(self, folder: Path | None) -> Any:
        """Return the run so far."""
        return self._search.make_run(self._record, folder)

    def report(self, tried: int | None = None) -> None:
        """Report progress after a generation, or within one after a number of its trials; what is replayed was done."""
        done, length, due = self._record.num_generations, max(self._config.length, 1), self._search.due
        begun, left = done - self._past.num_generations, length - self._past.num_generations
        if tried is None:
            self._progress(f"{self._config.STEP} {done} of {length}", begun / left)
        elif due:
            text = f"{self._config.STEP} {done + 1} of {length}: {tried} of {due} trials"
            if done:
                text += f"; {self._record.history[-1]['successes']} succeeded in {self._config.STEP} {done}"
            self._progress(text, (begun + tried / due) / left)

    def _try(self, attempts: Sequence[Attempt]) -> list[Entry]:
        """Try genotypes, or take their outcomes from the record."""
        if self._replayed is not None:
            tried = self._take_recorded(attempts)
            self._entries += tried
            return tried
        backend = self._judge if attempts[0].kind == VALIDATION else self._backend
        assert backend is not None
        tried = try_attempts(attempts, backend, self._config.scoring, self._record.num_generations)
        if not (self._record.entries or self._entries):  # later on, the genotypes may be to blame
            check_tried([entry.outcome for entry in tried])
        self._entries += tried
        self.report(sum(entry.outcome.trials for entry in self._entries))
        return tried

    def _take_recorded(self, attempts: Sequence[Attempt]) -> list[Entry]:
        assert self._replayed is not None
        taken, self._replayed = self._replayed[: len(attempts)], self._replayed[len(attempts) :]
        if len(taken) < len(attempts) or any(
            (entry.kind, entry.index, entry.body) != (attempt.kind, attempt.index, attempt.body)
            or not np.array_equal(entry.genotype, attempt.job.genotype)
            for entry, attempt in zip(taken, attempts, strict=True)
        ):
            raise self._mismatch(self._record.num_generations)
        return taken

    def _mismatch(self, generation: int) -> RunError:
        return RunError(
            f"generation {generation} of {self._config.folder or 'this run'} does not replay as recorded: "
            "the record was changed, or NumPy, cma or the processor differ from those it began with "
            "(config.json); resume it where it began, or start again in another folder"
        )
