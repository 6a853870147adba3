"""Confirmation of the champion of a search for bodies: the fittest bodies are tried again, more often.

An exam of few trials selects the luckiest of many bodies. So the fittest ones are tried on the same arena under
conditions that no body has met, round by round, and drop out once they fail too often, as candidates do in `evolve`.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np

from evolution._src.backends.body_rollout import simulate_bodies
from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.outcome import check_tried
from evolution._src.backends.simulation import Simulate
from evolution._src.backends.trials import Job, Trials
from evolution._src.body_search.config import BodyEvolutionConfig
from evolution._src.body_search.fresh_trials import FreshTrials, find_candidates
from evolution._src.body_search.learning import LevelResult
from evolution._src.body_search.run import (
    BodyRun,
    Confirmation,
    read_folder,
    read_fresh_trials,
    write_champion,
    write_fresh_trials,
)
from evolution._src.errors import RunError
from evolution._src.search.run import RunFolder
from evolution._src.search.validation import Validation
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import as_integers

CONFIRMATION = 3
"""A kind of trials with conditions that are neither those of learning nor those of an exam."""
CANDIDATES = 8
"""Bodies that are tried again unless another number is given."""
_MOST = 1000


def confirm(
    run: BodyRun,
    candidates: int = CANDIDATES,
    validation: Validation | None = None,
    simulate: Simulate | None = None,
    progress: Progress = silent,
) -> Confirmation:
    """Try the fittest bodies of a search again, on its arena, and return the most reliable one.

    Of a run with a folder, the trials are stored there, `champion.json` becomes the confirmed champion, and what is
    stored already is not tried again: neither after an interruption nor for bodies that were candidates before.

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
    fresh = FreshTrials(candidates, validation or Validation())
    with nullcontext() if run.folder is None else RunFolder(run.folder).lock():
        if run.folder is not None:
            fresh = _take_stored(run, fresh)
        found = replace(run, fresh=_try_again(run, fresh.begin(run.record.results), simulate, progress))
        write_champion(found)
    confirmation = found.confirmation
    assert confirmation is not None
    return confirmation


def _take_stored(run: BodyRun, fresh: FreshTrials) -> FreshTrials:
    """Return fresh trials with those that the folder of a run knows, if they follow the same rules."""
    assert run.folder is not None
    if read_folder(run.folder)[1].num_results != run.record.num_results:
        raise RunError(f"{run.folder} has changed since it was read; read it again by ev.load_bodies")
    known = read_fresh_trials(run.folder, run.config)
    return replace(fresh, tried=known.tried) if known and known.has_rules(fresh.rules) else fresh


def _try_again(
    run: BodyRun, fresh: FreshTrials, simulate: Simulate | None, progress: Progress
) -> FreshTrials:
    """Return the complete fresh trials of candidates, of which some may be known."""
    if fresh.is_complete:
        write_fresh_trials(run.folder, run.config, fresh)
        return fresh
    config = run.config
    backend = make_backend(config.backend, config.workers, config.address, simulate or simulate_bodies)
    try:
        for number in range(len(fresh.rules.rounds)):
            due = fresh.find_due(number)
            for begin in range(0, len(due), config.workers):
                _show(progress, fresh, number, len(due))
                fresh = _try_round(run, backend, fresh, number, due[begin : begin + config.workers])
                write_fresh_trials(run.folder, run.config, fresh)
    finally:
        backend.close()
    return fresh


def _show(progress: Progress, fresh: FreshTrials, number: int, left: int) -> None:
    done = sum(fresh.count_trials(each) for each in fresh.tried)
    text = f"round {number + 1} of {len(fresh.rules.rounds)}, candidates left: {left}"
    progress(text, done / (len(fresh.tried) * fresh.rules.trials))


def _try_round(
    run: BodyRun, backend: Backend, fresh: FreshTrials, number: int, indices: list[int]
) -> FreshTrials:
    """Return fresh trials with a round of some candidates."""
    results = find_candidates(run.record.results, fresh.count)
    jobs = [_make_job(run.config, results[index], number, fresh.rules) for index in indices]
    outcomes = backend.run(jobs)
    if not any(each.successes for each in fresh.tried):  # later on, a body may be to blame
        check_tried(outcomes)
    for index, outcome in zip(indices, outcomes, strict=True):
        fresh = fresh.add_round(index, outcome.successes, outcome.seconds)
    return fresh


def _make_job(config: BodyEvolutionConfig, result: LevelResult, number: int, rules: Validation) -> Job:
    """Return a round of fresh trials of a result."""
    trials: Trials = config.make_trials(result.body, rules.rounds[number], (CONFIRMATION, number))
    if isinstance(trials.find_start(), str):  # as in the final test: close before a gap is easier
        trials = replace(trials, start=rules.start)
    return Job(np.array(result.genotype), trials)
