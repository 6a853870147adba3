"""Ranges of the fields of a run's configuration: values outside are meaningless or too large for any machine."""

from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any

from evolution.errors import RunError

Limits = Mapping[str, tuple[float, float]]
"""Field -> smallest and largest value."""

MAX_SEED = 2**32 - 1
"""What NumPy's `RandomState` takes."""
MAX_MODULES = 50
"""As in the environment."""
MAX_GENERATIONS = 10**9
MAX_GENOTYPES = 100_000
MAX_TRIALS = 10_000
MAX_WORKERS = 10_000
MAX_MAGNITUDE = 1e9
"""Far beyond any useful gene, fitness or weight."""
MIN_POSITIVE = 1e-9
"""Smallest value of what must be above 0: step sizes, shares."""


def coerce_integers(config: object, limits: Limits) -> None:
    """Make fields of a frozen dataclass Python integers, which JSON can represent.

    Raises:
        RunError: a field is not an integer or out of range; with field, value and range.
    """
    for name, (low, high) in limits.items():
        object.__setattr__(config, name, as_integers(name, [getattr(config, name)], low, high)[0])


def coerce_floats(config: object, limits: Limits) -> None:
    """Make fields of a frozen dataclass floats: a config has the same digest before and after a file.

    Raises:
        RunError: a field is not a finite number or out of range; with field, value and range.
    """
    for name, (low, high) in limits.items():
        object.__setattr__(config, name, as_floats(name, [getattr(config, name)], low, high)[0])


def as_integers(name: str, values: Iterable[Any], low: float, high: float) -> tuple[int, ...]:
    """Return the values of a field as integers.

    Raises:
        RunError: one is not an integer or out of range; with field, value and range.
    """
    needed = f"a whole number from {low:g} to {high:.15g}"
    return tuple(int(_check(name, value, Integral, (low, high), needed)) for value in values)


def as_floats(name: str, values: Iterable[Any], low: float, high: float) -> tuple[float, ...]:
    """Return the values of a field as floats.

    Raises:
        RunError: one is not a finite number or out of range; with field, value and range.
    """
    needed = f"a number from {low:g} to {high:g}"
    return tuple(float(_check(name, value, Real, (low, high), needed)) for value in values)


def as_range(name: str, values: Iterable[Any], low: float, high: float) -> tuple[float, float]:
    """Return the lowest and highest value of a field as floats.

    Raises:
        RunError: there are not two, or one is not a finite number or out of range.
    """
    limits = as_floats(name, values, low, high)
    if len(limits) != 2:
        raise RunError(f"{name} is {limits}; a lowest and a highest value are needed")
    return limits


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse a value that is not among the choices of a field.

    Raises:
        RunError: with field, value and choices.
    """
    if value not in choices:
        raise RunError(f"there is no {name} {value!r}; there are {', '.join(choices)}")


def check_count(name: str, values: Sequence[object], high: int) -> None:
    """Refuse a field without values, or with too many.

    Raises:
        RunError: with field, number of values and limit.
    """
    if not 1 <= len(values) <= high:
        raise RunError(f"{name} has {len(values)} values; 1 to {high} are possible")


def _check(name: str, value: Any, kind: type, limits: tuple[float, float], needed: str) -> Any:
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    if not (is_number and limits[0] <= value <= limits[1]):
        raise RunError(f"{name} is {value!r}; {needed} is needed")
    return value
