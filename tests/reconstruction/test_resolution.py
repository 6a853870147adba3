"""How many units a scan needs."""

import numpy as np
import pytest

from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.resolution import choose_units


def make_floor(number: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.c_[rng.uniform(0, 4, (number, 2)), np.zeros(number)]


def make_scan(number: int) -> np.ndarray:
    """Return a floor as a scanner 1 m above it samples it: the density falls with the distance."""
    points = make_floor(number) * 2 - [4, 4, 0]
    return points * np.linalg.norm(points, axis=1, keepdims=True) ** 1.5


def test_an_even_cloud_has_twenty_samples_a_unit():
    assert choose_units(make_floor(40_000)) == 2000
    assert choose_units(make_floor(400_000)) == 8000
    assert choose_units(make_floor(3000)) == 500
    assert choose_units(make_floor(100)) == 25
    assert choose_units(make_floor(4)) == 4


def test_units_of_a_map_of_few_points_a_square_meter_are_near_to_each_other():
    assert choose_units(3.5 * make_floor(14_000)) == pytest.approx(14**2 / 0.3**2, rel=0.05)
    assert choose_units(10 * make_floor(14_000)) == 14_000 // 6  # which average the noise


@pytest.mark.slow
def test_an_uneven_cloud_has_more_and_the_scale_does_not_matter():
    points = make_scan(40_000)
    number = choose_units(points)
    assert 2000 < number < 8000
    assert choose_units(1000 * points) == pytest.approx(number, rel=1e-3)


@pytest.mark.slow
def test_the_number_is_chosen_where_none_is_given_and_noted():
    points = make_floor(3000)
    result = reconstruct(points)
    assert result.config.units == 500
    assert result.notes["units"].startswith("500, chosen")
    assert "units" not in reconstruct(points, units=100).notes
    assert reconstruct(points, "gg").config.units == 500
    assert "units" not in reconstruct(points, "gg", triangles=60).notes
