"""Ranges of the fields of a run's configuration: outside of them nothing sensible comes out, or no machine holds it."""

import math
from collections.abc import Iterable, Mapping

from evolution.errors import RunError

Limits = Mapping[str, tuple[float, float]]
"""Field -> smallest and largest value."""

LARGEST_SEED = 2**32 - 1
"""What NumPy's `RandomState` takes."""
MOST_MODULES = 50
MOST_GENERATIONS = 10**9
MOST_GENOTYPES = 100_000
MOST_TRIALS = 10_000
MOST_WORKERS = 10_000
SMALLEST_STEP = 1e-9
"""Smallest of what must be above 0: step sizes, shares."""


def check_counts(config: object, limits: Limits) -> None:
    """Refuse fields that are no whole numbers, or out of range.

    Raises:
        RunError: with field, value and range.
    """
    for name, (low, high) in limits.items():
        value = getattr(config, name)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise RunError(f"{name} is {value!r}; a whole number from {low} to {high} is needed")


def check_numbers(config: object, limits: Limits) -> None:
    """Refuse fields that are no finite numbers, or out of range.

    Raises:
        RunError: with field, value and range.
    """
    for name, (low, high) in limits.items():
        check_values(name, [getattr(config, name)], low, high)


def check_values(name: str, values: Iterable[object], low: float, high: float) -> None:
    """Refuse values of a field that are no finite numbers, or out of range.

    Raises:
        RunError: with field, value and range.
    """
    for value in values:
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not (is_number and low <= value <= high):
            raise RunError(f"{name} is {value!r}; a number from {low:g} to {high:g} is needed")
