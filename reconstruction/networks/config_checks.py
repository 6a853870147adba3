"""Refuse configurations whose numbers make no sense."""

import dataclasses
import math

from reconstruction.errors import ReconstructionError


def check_positive(
    config: object, *, may_be_zero: tuple[str, ...] = (), any_sign: tuple[str, ...] = ()
) -> None:
    """Refuse a configuration with a number that is not above zero.

    Args:
        config: an instance of a dataclass; fields of other types than `int` and `float` are not looked at.
        may_be_zero: fields that may also be zero.
        any_sign: fields that may have any finite value.

    Raises:
        ReconstructionError: with the class, the field, its value and the range.
    """
    for field in dataclasses.fields(config):  # pyright: ignore[reportArgumentType]
        value = getattr(config, field.name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        may_be_zero_here = field.name in may_be_zero
        if field.name in any_sign:
            is_allowed, limit = math.isfinite(value), "finite"
        else:
            is_allowed = value > 0 or (may_be_zero_here and value == 0)
            limit = "0 or more" if may_be_zero_here else "above 0"
        if not is_allowed:
            raise ReconstructionError(f"{type(config).__name__}.{field.name} must be {limit}, got {value}")
