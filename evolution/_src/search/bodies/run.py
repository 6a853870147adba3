"""The state of a search for bodies, its champion, and what these mean in words."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import EpisodeConfig, take_fields
from evolution._src.search.bodies.algorithms import LevelResult
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.cmaes import Run
from evolution._src.search.record import Record
from evolution._src.search.validation import Champion, expect_success, pool_trials


class Confirmation(NamedTuple):
    """A champion that has been tried again."""

    champion: Champion  # the body and its controller, with the successes of these trials
    result: LevelResult  # what it had learned
    seconds: float  # simulated for all candidates [s]


@dataclass(frozen=True)
class BodyRun(Run):
    """The state of a search for bodies.

    Attributes:
        results: what each body knew at the end of each level, in the order of learning.
        confirmation: the champion by fresh trials; None where the fittest bodies have not been tried again.
    """

    config: BodyEvolutionConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    results: tuple[LevelResult, ...] = ()
    confirmation: Confirmation | None = None

    @property
    def best(self) -> LevelResult | None:
        """The result of the fittest body among those that have learned most; None before the first."""
        return max(self.results, key=lambda each: (each.level, each.fitness), default=None)

    @property
    def seconds(self) -> float:
        """Simulated time of all that was learned [s]."""
        return sum(result.seconds for result in self.results)

    def make_champion(self, result: LevelResult) -> Champion:
        """Return what a body has learned, as `judge` and `play` take it."""
        return Champion(
            genotype=result.genotype,
            names=result.names,
            fitness=result.fitness,
            successes=result.successes,
            trials=result.trials,
            organism=self.config.make_organism(result.body),
            **take_fields(self.config, EpisodeConfig),
        )

    def list_fittest(self) -> list[LevelResult]:
        """Return the results of the bodies that have learned most, the fittest first, each body once."""
        most = max((result.level for result in self.results), default=0)
        return list_once(
            sorted((each for each in self.results if each.level == most), key=lambda one: -one.fitness)
        )


def list_once(results: Sequence[LevelResult]) -> list[LevelResult]:
    """Return the first result of each body."""
    first: dict[str, LevelResult] = {}
    for result in results:
        first.setdefault(result.body.canonical_text, result)
    return list(first.values())


def list_candidates(results: Sequence[LevelResult]) -> list[LevelResult]:
    """Return the fittest result of each body, the fittest first, of results with an exam if there are such."""
    examined = [result for result in results if result.trials] or results
    return list_once(
        sorted(examined, key=lambda each: (-each.fitness, -each.level, each.body.canonical_text))
    )


def make_body_run(
    config: BodyEvolutionConfig, record: Record, results: tuple[LevelResult, ...], folder: Path | None
) -> BodyRun:
    """Return the state of a run with its champion.

    The champion is the confirmed one, with the successes of its fresh trials; before a confirmation the fittest, with
    those of its exam.
    """
    run = BodyRun(config, record, None, folder=folder, results=results)
    tried = pool_trials(record.confirmation)
    if tried and results:
        best = max(tried, key=lambda entry: expect_success(entry.outcome))
        result = list_candidates(results)[best.index]
        counts = {"successes": best.outcome.successes, "trials": best.outcome.trials}
        champion = replace(run.make_champion(result), **counts)
        seconds = sum(entry.outcome.seconds for entry in tried)
        return replace(run, champion=champion, confirmation=Confirmation(champion, result, seconds))
    return replace(run, champion=run.best and run.make_champion(run.best))


def describe_success(run: BodyRun) -> str:
    """Return in words how often the champion of a run succeeded, in which trials, and its fitness."""
    champion = run.champion
    assert champion is not None
    rate = f"{champion.successes} of {champion.trials}"
    fitness = f"{format_fitness(run, champion.fitness)} in its exam"
    if run.confirmation is None:
        return f"succeeded in {rate} trials of its exam, not confirmed by fresh trials; {fitness}"
    if champion.successes:
        return f"succeeded in {rate} fresh trials; {fitness}"
    return f"no success: {rate} fresh trials, and no other candidate did better; {fitness}"


def format_fitness(run: BodyRun, fitness: float) -> str:
    """Return a fitness in words, in meters where the weights that ship make it of progress in meters."""
    return f"fitness {fitness:.2f}{' m' if isinstance(run.config.scoring, Scoring) else ''}"
