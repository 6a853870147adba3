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
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from evolution.backends.trials import Outcome
from evolution.controllers.controller import CONTROLLERS
from evolution.errors import RunError
from evolution.limits import (
    MOST_GENERATIONS,
    MOST_GENOTYPES,
    MOST_MODULES,
    MOST_TRIALS,
    SMALLEST_STEP,
    as_counts,
    as_floats,
    settle_counts,
    settle_numbers,
)
from evolution.search.environment_options import Options, open_options, sort_options
from evolution.search.record import SAMPLE, VALIDATION, Entry, Record
from reconstruction.files.typed_json import JsonError, as_type
from symbrion_gym.environment.config import STARTS

HOLDS = 0.93
"""Expected success rate from which a body is long enough: a shorter one is preferred to a surer one."""
MOST_ROUNDS = 100
"""Of the fresh trials of a candidate."""
LARGEST_GENE = LARGEST_FITNESS = 1e9
"""Far beyond what any controller reads or any trial is worth."""


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
        settle_counts(self, {"candidates": (0, MOST_GENOTYPES)})
        object.__setattr__(self, "rounds", as_counts("rounds", self.rounds, 1, MOST_TRIALS))
        if not 1 <= len(self.rounds) <= MOST_ROUNDS:
            raise RunError(f"rounds has {len(self.rounds)} values; 1 to {MOST_ROUNDS} are possible")
        settle_numbers(self, {"go_on": (0.0, 1.0), "solved": (0.0, 1.0), "centre": (SMALLEST_STEP, 1e9)})
        if self.start not in STARTS:
            raise RunError(f"there is no start {self.start!r}; there are {', '.join(STARTS)}")

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

    Raises:
        RunError: a field is out of range, or there are not as many names as genes.
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
    environment: Options = ()

    def __post_init__(self) -> None:
        genotype = as_floats("genotype", self.genotype, -LARGEST_GENE, LARGEST_GENE)
        object.__setattr__(self, "genotype", genotype)
        if len(self.genotype) != len(self.names):
            raise RunError(
                f"genotype has {len(self.genotype)} genes, names {len(self.names)}; one each is needed"
            )
        if self.controller not in CONTROLLERS:
            raise RunError(f"there is no controller {self.controller!r}; there are {', '.join(CONTROLLERS)}")
        counts = {"modules": (1, MOST_MODULES), "generation": (0, MOST_GENERATIONS)}
        trials = MOST_TRIALS * MOST_ROUNDS
        settle_counts(self, counts | {"trials": (0, trials), "successes": (0, self.trials)})
        settle_numbers(self, {"fitness": (-LARGEST_FITNESS, LARGEST_FITNESS)})
        object.__setattr__(self, "environment", sort_options(self.environment))

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
            return as_type(open_options(content), cls)
        except JsonError as error:
            raise RunError(str(error)) from error


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
