"""Fitness functions and other objects of a user: importable, so that a run can keep and restore them."""

from dataclasses import dataclass

from evolution._src.backends.scoring import Outcome, Scoring


def minus_effort(outcome: Outcome, body) -> float:
    """A body of many modules that works little."""
    return body.num_modules - outcome.effort


minus_effort.version = "1"


def progress_alone(outcome: Outcome, body) -> float:
    return outcome.progress


def one_argument(outcome: Outcome) -> float:
    return outcome.progress


def not_a_number(outcome: Outcome, body) -> float:
    return float("nan")


@dataclass(frozen=True)
class Squared(Scoring):
    """The square of the progress."""

    factor: float = 2.0

    def score(self, outcome: Outcome, modules: int) -> float:
        return self.factor * outcome.progress**2


class Remembering(Scoring):
    """A scoring with a state that no field holds."""

    def __init__(self, memory: float) -> None:
        super().__init__()
        object.__setattr__(self, "memory", memory)
