"""Refuse numbers of configurations that are out of range, with the error of the caller's package and one wording."""

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from math import inf
from numbers import Integral, Real
from typing import Any

Limits = Mapping[str, tuple[float, float]]  # Field -> smallest and largest value


def check_positive(config: object, names: Iterable[str], error: type[Exception]) -> None:
    """Refuse fields that are not finite numbers above 0."""
    _check_signs(config, names, error, "above 0")


def check_not_negative(config: object, names: Iterable[str], error: type[Exception]) -> None:
    """Refuse fields that are not finite numbers of at least 0."""
    _check_signs(config, names, error, "at least 0")


def check_counts(config: object, names: Iterable[str], error: type[Exception]) -> None:
    """Refuse fields that are not whole numbers of at least 1."""
    for name in names:
        value, what = getattr(config, name), f"{type(config).__name__}.{name}"
        _check_kind(what, value, Integral, (1, inf), "a whole number of at least 1", error)


def coerce_integers(config: object, limits: Limits, error: type[Exception]) -> None:
    """Make fields of a frozen dataclass Python integers, which JSON can represent."""
    for name, (low, high) in limits.items():
        object.__setattr__(config, name, as_integers(name, [getattr(config, name)], low, high, error)[0])


def coerce_floats(config: object, limits: Limits, error: type[Exception]) -> None:
    """Make fields of a frozen dataclass floats: a config has the same digest before and after a file."""
    for name, (low, high) in limits.items():
        object.__setattr__(config, name, as_floats(name, [getattr(config, name)], low, high, error)[0])


def as_integers(
    name: str, values: Iterable[Any], low: float, high: float, error: type[Exception]
) -> tuple[int, ...]:
    """Return the values of a field as integers."""
    needed = f"a whole number from {low:g} to {high:.15g}"
    return tuple(int(_check_kind(name, value, Integral, (low, high), needed, error)) for value in values)


def as_floats(
    name: str, values: Iterable[Any], low: float, high: float, error: type[Exception]
) -> tuple[float, ...]:
    """Return the values of a field as floats."""
    needed = f"a number from {low:g} to {high:g}"
    return tuple(float(_check_kind(name, value, Real, (low, high), needed, error)) for value in values)


def as_range(
    name: str, values: Iterable[Any], low: float, high: float, error: type[Exception]
) -> tuple[float, float]:
    """Return the lowest and highest value of a field as floats."""
    limits = as_floats(name, values, low, high, error)
    if len(limits) != 2:
        raise error(f"{name} must be a lowest and a highest value, got {limits}")
    return limits


def check_choice(name: str, value: object, choices: Sequence[str], error: type[Exception]) -> None:
    """Refuse a value that is not among the choices of a field; the message lists those that are like it first."""
    if value not in choices:
        listed = dict.fromkeys([*get_close_matches(str(value), choices), *choices])
        raise error(f"{name}: there is no {value!r}; there are: {', '.join(listed)}")


def check_count(name: str, values: Sequence[object], high: int, error: type[Exception]) -> None:
    """Refuse a field without values, or with too many."""
    if not 1 <= len(values) <= high:
        raise error(f"{name} has {len(values)} values; 1 to {high} are possible")


def _check_signs(config: object, names: Iterable[str], error: type[Exception], allowed: str) -> None:
    for name in names:
        value, what = getattr(config, name), f"{type(config).__name__}.{name}"
        try:
            number = float("none" if isinstance(value, str) else value)
        except (TypeError, ValueError, OverflowError):
            raise error(f"{what} must be a number, got {value!r}") from None
        is_allowed = number > 0.0 or (number == 0.0 and allowed == "at least 0")
        _check(is_allowed and number < inf, what, allowed, value, error)


def _check_kind(
    name: str, value: Any, kind: type, limits: tuple[float, float], needed: str, error: type[Exception]
) -> Any:
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    _check(is_number and limits[0] <= value <= limits[1], name, needed, value, error)
    return value


def _check(is_allowed: bool, what: str, allowed: str, value: object, error: type[Exception]) -> None:
    if not is_allowed:
        raise error(f"{what} must be {allowed}, got {value!r}")


def format_distance(distance: float) -> str:
    """Return a distance [m] as text in millimeters, or in meters from 1 m on, with three digits.

    What is below 0.005 mm is "0.00 mm": no scanner and no simulator knows of less.
    """
    if abs(distance) >= 1.0:
        return f"{_round(distance)} m"
    millimeters = 1000.0 * distance
    return f"{_round(millimeters)} mm" if abs(millimeters) >= 0.005 else "0.00 mm"


def format_extents(low: Sequence[float], high: Sequence[float]) -> str:
    """Return from where to where something extends along each axis [m] as text: "x -0.5 to 3.2 m, y 0 to 1 m"."""
    return ", ".join(
        f"{axis} {_round_place(begin)} to {_round_place(end)} m"
        for axis, begin, end in zip("xyz", low, high, strict=False)
    )


def format_share(share: float) -> str:
    """Return a share as text in percent, with three digits; one that is not 0 but below 0.01 % says so."""
    percent = 100.0 * share
    return "below 0.01 %" if 0.0 < percent < 0.01 else f"{_round(percent)} %"


def format_count(count: int, noun: str, plural: str = "") -> str:
    """Return a number of things as text: "1 module", "2 modules", and "2 bodies" where the plural is given."""
    return f"{count} {noun}" if count == 1 else f"{count} {plural or noun + 's'}"


def _round_place(value: float) -> str:
    """Return a coordinate in centimeters, without a negative zero."""
    return f"{round(value, 2) + 0.0:.12g}"


def _round(value: float) -> str:
    """Return a number with three digits; whole numbers keep all."""
    return f"{value:.0f}" if 100 <= abs(value) < 1e15 else f"{value:.3g}"
