"""Turning by the law of MuJoCo's contacts: cases known by hand."""

import numpy as np
import pytest

from symbrion_gym._src.robot.belts import Contacts, compute_load_gain, compute_sliding_rate
from symbrion_gym._src.robot.tracks import compute_turning_rate

HALF, REACH, SPEED = 0.15, 0.1, 0.2


def make_contacts(stations: tuple[float, ...], edges: tuple[float, ...] = (HALF,)) -> Contacts:
    """Return contacts at stations along, and at edges on both sides."""
    sides = [*edges, *(-edge for edge in edges)]
    points = np.array([(x, y) for x in stations for y in sides])
    belts = np.where(points[:, 1] > 0, -SPEED, SPEED)
    return Contacts(points, belts, np.zeros(len(points), int), np.zeros((1, 2)), np.ones(1))


@pytest.mark.parametrize("gain", [0.0, 50.0])
def test_four_corners_bear_the_same_whatever_the_gain(gain: float) -> None:
    found = compute_sliding_rate(make_contacts((-REACH, REACH)), gain)
    assert found == pytest.approx(SPEED * HALF / (HALF**2 + REACH**2), rel=1e-4)


def test_without_gain_loads_are_even_and_with_it_the_fastest_bear_all() -> None:
    stations = (-REACH, 0.0, REACH)
    even = compute_turning_rate(-SPEED, SPEED, np.array(stations), 2 * HALF, 1e-9)
    assert compute_sliding_rate(make_contacts(stations), 0.0) == pytest.approx(even, rel=1e-3)
    corners = compute_sliding_rate(make_contacts((-REACH, REACH)), 0.0)
    assert compute_sliding_rate(make_contacts(stations), 1e3) == pytest.approx(corners, rel=1e-3)


def test_the_gain_between_gives_a_rate_between() -> None:
    stations = (-REACH, 0.0, REACH)
    rates = [compute_sliding_rate(make_contacts(stations), gain) for gain in (0.0, 0.5, 1.0, 1e3)]
    assert rates == sorted(rates, reverse=True)
    assert rates[0] > rates[1] > rates[3]


def test_inner_edges_slide_faster_and_bear_more() -> None:
    inner = compute_sliding_rate(make_contacts((-0.3, 0.3), (0.12,)), 0.0)
    assert compute_sliding_rate(make_contacts((-0.3, 0.3), (0.12, 0.18)), 1e3) == pytest.approx(
        inner, rel=1e-3
    )


def test_still_belts_and_equal_belts_do_not_turn() -> None:
    contacts = make_contacts((-REACH, REACH))
    assert compute_sliding_rate(contacts._replace(belts=np.zeros(4)), 10.0) == 0.0
    assert compute_sliding_rate(contacts._replace(belts=np.full(4, SPEED)), 10.0) == pytest.approx(
        0.0, abs=1e-6
    )


def test_gain_by_hand() -> None:
    expected = 0.7 * (2 / (0.95 * 0.02)) * 9 / 9.81 / (1 + 0.49 / 10)
    assert compute_load_gain(0.7, impratio=10.0) == pytest.approx(expected)
    assert compute_load_gain(0.7, time_constant=0.04) == pytest.approx(compute_load_gain(0.7) / 2)
