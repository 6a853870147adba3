"""Ranges of the fields of a run's configuration: outside of them nothing sensible comes out, or no machine holds it."""

from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any

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


def settle_counts(config: object, limits: Limits) -> None:
    """Make fields of a frozen dataclass integers of Python's own, which JSON can hold.

    Raises:
        RunError: a field is no whole number, or out of range; with field, value and range.
    """
    for name, (low, high) in limits.items():
        object.__setattr__(config, name, as_counts(name, [getattr(config, name)], low, high)[0])


def settle_numbers(config: object, limits: Limits) -> None:
    """Make fields of a frozen dataclass floats: a config is the same, and has one digest, once it was in a file.

    Raises:
        RunError: a field is no finite number, or out of range; with field, value and range.
    """
    for name, (low, high) in limits.items():
        object.__setattr__(config, name, as_floats(name, [getattr(config, name)], low, high)[0])


def as_counts(name: str, values: Iterable[Any], low: float, high: float) -> tuple[int, ...]:
    """Return the values of a field as integers; refuse those that are no whole numbers, or out of range.

    Raises:
        RunError: with field, value and range.
    """
    found = tuple(values)
    for value in found:
        if not (_is_number(value, Integral) and low <= value <= high):
            raise RunError(f"{name} is {value!r}; a whole number from {low:g} to {high:.15g} is needed")
    return tuple(map(int, found))


def as_floats(name: str, values: Iterable[Any], low: float, high: float) -> tuple[float, ...]:
    """Return the values of a field as floats; refuse those that are not finite, or out of range.

    Raises:
        RunError: with field, value and range.
    """
    found = tuple(values)
    for value in found:
        if not (_is_number(value, Real) and low <= value <= high):
            raise RunError(f"{name} is {value!r}; a number from {low:g} to {high:g} is needed")
    return tuple(map(float, found))


def _is_number(value: Any, kind: type) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)
