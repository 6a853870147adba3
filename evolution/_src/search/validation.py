"""Selection of the champion: by new randomized trials, never by the luckiest sample.

The best of many samples of few trials each is mostly luck, and a search overfits to trials that are repeated. So the
fittest genotype of a generation that succeeded in all its trials becomes a candidate, and so does the mean of the
search distribution, which was not selected by its luck. Each is tried under conditions that no genotype has met
before, round by round, and drops out once it fails too often.

References:
    pycma, `CMAEvolutionStrategy.result.xfavorite`: the mean of the distribution is its best estimate of the
    optimum, not the best genotype drawn.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Float

from evolution._src.backends.scoring import Outcome
from evolution._src.backends.settings import BodyConfig, EpisodeConfig
from evolution._src.controllers.finding import refer_to_controller
from evolution._src.errors import RunError
from evolution._src.references import MAX_GENERATIONS, MAX_GENOTYPES, MAX_MAGNITUDE, MAX_TRIALS, MIN_POSITIVE
from evolution._src.search.record import SAMPLE, VALIDATION, Attempt, Entry, Try
from reconstruction._src.base.range_checks import (
    as_floats,
    as_integers,
    check_choice,
    check_count,
    coerce_floats,
    coerce_integers,
)
from symbrion_gym._src.environment.config import STARTS

MAX_ROUNDS = 100  # Largest number of rounds of validation trials of a candidate
_NEEDED = ("genotype", "names", "controller", "modules", "arena", "generation", "fitness")
"""Fields without which `champion.json` is none."""


@dataclass(frozen=True)
class Validation:
    """Rules by which candidates for the champion are validated.

    Attributes:
        candidates: largest number of genotypes of a generation that become candidates, those of highest fitness.
        mean_share: share of a generation's genotypes that must succeed for the mean of the search distribution to be
            a candidate, too; above 1 it never is.
        rounds: number of fresh trials in each round.
        continue_share: share of successes so far that is needed for the next round.
        solved_share: share of successes after all rounds that ends the run; of the champions confirmed with 0.95 one
            succeeded in only 17 of 20 trials in the true arena.
        start: start of the fresh trials; "floor" as in the final test, because a champion that succeeds from close
            before the pit may fail from there.
    """

    candidates: int = 1
    mean_share: float = 0.25
    rounds: tuple[int, ...] = (8, 8, 16, 16)
    continue_share: float = 0.9
    solved_share: float = 0.97
    start: str = "floor"

    @property
    def trials(self) -> int:
        """Number of trials of a candidate that passes all rounds."""
        return sum(self.rounds)

    def is_solved(self, successes: int, trials: int) -> bool:
        """Return whether a champion with these validation trials ends the run."""
        return trials >= self.trials and successes >= self.solved_share * trials

    def __post_init__(self) -> None:
        coerce_integers(self, {"candidates": (0, MAX_GENOTYPES)}, RunError)
        object.__setattr__(self, "rounds", as_integers("rounds", self.rounds, 1, MAX_TRIALS, RunError))
        check_count("rounds", self.rounds, MAX_ROUNDS, RunError)
        shares = ("continue_share", "solved_share")
        coerce_floats(
            self, dict.fromkeys(shares, (0.0, 1.0)) | {"mean_share": (MIN_POSITIVE, MAX_MAGNITUDE)}, RunError
        )
        check_choice("start", self.start, STARTS, RunError)

    def try_again(
        self, candidates: Sequence[int], attempt: Callable[[int, int], Attempt], tries: Try
    ) -> list[Entry]:
        """Try candidates round by round, while enough of all their trials succeed; `attempt` makes each of these."""
        tried: list[Entry] = []
        remaining = list(candidates)
        for block in range(len(self.rounds)):
            if not remaining:
                break
            tried += tries([attempt(index, block) for index in remaining])
            pooled = {entry.index: entry.outcome for entry in pool_trials(tried)}
            remaining = [
                index
                for index in remaining
                if pooled[index].successes >= self.continue_share * pooled[index].trials
            ]
        return tried

    def select_candidates(self, fitness: Float[np.ndarray, " P"], outcomes: Sequence[Outcome]) -> list[int]:
        """Return the indices of the candidates of a generation; `len(outcomes)` stands for the mean."""
        order = sorted(range(len(outcomes)), key=lambda index: (-fitness[index], index))
        successful = [index for index in order if all(outcomes[index].succeeded)]
        mean = [len(outcomes)] if len(successful) >= self.mean_share * len(outcomes) else []
        return mean + successful[: self.candidates]


@dataclass(frozen=True, kw_only=True)
class Champion(EpisodeConfig, BodyConfig):
    """The result of a run: its best validated genotype, the body that it moves and what is to be done.

    Attributes:
        genotype: values of the genes of the controller.
        names: names of the genes.
        generation: generation in which it was sampled.
        fitness: fitness in that generation, from few trials.
        successes: number of its validation trials that succeeded.
        trials: number of its validation trials; 0 if no genotype became a candidate.

    Raises:
        RunError: a field is out of range, or there are not as many names as genes.
    """

    genotype: tuple[float, ...]
    names: tuple[str, ...]
    generation: int = 0
    fitness: float = 0.0
    successes: int = 0
    trials: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_body()
        genotype = as_floats("genotype", self.genotype, -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
        self._set("genotype", genotype)
        if len(self.genotype) != len(self.names):
            raise RunError(
                f"genotype has {len(self.genotype)} genes, names {len(self.names)}; one each is needed"
            )
        if isinstance(self.controller, str | dict):
            self._set("controller", refer_to_controller(self.controller, self.find_organism()))
        trials = MAX_TRIALS * MAX_ROUNDS
        counts = {"generation": (0, MAX_GENERATIONS), "trials": (0, trials), "successes": (0, self.trials)}
        coerce_integers(self, counts, RunError)
        coerce_floats(self, {"fitness": (-MAX_MAGNITUDE, MAX_MAGNITUDE)}, RunError)

    @classmethod
    def from_json(cls, content: object, where: str = "") -> Self:
        """Return the champion that `to_json` described, the content of `champion.json`; this imports nothing.

        Raises:
            RunError: a field is missing, unknown or of the wrong kind.
        """
        missing = [name for name in _NEEDED if isinstance(content, dict) and name not in content]
        if missing:
            raise RunError(f"it lacks the field {missing[0]!r}")
        return super().from_json(content, where)


def expect_success(outcome: Outcome) -> float:
    """Return the expected success rate after some trials (Laplace's rule of succession)."""
    return (outcome.successes + 1) / (outcome.trials + 2)


def pool_trials(entries: Iterable[Entry]) -> list[Entry]:
    """Return one entry for each candidate, with all its trials."""
    pooled: dict[tuple[int, int], Entry] = {}
    for entry in entries:
        key = (entry.generation, entry.index)
        pooled[key] = _pool(pooled[key], entry) if key in pooled else entry
    return list(pooled.values())


def _pool(first: Entry, second: Entry) -> Entry:
    one, two = first.outcome, second.outcome
    share = one.trials / max(one.trials + two.trials, 1)
    outcome = Outcome(
        progress=share * one.progress + (1 - share) * two.progress,
        effort=share * one.effort + (1 - share) * two.effort,
        succeeded=one.succeeded + two.succeeded,
        seconds=one.seconds + two.seconds,
        diverged=one.diverged + two.diverged,
        descriptors=one.descriptors + two.descriptors,
    )
    return first._replace(outcome=outcome)


def select_champion(entries: Iterable[Entry]) -> Entry | None:
    """Return the entry of the champion, the later of equal ones; None before the first generation."""
    entries = list(entries)
    candidates = pool_trials(entry for entry in entries if entry.kind == VALIDATION)
    if candidates:
        return max(candidates, key=lambda entry: (expect_success(entry.outcome), entry.generation))
    samples = (entry for entry in entries if entry.kind == SAMPLE)
    return max(samples, key=lambda entry: entry.fitness, default=None)
