"""The one rule, and the accuracy that is wanted by default."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.builder import compute_miss, find_fault
from symbrion_gym._src.contact.distances import find_accuracy
from symbrion_gym._src.contact.kinds import Contact, ContactOptions
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

BOX = trimesh.creation.box()


def make(mean=0.001, p95=0.002, uncovered=0.0, count=10, protrusion=0.0):
    quality = ArenaQuality(mean, p95, p95, count, uncovered=uncovered, protrusion_p95=protrusion)
    return Contact([BOX] * count, quality)


@pytest.mark.parametrize(
    ("candidate", "reason"),
    [
        (make(), ""),
        (make(mean=0.002), "mean"),
        (make(uncovered=0.005), "uncovered"),
        (make(mean=0.02), "misses"),
        (make(protrusion=0.0005), ""),
        (make(protrusion=0.002), "protrusion_p95"),
        (make(count=16), "16 pieces for 10"),
        (make(count=2000), "misses"),
        (make(mean=0.00305), "misses what is wanted 1.02-fold"),
    ],
)
def test_a_good_one_is_replaced_only_by_one_as_good(candidate, reason):
    fault = find_fault(make(), candidate, accuracy=0.003, max_pieces=100)
    assert (reason in fault) if reason else not fault


def test_one_that_misses_is_replaced_by_one_that_misses_less():
    assert not find_fault(make(mean=0.02), make(mean=0.01), 0.003, 100)
    assert find_fault(make(mean=0.01), make(mean=0.02), 0.003, 100)
    assert not find_fault(make(count=100), make(mean=0.002, p95=0.006, count=40), 0.003, 200)


def test_more_pieces_than_allowed_are_worse_than_any_distance():
    assert compute_miss(make(count=101), 0.003, 100) > compute_miss(make(mean=5.0, p95=9.0), 0.003, 100)


def test_uncovered_counts_where_five_centimeters_are_more_than_what_is_wanted():
    assert compute_miss(make(uncovered=0.5), 0.003, 100) > 1
    assert compute_miss(make(uncovered=0.5), 0.3, 100) < 1


def test_default_accuracy_follows_noise_within_limits_of_the_robot():
    floor = trimesh.creation.box(bounds=[[0, 0, -1], [4, 4, 0]]).subdivide()
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0, 4, (40_000, 2)), np.zeros(40_000)])
    assert find_accuracy(floor, 0.105, points) == pytest.approx(0.003)
    points[:, 2] = rng.normal(scale=0.02, size=len(points))
    assert find_accuracy(floor, 0.21, points) == pytest.approx(0.02, rel=0.1)
    assert find_accuracy(floor, 0.105, points) == pytest.approx(0.0105)  # a tenth of the robot, at most
    assert find_accuracy(floor, 0.105) <= 0.006


@pytest.mark.parametrize(
    "changes", [{"kind": "jelly"}, {"accuracy": 0.0}, {"max_pieces": 0}, {"reach": -1.0}]
)
def test_options_out_of_range_are_refused(changes):
    with pytest.raises(ArenaError, match=next(iter(changes))):
        ContactOptions(**changes)
