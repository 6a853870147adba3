"""Stages: coarse models early, for speed; fine ones late, for truth (paper, section I)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from evolution.errors import RunError
from evolution.limits import MOST_GENERATIONS, MOST_TRIALS, SMALLEST_STEP, settle_counts, settle_numbers

Promotion = Literal["success", "stagnation", "either", "budget"]
PROMOTIONS = ("success", "stagnation", "either", "budget")


@dataclass(frozen=True)
class Stage:
    """A part of a run, in one arena. The last stage lasts until the run ends.

    Attributes:
        arena: name or folder.
        generations: at most so many; None means no limit.
        promotion: what ends the stage early: "success" (enough genotypes hold), "stagnation" (the best
            no longer improves), "either", or "budget" (nothing).
        success_share: share of a generation's genotypes that must hold in all their trials.
        patience: generations without improvement that count as stagnation.
        trials: of each genotype in this stage; None means as many as the run says. One is enough to tell in a
            coarse model where to search.
    """

    arena: str
    generations: int | None = None
    promotion: Promotion = "either"
    success_share: float = 0.25
    patience: int = 10
    trials: int | None = None

    def __post_init__(self) -> None:
        if self.promotion not in PROMOTIONS:
            raise RunError(f"there is no promotion {self.promotion!r}; there are {', '.join(PROMOTIONS)}")
        optional = {"generations": (1, MOST_GENERATIONS), "trials": (1, MOST_TRIALS)}
        settle_counts(
            self, {name: limits for name, limits in optional.items() if getattr(self, name) is not None}
        )
        settle_counts(self, {"patience": (1, MOST_GENERATIONS)})
        settle_numbers(self, {"success_share": (SMALLEST_STEP, 1.0)})
        if self.generations is None and self.promotion == "budget":
            raise RunError("a stage promoted by budget needs a number of generations")

    def is_done(self, history: np.ndarray) -> bool:
        """Tell whether the stage ends after these generations of its own (rows of a run's history)."""
        if not len(history):
            return False
        if self.generations is not None and len(history) >= self.generations:
            return True
        last = history[-1]
        holds = last["successes"] >= self.success_share * last["population_size"]
        stagnates = len(history) > self.patience and (
            history["best"][-self.patience :].max() <= history["best"][: -self.patience].max()
        )
        return bool(
            (holds and self.promotion in ("success", "either"))
            or (stagnates and self.promotion in ("stagnation", "either"))
        )
