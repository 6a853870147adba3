"""What a map leaves uncovered in an uneven cloud is found, and covered by a map beside it."""

import numpy as np
import pytest
from constants import with_constants

from reconstruction._src.networks.gsrm import gsrm
from reconstruction._src.networks.gsrm.gsrm import GSRMConfig, find_uncovered, train
from reconstruction._src.surfaces.quality import compute_distances, count_topology

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def make_scan(seed: int = 0) -> np.ndarray:
    """Return a wall with 12,000 samples, dense in its middle, a small board far from it with 40, and ten strays."""
    rng = np.random.default_rng(seed)
    near = np.c_[rng.normal(2, 0.003, 12_000), rng.uniform(-1, 1, (12_000, 2)) ** 3]
    far = np.c_[rng.normal(9, 0.002, 40), rng.uniform(-0.03, 0.03, (40, 2))]
    strays = np.c_[rng.uniform(4, 7, 10), rng.uniform(-3, 3, (10, 2))]
    return np.concatenate([near, far, strays])


def test_only_groups_far_from_every_face_are_uncovered():
    rng = np.random.default_rng(0)
    on = np.c_[rng.uniform(0, 1, (2000, 2)), rng.normal(0, 0.01, 2000)]
    group = np.c_[rng.uniform(0, 1, (40, 2)), np.full(40, 3.0)]
    strays = np.concatenate([[[0.0, 0, -9], [5, 0, -9], [0, 8, 9]], rng.uniform(11, 12, (60, 3))])
    found = find_uncovered(np.concatenate([on, group, strays]), *SQUARE)
    assert found[2000:2040].all()
    assert found.sum() == 40
    few = np.concatenate([on, group[: gsrm._MIN_SAMPLES - 1]])
    assert not find_uncovered(few, *SQUARE).any()


@pytest.mark.slow
def test_what_was_dropped_as_debris_is_covered_and_the_rest_stays_as_it_is():
    samples = make_scan()
    config = GSRMConfig(units=400)
    with with_constants(gsrm, passes=0):
        without = train(samples, config)
    state = train(samples, config)
    before, after = (
        compute_distances(samples[12_000:12_040], each.units, each.faces) for each in (without, state)
    )
    assert np.median(after) < 0.02
    assert np.median(before) > 3.0
    num_faces, num_units = len(without.faces), len(without.units)
    np.testing.assert_array_equal(state.faces[:num_faces], without.faces)
    np.testing.assert_array_equal(state.units[:num_units], without.units)
    assert len(state.units) <= 1.25 * 400
    assert count_topology(state.faces, len(state.units)).is_manifold
    again = train(samples, config)
    np.testing.assert_array_equal(again.units, state.units)


@pytest.mark.slow
def test_an_even_cloud_is_not_completed():
    rng = np.random.default_rng(0)
    samples = np.c_[rng.uniform(0, 2, (5000, 2)), np.zeros(5000)]
    whole = train(samples, GSRMConfig(units=200))
    with with_constants(gsrm, passes=0):
        without = train(samples, GSRMConfig(units=200))
    np.testing.assert_array_equal(whole.units, without.units)
