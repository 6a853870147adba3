"""Numbers of configurations: what is in range passes, all else is refused by the caller's error with name and value."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from reconstruction._src.base.range_checks import (
    as_floats,
    as_integers,
    as_range,
    check_choice,
    check_count,
    check_counts,
    check_not_negative,
    check_positive,
    coerce_floats,
    coerce_integers,
)


class CartError(ValueError):
    """Raised for carts."""


@dataclass(frozen=True)
class Cart:
    """Numbers of any value."""

    load: Any = 1.0
    wheels: Any = 4
    is_full: bool = False
    name: str = "cart"


def test_numbers_in_range_pass():
    check_positive(Cart(1e-300, np.float32(2)), ("load", "wheels"), CartError)
    check_not_negative(Cart(0, 0.0), ("load", "wheels"), CartError)
    check_counts(Cart(1, np.int64(7)), ("load", "wheels"), CartError)
    check_choice("color", "red", ("red", "blue"), CartError)
    check_count("lanes", [1, 2], 2, CartError)
    assert as_range("load", (0, 2), 0, 2, CartError) == (0.0, 2.0)


@pytest.mark.parametrize("value", [-1, np.inf, np.nan, "1", None, [1], 10**400])
def test_named_fields_must_be_finite_numbers_of_a_sign(value):
    for check in (check_positive, check_not_negative):
        with pytest.raises(CartError, match=r"Cart\.wheels must be .*, got"):
            check(Cart(1.0, value), ("load", "wheels"), CartError)


@pytest.mark.parametrize("value", [0, -1, 1.0, True, "1", None])
def test_counts_are_whole_and_at_least_one(value):
    with pytest.raises(CartError, match=r"Cart\.wheels must be a whole number of at least 1, got"):
        check_counts(Cart(1.0, value), ("wheels",), CartError)


def test_coerced_fields_are_python_numbers():
    cart = Cart(1, np.int64(4))
    coerce_floats(cart, {"load": (0, 2)}, CartError)
    coerce_integers(cart, {"wheels": (1, 8)}, CartError)
    assert (type(cart.load), type(cart.wheels)) == (float, int)


@pytest.mark.parametrize("value", [9, 0, 2.5, True, "4", np.nan])
def test_values_outside_of_a_range_are_refused(value):
    with pytest.raises(CartError, match="wheels must be a whole number from 1 to 8, got"):
        as_integers("wheels", [4, value], 1, 8, CartError)
    if value != 2.5:
        with pytest.raises(CartError, match="load must be a number from 1 to 8, got"):
            as_floats("load", [4, value], 1, 8, CartError)


def test_choices_counts_and_ranges_are_refused():
    with pytest.raises(CartError, match="color: there is no 'green'; there are: red, blue"):
        check_choice("color", "green", ("red", "blue"), CartError)
    for values in ([], [1, 2, 3]):
        with pytest.raises(CartError, match=f"lanes has {len(values)} values; 1 to 2 are possible"):
            check_count("lanes", values, 2, CartError)
    with pytest.raises(CartError, match="load must be a lowest and a highest value"):
        as_range("load", (1,), 0, 2, CartError)
