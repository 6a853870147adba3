"""Friction by place from slip: known cases, what does not count, offsets of sensors."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.knowledge.slip.drags import find_friction
from reconstruction._src.scans.slip_readings import SlipReadings
from tests.reconstruction.knowledge.slip.made_slip import make_slip


@pytest.mark.parametrize("slope", [0.0, 0.25, -0.25])
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.9])
def test_friction_is_found_on_flats_and_slopes(friction: float, slope: float) -> None:
    found = find_friction(make_slip(lambda x: friction, slope))
    assert len(found.frictions) == 40, "two windows a drag"
    assert found.frictions == pytest.approx(friction)
    assert found.sigmas == pytest.approx(0.01, abs=0.005)


def test_places_are_those_of_the_drags() -> None:
    found = find_friction(make_slip(lambda x: 0.3 if x < 1.0 else 0.8))
    is_near = found.places[:, 0] < 0.95
    assert found.frictions[is_near] == pytest.approx(0.3)
    assert found.frictions[found.places[:, 0] > 1.05] == pytest.approx(0.8)


def test_tracks_that_slip_too_little_do_not_count() -> None:
    assert len(find_friction(make_slip(lambda x: 0.5, offset=0.08)).frictions) == 0


def test_a_module_that_is_pulled_as_fast_as_its_tracks_run_does_not_count() -> None:
    slip = make_slip(lambda x: 0.5)
    standing = replace(slip, commanded=np.where(slip.commanded < 0.1, 0.12 - 1e-3, slip.commanded))
    assert len(find_friction(standing).frictions) == 20


def test_drags_over_a_knick_do_not_count() -> None:
    slip = make_slip(lambda x: 0.5)
    bent = replace(slip, pitches=np.where(slip.times > 10.8, 0.1, 0.0))
    assert len(find_friction(slip).frictions) - len(find_friction(bent).frictions) in (2, 4)


def test_the_offset_of_the_pull_is_found_from_both_directions() -> None:
    biased = find_friction(make_slip(lambda x: 0.5, bias=0.4))
    assert biased.frictions == pytest.approx(0.5, abs=0.002)
    alone = find_friction(make_slip(lambda x: 0.5, bias=0.4, both_ways=False))
    assert np.abs(alone.frictions - 0.5).min() > 0.03
    assert alone.sigmas.min() > 0.05, "and without both, the interval says so"


def test_noise_widens_the_interval() -> None:
    quiet, loud = (find_friction(make_slip(lambda x: 0.5, noise=noise)) for noise in (0.0, 2.0))
    assert loud.sigmas[0] > 1.5 * quiet.sigmas[0]
    assert np.abs(loud.frictions - 0.5).std() < 2 * loud.sigmas[0]


def test_readings_that_are_none_are_refused() -> None:
    slip = make_slip(lambda x: 0.5)
    with pytest.raises(ScanError, match="forces has shape"):
        replace(slip, forces=slip.forces[:-1])
    with pytest.raises(ScanError, match="pitches must be finite"):
        replace(slip, pitches=slip.pitches * np.nan)
    with pytest.raises(ScanError, match="mass must be above 0"):
        replace(slip, mass=0.0)


def test_no_readings_are_no_friction() -> None:
    nothing = np.zeros((0, 3))
    empty = SlipReadings(*(nothing[:, 0],) * 2, nothing, *(nothing[:, 0],) * 3, nothing, nothing, 1.0)
    assert len(find_friction(empty).frictions) == 0
