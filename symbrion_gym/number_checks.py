"""Numbers of a configuration that must not be negative, or must be above 0."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf


def check_positive(config: object, names: Iterable[str], error: type[Exception]) -> None:
    """Refuse fields that are no finite numbers above 0.

    Args:
        config: whose fields are checked.
        names: names of the fields.
        error: class of the error that is raised.

    Raises:
        error: with the name of the configuration, the field and its value.
    """
    _check(config, names, error, is_zero_allowed=False)


def check_not_negative(config: object, names: Iterable[str], error: type[Exception]) -> None:
    """Refuse fields that are no finite numbers of 0 or more; see `check_positive`."""
    _check(config, names, error, is_zero_allowed=True)


def _check(config: object, names: Iterable[str], error: type[Exception], is_zero_allowed: bool) -> None:
    for name in names:
        value, what = getattr(config, name), f"{type(config).__name__}: {name}"
        try:
            number = float("none" if isinstance(value, str) else value)
        except (TypeError, ValueError, OverflowError):
            raise error(f"{what} must be a number, got {value!r}") from None
        is_in_range = 0.0 <= number < inf if is_zero_allowed else 0.0 < number < inf
        if not is_in_range:
            raise error(f"{what} must be {'at least' if is_zero_allowed else 'above'} 0, got {value!r}")
