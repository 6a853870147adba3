"""Confirmation of the champion of a search for bodies: the fittest bodies are tried again, more often.

An exam of few trials selects the luckiest of many bodies. So the fittest ones are tried on the same arena under
conditions that no body has met, round by round, and drop out once they fail too often, as candidates do in `evolve`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evolution.backends.making import Backend, make_backend
from evolution.backends.outcome import check_tried
from evolution.backends.simulation import Simulate
from evolution.backends.trials import Job
from evolution.body_search.config import BodyEvolutionConfig
from evolution.body_search.learning import Lesson
from evolution.body_search.run import BodyRun
from evolution.errors import RunError
from evolution.search.validation import Champion, Validation, expect_success
from reconstruction.range_checks import as_integers

CONFIRMATION = 3
"""A kind of trials with conditions that are neither those of learning nor those of an exam."""
_MOST = 1000


class Confirmation(NamedTuple):
    """A champion that has been tried again.

    Attributes:
        champion: the body and its controller, with the successes of these trials.
        lesson: what it had learned.
        seconds: simulated for all candidates [s].
    """

    champion: Champion
    lesson: Lesson
    seconds: float


def confirm(
    run: BodyRun,
    candidates: int = 4,
    validation: Validation | None = None,
    simulate: Simulate | None = None,
) -> Confirmation:
    """Try the fittest bodies of a search again, on its arena, and return the most reliable one.

    Args:
        run: a search for bodies.
        candidates: largest number of bodies, each with the fittest genotype that it learned.
        validation: rounds of trials, the share of successes needed to go on, and where trials start unless the task or
            the run has a place of its own; None for the defaults.
        simulate: the function that tries jobs; None means physics.

    Returns:
        The candidate of the highest expected success rate; of equal ones the fittest.

    Raises:
        RunError: no body has learned yet, or there is no candidate.
    """
    (candidates,) = as_integers("candidates", [candidates], 1, _MOST, RunError)
    chosen = find_candidates(run.record.lessons, candidates)
    if not chosen:
        raise RunError("no body has learned yet; resume the run")
    backend = make_backend("batch", run.config.execution.workers, None, simulate)
    try:
        tried = [_try_again(run.config, backend, each, validation or Validation()) for each in chosen]
    finally:
        backend.close()
    rates = [expect_success(successes, trials) for successes, trials, _ in tried]
    best = int(np.argmax(rates))
    successes, trials, _ = tried[best]
    champion = replace(run.make_champion(chosen[best]), successes=successes, trials=trials)
    return Confirmation(champion, chosen[best], sum(seconds for *_, seconds in tried))


def find_candidates(lessons: Sequence[Lesson], count: int) -> list[Lesson]:
    """Return the fittest lesson of each of the fittest bodies, among lessons with an exam if there are such."""
    examined = [lesson for lesson in lessons if lesson.trials] or list(lessons)
    order = sorted(examined, key=lambda each: (-each.fitness, -each.rung, each.pupil.key))
    fittest: dict[str, Lesson] = {}
    for lesson in order:
        fittest.setdefault(lesson.pupil.body.canonical_text, lesson)
    return list(fittest.values())[:count]


def _try_again(
    config: BodyEvolutionConfig, backend: Backend, lesson: Lesson, validation: Validation
) -> tuple[int, int, float]:
    """Return successes, trials and simulated time of a candidate."""
    successes, trials, seconds = 0, 0, 0.0
    for number, count in enumerate(validation.rounds):
        if trials and successes < validation.continue_share * trials:
            break
        conditions = config.make_trials(lesson.pupil.body, count, (CONFIRMATION, number))
        start = conditions.episode.find_start()
        if isinstance(start, str):  # as in the final test: close before a gap is easier
            conditions = replace(conditions, episode=replace(conditions.episode, start=validation.start))
        outcomes = backend.run([Job(np.array(lesson.genotype), conditions)])
        check_tried(outcomes)
        successes, trials = successes + outcomes[0].successes, trials + count
        seconds += outcomes[0].seconds
    return successes, trials, seconds
