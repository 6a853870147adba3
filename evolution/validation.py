"""Choosing the champion: by fresh randomised trials, never by the luckiest sample.

The best of many samples of few trials each is mostly luck, and trials used again and again are learned
by heart. So the fittest genotype of a generation that held in all its trials becomes a candidate, and so does
the centre of the search, which was not drawn and owes nothing to luck. Each is tried under conditions that no
genotype has met before, round by round, and drops out once it fails too often.

References:
    pycma, `CMAEvolutionStrategy.result.xfavorite`: the mean of the distribution is its best estimate of the
    optimum, not the best genotype drawn.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from evolution.errors import RunError
from evolution.record import SAMPLE, VALIDATION, Entry, Record
from evolution.trials import Outcome

HOLDS = 0.93
"""Expected success rate from which a body is long enough: a shorter one is preferred to a surer one."""


@dataclass(frozen=True)
class Validation:
    """How candidates are tried.

    Attributes:
        candidates: at most so many genotypes of a generation, those of highest fitness.
        centre: share of a generation's genotypes that must hold for the centre of the search to be a candidate,
            too; above 1 it never is.
        rounds: number of fresh trials in each round.
        go_on: share of successes so far that earns the next round.
        solved: share of successes after all rounds that ends the run; of champions confirmed with 0.95 one held in
            17 of 20 trials in the true arena only.
        start: where the fresh trials begin; from the floor, as the final judgement, because a champion that
            holds from close before the pit need not hold from there.
    """

    candidates: int = 1
    centre: float = 0.25
    rounds: tuple[int, ...] = (8, 8, 16, 16)
    go_on: float = 0.9
    solved: float = 0.97
    start: str = "floor"

    @property
    def trials(self) -> int:
        """Fresh trials of a candidate that passes all rounds."""
        return sum(self.rounds)

    def is_solved(self, successes: int, trials: int) -> bool:
        """Tell whether a champion with these fresh trials ends the run."""
        return trials >= self.trials and successes >= self.solved * trials

    def __post_init__(self) -> None:
        if self.candidates < 0 or not self.rounds or min(self.rounds) < 1:
            raise RunError(
                f"candidates is {self.candidates} and rounds {self.rounds}; at least 0, and 1 each"
            )
        if not (0 <= self.go_on <= 1 and 0 <= self.solved <= 1):
            raise RunError(f"go_on is {self.go_on} and solved {self.solved}; both are shares, 0 to 1")
        if not self.centre > 0:
            raise RunError(f"centre is {self.centre}; a share above 0 is needed, above 1 for never")

    def choose(self, fitness: np.ndarray, outcomes: Sequence[Outcome]) -> list[int]:
        """Return the indices of the candidates of a generation; `len(outcomes)` stands for the centre."""
        order = sorted(range(len(outcomes)), key=lambda index: (-fitness[index], index))
        held = [index for index in order if all(outcomes[index].succeeded)]
        centre = [len(outcomes)] if len(held) >= self.centre * len(outcomes) else []
        return centre + held[: self.candidates]


@dataclass(frozen=True)
class Champion:
    """The genotype that a run stands for.

    Attributes:
        genotype: one number a gene.
        names: of the genes.
        controller: the law that reads them.
        modules: length of the body.
        arena: in which it was chosen.
        environment: further options of the environment there.
        generation: in which it was sampled.
        fitness: there, by few trials.
        successes: among its fresh trials.
        trials: number of fresh trials; 0 if no genotype earned any.
    """

    genotype: tuple[float, ...]
    names: tuple[str, ...]
    controller: str
    modules: int
    arena: str
    generation: int
    fitness: float
    successes: int = 0
    trials: int = 0
    environment: tuple[tuple[str, Any], ...] = ()

    @property
    def score(self) -> float:
        """Expected success rate after the fresh trials (rule of succession); 0 without any."""
        return (self.successes + 1) / (self.trials + 2) if self.trials else 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return what `champion.json` holds."""
        return asdict(self) | {"environment": dict(self.environment)}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> "Champion":
        """Return the champion that `as_dict` described.

        Raises:
            RunError: a field is missing, unknown or of the wrong kind.
        """
        try:
            champion = cls(**content)
            genotype = tuple(float(gene) for gene in champion.genotype)
            names = tuple(str(name) for name in champion.names)
            if len(names) != len(genotype) or not np.all(np.isfinite(genotype)):
                raise ValueError(f"{len(genotype)} genes for {len(names)} names, or one is not finite")
            options = tuple(sorted(dict(champion.environment).items()))
            return replace(champion, genotype=genotype, names=names, environment=options)
        except (TypeError, ValueError) as error:
            raise RunError(f"this is not a champion: {error}") from error


def select(record: Record, is_in_stage: Sequence[bool], shortest: bool = False) -> Entry | None:
    """Return the entry of the champion, None before the first generation.

    Args:
        record: of the run.
        is_in_stage: `[generation]`, which generations count.
        shortest: among those that hold, prefer the shortest body.

    Returns:
        A pooled VALIDATION entry of the candidate with the best fresh trials; of equal ones the later
        generation. Without validated candidates the SAMPLE entry of highest fitness.
    """
    counted = [entry for entry in record.entries if is_in_stage[entry.generation]]
    candidates = find_candidates(counted)
    if candidates:
        return max(candidates, key=lambda entry: _rank(entry, shortest))
    samples = [entry for entry in counted if entry.kind == SAMPLE]
    return max(samples, key=lambda entry: entry.fitness, default=None)


def find_candidates(entries: Iterable[Entry]) -> list[Entry]:
    """Return one entry for each candidate, with all its fresh trials."""
    pooled: dict[tuple[int, int], Entry] = {}
    for entry in entries:
        if entry.kind == VALIDATION:
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
    )
    return first._replace(outcome=outcome)


def _rank(entry: Entry, shortest: bool) -> tuple[float, ...]:
    rate = (entry.outcome.successes + 1) / (entry.outcome.trials + 2)
    if shortest:
        holds = rate >= HOLDS
        return (float(holds), -entry.modules if holds else 0.0, rate, entry.generation)
    return (rate, entry.generation)
