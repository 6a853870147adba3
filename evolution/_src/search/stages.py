"""Stages of a run: coarse arenas first, for speed; fine ones later, for accuracy (paper, section I)."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from jaxtyping import Shaped

from evolution._src.errors import RunError
from evolution._src.limits import MAX_GENERATIONS, MAX_TRIALS, MIN_POSITIVE
from reconstruction._src.base.range_checks import check_choice, coerce_floats, coerce_integers

Promotion = Literal["success", "stagnation", "either", "budget"]
PROMOTIONS: tuple[Promotion, ...] = get_args(Promotion)


@dataclass(frozen=True)
class Stage:
    """A part of a run, in one arena. The last stage lasts until the run ends.

    Attributes:
        arena: name or folder.
        generations: largest number; None means no limit.
        promotion: condition that ends the stage early: "success" (enough genotypes succeed), "stagnation" (the best
            no longer improves), "either", or "budget" (nothing).
        success_share: share of a generation's genotypes that must succeed in all their trials.
        patience: generations without improvement that count as stagnation.
        trials: number of trials of each genotype in this stage; None means as many as in the run. One is enough in a
            coarse arena, which only shows where to search.
    """

    arena: str
    generations: int | None = None
    promotion: Promotion = "either"
    success_share: float = 0.25
    patience: int = 10
    trials: int | None = None

    def __post_init__(self) -> None:
        if isinstance(self.arena, PathLike):
            object.__setattr__(self, "arena", str(Path(self.arena)))
        check_choice("promotion", self.promotion, PROMOTIONS, RunError)
        optional = {"generations": (1, MAX_GENERATIONS), "trials": (1, MAX_TRIALS)}
        coerce_integers(
            self,
            {name: limits for name, limits in optional.items() if getattr(self, name) is not None},
            RunError,
        )
        coerce_integers(self, {"patience": (1, MAX_GENERATIONS)}, RunError)
        coerce_floats(self, {"success_share": (MIN_POSITIVE, 1.0)}, RunError)
        if self.generations is None and self.promotion == "budget":
            raise RunError("a stage promoted by budget needs a number of generations")

    def is_done(self, history: Shaped[np.ndarray, " generations"]) -> bool:
        """Return whether the stage ends after these generations of its own (rows of a run's history)."""
        if not len(history):
            return False
        if self.generations is not None and len(history) >= self.generations:
            return True
        last = history[-1]
        succeeds = last["successes"] >= self.success_share * last["population_size"]
        stagnates = len(history) > self.patience and (
            history["best"][-self.patience :].max() <= history["best"][: -self.patience].max()
        )
        return bool(
            (succeeds and self.promotion in ("success", "either"))
            or (stagnates and self.promotion in ("stagnation", "either"))
        )
