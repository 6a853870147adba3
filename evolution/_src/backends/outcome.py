"""The outcome of the trials of a genotype."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from evolution._src.errors import RunError

FAILED_PROGRESS = -1.0
"""Progress [m] of a trial that could not be finished: below any that a finished trial can have."""


@dataclass(frozen=True)
class Outcome:
    """The result of a genotype's trials.

    Attributes:
        progress: progress of the whole body, mean over trials [m].
        effort: mean over trials.
        succeeded: for each trial, whether the strict success check passed.
        seconds: simulated, summed over trials [s].
        diverged: number of trials whose physics diverged.
        error: why it could not be tried; empty if it could.
        descriptors: for each trial, what `TrialConfig.descriptors` kept of it: name -> numbers; empty without any.
    """

    progress: float
    effort: float
    succeeded: tuple[bool, ...]
    seconds: float = 0.0
    diverged: int = 0
    error: str = ""
    descriptors: tuple[dict[str, np.ndarray], ...] = field(default=(), compare=False)

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.succeeded)

    @property
    def successes(self) -> int:
        """Number of successful trials."""
        return sum(self.succeeded)


def check_tried(outcomes: Sequence[Outcome]) -> None:
    """Refuse outcomes of which every one is the same error: no genotype is to blame."""
    errors = {"" if outcome.diverged else outcome.error for outcome in outcomes}
    if len(errors) == 1 and "" not in errors:
        raise RunError(f"none of {len(outcomes)} genotypes could be tried: {errors.pop()}")
