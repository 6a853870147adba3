"""Symmetries of objects, and angles that leave them out of account."""

import numpy as np
import pytest
import trimesh

from benchmarks.material.known_objects import make_box, make_socket, make_station
from reconstruction._src.objects.model import choose_equivalent, compute_angle, compute_symmetries, make_turn

Z = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("mesh", "count"),
    [
        (make_socket(), 1),
        (make_station(), 1),
        (make_box(), 4),
        (trimesh.creation.box((0.2, 0.2, 0.1)), 8),
        (trimesh.creation.box((0.2, 0.2, 0.2)), 24),
        (trimesh.creation.cylinder(0.1, 0.3, sections=64), 72),
    ],
)
def test_the_group_has_as_many_rotations_as_the_shape(mesh, count):
    found = compute_symmetries(mesh, mesh.triangles_center.T @ mesh.area_faces / mesh.area)
    assert len(found) == count
    np.testing.assert_allclose(found[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found @ found.transpose(0, 2, 1), np.tile(np.eye(3), (count, 1, 1)), atol=1e-9)


def test_the_angle_is_that_of_the_nearest_equal_pose():
    half = np.array([np.eye(3), make_turn(Z, np.pi)])
    turned = make_turn(Z, np.deg2rad(170.0))
    assert compute_angle(turned, np.eye(3)) == pytest.approx(np.deg2rad(170.0))
    assert compute_angle(turned, np.eye(3), half) == pytest.approx(np.deg2rad(10.0))


def test_of_equal_poses_the_one_that_turns_least_is_chosen():
    half = np.array([np.eye(3), make_turn(Z, np.pi)])
    chosen = choose_equivalent(make_turn(Z, np.deg2rad(170.0)), half)
    np.testing.assert_allclose(chosen, make_turn(Z, np.deg2rad(-10.0)), atol=1e-12)
