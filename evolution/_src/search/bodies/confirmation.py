"""Confirmation of the champion of a search for bodies: the fittest bodies are tried again, more often.

An exam of few trials selects the luckiest of many bodies. So the fittest ones are tried on the same arena under
conditions that no body has met, round by round, and drop out once they fail too often, as candidates do in `evolve`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace

import numpy as np

from evolution._src.backends.body_rollout import simulate_bodies
from evolution._src.backends.cluster import make_backend
from evolution._src.backends.outcome import check_tried
from evolution._src.backends.simulation import Simulate
from evolution._src.backends.trials import Job
from evolution._src.errors import RunError
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.learning import LevelResult
from evolution._src.search.bodies.run import BodyRun, Confirmation, read_folder, write_champion
from evolution._src.search.run import RunFolder
from evolution._src.search.validation import Validation, expect_success
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import as_integers

CONFIRMATION = 3  # A kind of trials with conditions that are neither those of learning nor those of an exam
CANDIDATES = 8  # Bodies that are tried again unless another number is given
_MOST = 1000


def confirm(
    run: BodyRun,
    candidates: int = CANDIDATES,
    validation: Validation | None = None,
    simulate: Simulate | None = None,
    progress: Progress = silent,
) -> Confirmation:
    """Try the fittest bodies of a search again, on its arena, and return the most reliable one.

    Of a run with a folder, the confirmed champion is stored there when all trials are done.

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
    (candidates,) = as_integers("candidates", [candidates], 1, _MOST, RunError)
    if not run.record.results:
        raise RunError("no body has learned yet; resume the run")
    with nullcontext() if run.folder is None else RunFolder(run.folder).lock():
        if run.folder is not None and read_folder(run.folder)[1].num_results != run.record.num_results:
            raise RunError(f"{run.folder} has changed since it was read; read it again by ev.load_bodies")
        found = _try_again(run, candidates, validation or Validation(), simulate, progress)
        write_champion(replace(run, confirmation=found))
    return found


def _try_again(
    run: BodyRun, count: int, rules: Validation, simulate: Simulate | None, progress: Progress
) -> Confirmation:
    """Return the most reliable of the candidates."""
    config, candidates = run.config, find_candidates(run.record.results, count)
    backend = make_backend(config.backend, config.workers, config.address, simulate or simulate_bodies)
    successes, trials, seconds = np.zeros(len(candidates), int), np.zeros(len(candidates), int), 0.0
    try:
        for number, size in enumerate(rules.rounds):
            due = np.flatnonzero(successes >= rules.continue_share * trials)
            if not len(due):
                break
            progress(
                f"round {number + 1} of {len(rules.rounds)}, candidates left: {len(due)}",
                number / len(rules.rounds),
            )
            outcomes = backend.run([_make_job(config, candidates[index], number, rules) for index in due])
            if number == 0:  # later on, a body may be to blame
                check_tried(outcomes)
            successes[due] += [outcome.successes for outcome in outcomes]
            trials[due] += size
            seconds += sum(outcome.seconds for outcome in outcomes)
    finally:
        backend.close()
    best = int(np.argmax([expect_success(*each) for each in zip(successes, trials, strict=True)]))
    champion = replace(
        run.make_champion(candidates[best]), successes=int(successes[best]), trials=int(trials[best])
    )
    return Confirmation(champion, candidates[best], seconds)


def find_candidates(results: Sequence[LevelResult], count: int) -> list[LevelResult]:
    """Return the fittest result of each of the fittest bodies, among results with an exam if there are such."""
    examined = [result for result in results if result.trials] or list(results)
    order = sorted(examined, key=lambda each: (-each.fitness, -each.level, each.body.canonical_text))
    fittest: dict[str, LevelResult] = {}
    for result in order:
        fittest.setdefault(result.body.canonical_text, result)
    return list(fittest.values())[:count]


def _make_job(config: BodyEvolutionConfig, result: LevelResult, number: int, rules: Validation) -> Job:
    """Return a round of fresh trials of a result."""
    trials = config.make_trials(result.body, rules.rounds[number], (CONFIRMATION, number))
    if isinstance(trials.find_start(), str):  # as in the final test: close before a gap is easier
        trials = replace(trials, start=rules.start)
    return Job(np.array(result.genotype), trials)
