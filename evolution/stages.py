"""Stages: coarse models early, for speed; fine ones late, for truth (paper, section I)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from evolution.errors import RunError

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
        if self.generations is not None and self.generations < 1:
            raise RunError(f"a stage of {self.generations} generations; at least 1, or None for no limit")
        if self.patience < 1 or not 0 < self.success_share <= 1:
            raise RunError(
                f"patience {self.patience} must be >= 1, success_share {self.success_share} in (0, 1]"
            )
        if self.trials is not None and self.trials < 1:
            raise RunError(f"a stage of {self.trials} trials a genotype; at least 1, or None for the run's")
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
