"""Distances in 3-D on cases known by hand."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.distances import SurfaceDistance


def make_floor() -> trimesh.Trimesh:
    corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def make_slab(top: float, end: float = 2.0) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[[0, 0, top - 0.1], [end, 2, top]])


@pytest.mark.parametrize(("top", "bias"), [(0.0, 0.0), (0.02, 0.02), (-0.02, -0.02)])
def test_contact_in_front_or_behind_by_two_centimeters(top, bias):
    quality = SurfaceDistance(make_floor()).measure([make_slab(top)])
    assert quality.mean == pytest.approx(abs(bias), abs=2e-3)  # near its sides a point is nearer to them
    assert quality.bias == pytest.approx(bias, abs=2e-3)
    assert quality.uncovered == 0.0
    assert quality.protrusion_p95 == pytest.approx(max(bias, 0.0), abs=1e-6)


def test_half_of_the_floor_without_contact():
    quality = SurfaceDistance(make_floor()).measure([make_slab(0.0, end=1.0)])
    assert quality.uncovered == pytest.approx(0.5 - 0.05 / 2, abs=0.01)
    assert quality.max == pytest.approx(1.0, abs=0.02)


def test_a_wall_without_contact_is_seen():
    wall = trimesh.Trimesh(
        [[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    room = trimesh.util.concatenate([make_floor(), wall])
    assert SurfaceDistance(room).measure([make_slab(0.0)]).uncovered == pytest.approx(0.5 * 0.975, abs=0.02)


def test_a_thin_piece_in_front_is_not_left_through_its_back():
    quality = SurfaceDistance(make_floor()).measure(
        [trimesh.creation.box(bounds=[[-1, -1, -0.01], [3, 3, 0.08]])]
    )
    assert quality.mean == pytest.approx(0.08, abs=1e-6)


def test_nothing_is_infinitely_far():
    assert np.isinf(SurfaceDistance(make_floor()).measure([]).mean)
