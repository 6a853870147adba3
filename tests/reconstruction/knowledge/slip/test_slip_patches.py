"""Patches from friction by place: stretches, joining, rectangles, intervals, growth by later surveys."""

import dataclasses

import numpy as np
import pytest

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.knowledge.slip.drags import (
    FrictionReadings,
    find_friction,
    join_slip,
    read_slip_arrays,
)
from reconstruction._src.knowledge.slip.patches import estimate_friction_patches, find_segments
from tests.reconstruction.knowledge.slip.made_slip import make_slip


def make_readings(friction, lanes=(-0.4, 0.0, 0.4), noise: float = 0.0) -> FrictionReadings:
    """Return readings every 6 cm along lanes of 3 m."""
    x = np.arange(0.03, 3.0, 0.06)
    places = np.array([(a, y, 0.0) for y in lanes for a in x])
    values = np.array([friction(a, y) for a, y, _ in places])
    values += noise * np.random.default_rng(0).standard_normal(len(values))
    count = len(values)
    runs = np.repeat(np.arange(len(lanes)), len(x))
    return FrictionReadings(places, values, np.full(count, 0.01), np.full(count, 0.005), runs)


def test_changes_are_found_where_they_are() -> None:
    values = np.array([0.3, 0.3, 0.3, 0.7, 0.7, 0.5, 0.5])
    assert find_segments(values, 0.01, 16.0).tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert find_segments(values, 0.5, 16.0).tolist() == [0] * 7
    assert find_segments(np.zeros(0), 0.01, 16.0).tolist() == []


def test_ice_in_the_middle_is_one_patch() -> None:
    felt = estimate_friction_patches(make_readings(lambda x, y: 0.2 if 1.0 < x < 1.6 else 0.7, noise=0.01))
    assert [round(patch.friction, 2) for patch in felt.patches] == [0.7, 0.2]
    ground, ice = felt.patches
    assert len(ground.rectangles) == 0
    low, high = ice.rectangles[0][:2], ice.rectangles[0][2:]
    np.testing.assert_allclose([low[0], high[0]], [1.0, 1.6], atol=0.06)
    np.testing.assert_allclose([low[1], high[1]], [-0.7, 0.7], atol=0.06)
    assert ice.half_width == pytest.approx(1.96 * 0.005, rel=0.3), "most of it is the shared error"


def test_grounds_alike_are_one_patch_wherever_they_are() -> None:
    felt = estimate_friction_patches(
        make_readings(lambda x, y: 0.3 if x < 0.6 else 0.31 if x > 2.4 else 0.7, noise=0.002)
    )
    assert len(felt.patches) == 2
    covered = felt.patches[1].rectangles
    assert covered[:, 0].min() < 0.1
    assert covered[:, 2].max() > 2.9


def test_a_place_on_a_border_belongs_to_neither_side() -> None:
    felt = estimate_friction_patches(
        make_readings(lambda x, y: 0.2 if x < 1.5 else 0.45 if x < 1.56 else 0.7)
    )
    assert [round(patch.friction, 6) for patch in felt.patches] == [0.2, 0.7]
    assert (felt.patch_of == -1).sum() >= 3


def test_too_few_readings_are_no_patch() -> None:
    readings = make_readings(lambda x, y: 0.5)
    assert estimate_friction_patches(FrictionReadings(*(array[:1] for array in readings))) is None
    assert estimate_friction_patches(FrictionReadings(*(array[:0] for array in readings))) is None


def test_a_new_survey_replaces_what_was_known_of_its_places() -> None:
    offset = np.array([100.0, 0.0, 0.0])
    first = join_slip(None, make_slip(lambda x: 0.7), np.zeros(3))
    slip = make_slip(lambda x: 0.2, seconds=8.0)
    assert join_slip(first, None, offset) is first
    moved = dataclasses.replace(slip, positions=slip.positions + offset)
    both = join_slip(first, moved, offset)
    assert set(both.frictions.round(3)) == {0.2, 0.7}
    assert both.places[both.frictions > 0.5, 0].min() > find_friction(slip).places[:, 0].max() + 0.19
    assert len(np.unique(both.runs)) == 2


def test_slip_that_is_none_is_refused() -> None:
    with pytest.raises(ReconstructionError, match="SlipReadings"):
        join_slip(None, np.zeros((3, 3)), np.zeros(3))


def test_arrays_of_a_file_are_checked() -> None:
    arrays = {f"slip_{name}": array for name, array in make_readings(lambda x, y: 0.5)._asdict().items()}
    assert read_slip_arrays({}) is None
    assert read_slip_arrays(arrays) is not None
    with pytest.raises(ReconstructionError, match="slip must be finite"):
        read_slip_arrays(arrays | {"slip_sigmas": np.zeros(2)})
