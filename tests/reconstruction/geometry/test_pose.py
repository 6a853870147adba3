"""Poses: the conventions, and that every way to write one means the same."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reconstruction._src.geometry.pose import (
    PlanarPose,
    compose_planar,
    compute_planar_step,
    make_pose,
    make_quarter_turn,
    make_quaternion,
    make_rotation,
    rotate_about,
    rotate_planar,
    to_planar,
    to_rotation,
    transform_planar,
)

ANGLES = np.random.default_rng(0).uniform(-3, 3, (3, 50))


def test_poses_are_turned_about_x_then_y_then_z():
    roll, pitch, yaw = 0.1, -0.2, 0.7

    def turn(axis, angle):
        c, s = np.cos(angle), np.sin(angle)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        matrix = np.eye(3)
        matrix[i, i] = matrix[j, j] = c
        matrix[i, j], matrix[j, i] = -s, s
        return matrix

    pose = make_pose(0, 0, yaw, roll=roll, pitch=pitch)
    np.testing.assert_allclose(pose[:3, :3], turn(2, yaw) @ turn(1, pitch) @ turn(0, roll), atol=1e-12)
    np.testing.assert_allclose(to_planar(make_pose([3.0], [4.0], [yaw])), [[3, 4, yaw]])


def test_scipy_means_the_same_rotation():
    roll, pitch, yaw = ANGLES
    expected = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_matrix()
    np.testing.assert_allclose(make_rotation(roll, pitch, yaw), expected, atol=1e-14)
    axis = np.array([2.0, -1.0, 2.0]) / 3
    expected = Rotation.from_rotvec(yaw[:, None] * axis).as_matrix()
    np.testing.assert_allclose(rotate_about(axis, yaw), expected, atol=1e-14)


def test_a_positive_pitch_lowers_what_is_ahead():
    assert (make_rotation(pitch=0.1) @ [1.0, 0.0, 0.0])[2] == pytest.approx(-np.sin(0.1))


def test_quaternions_have_w_first():
    yaw, pitch = 0.7, -0.3
    expected = make_rotation(pitch=pitch, yaw=yaw)
    np.testing.assert_allclose(to_rotation(make_quaternion(yaw, pitch)[None])[0], expected, atol=1e-14)
    quarter = to_rotation(make_quarter_turn(y=1.0)[None])[0]
    np.testing.assert_allclose(quarter, make_rotation(pitch=np.pi / 2), atol=1e-14)
    planar = np.array(PlanarPose(heading=yaw).quaternion)
    np.testing.assert_allclose(planar, make_quaternion(yaw, 0.0), atol=1e-15)


def test_a_pose_after_its_inverse_changes_nothing():
    pose = PlanarPose(1.0, -2.0, 0.4)
    for product in (pose.compose(pose.invert()), pose.invert().compose(pose)):
        np.testing.assert_allclose([product.x, product.y, product.heading], 0, atol=1e-14)


def test_planar_rows_compose_as_matrices_do():
    first, step = np.array([1.0, -2.0, 0.4]), np.array([0.3, 0.2, -0.9])
    second = compose_planar(first, step)
    np.testing.assert_allclose(make_pose(*second), make_pose(*first) @ make_pose(*step), atol=1e-14)
    np.testing.assert_allclose(compute_planar_step(first, second), step, atol=1e-14)
    composed = PlanarPose(*first).compose(PlanarPose(*step))
    np.testing.assert_allclose([composed.x, composed.y, composed.heading], second, atol=1e-14)


def test_points_move_with_their_frame():
    points = np.array([[1.0, 0.0], [0.0, 2.0]])
    moved = transform_planar(points, np.array([5.0, 6.0, np.pi / 2]))
    np.testing.assert_allclose(moved, [[5, 7], [3, 6]], atol=1e-14)
    turned = rotate_planar(points, np.array([np.pi / 2, np.pi]))
    np.testing.assert_allclose(turned, [[0, 1], [0, -2]], atol=1e-14)
