"""How hinges lie in trees of modules: known by hand for small bodies, and against MuJoCo for all docks."""

import mujoco
import numpy as np
import pytest

from evolution._src.controllers.joints import find_joints
from symbrion_gym._src.robot.organism import cross, letter_h, snake


def test_a_snake_is_a_row():
    joints = find_joints(snake(4))
    assert joints.own.tolist() == [1, 2, 3]
    assert joints.ahead.tolist() == [0, 1, 2]
    assert joints.is_head.tolist() == [True, False, False]
    assert joints.is_tail.tolist() == [False, False, True]
    assert joints.depth.tolist() == [1, 2, 3]
    assert joints.ahead_part.astype(int).tolist() == [[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 0]]
    assert joints.parents == (-1, 0, 1, 2)
    assert joints.steps.tolist() == [0.0, 1.0, 1.0, 1.0]
    assert (joints.along == 1.0).all()
    assert not joints.has_rolls


def test_a_cross_is_a_row_with_arms_that_look_at_its_middle():
    joints = find_joints(cross(1))
    assert joints.own.tolist() == [1, 2, 3, 4]
    assert joints.ahead.tolist() == [0, 1, 1, 1]
    assert joints.dock == ("back", "back", "left", "right")
    assert joints.along.tolist() == [1.0, 1.0, 0.0, 0.0]
    assert joints.side.tolist() == [0.0, 0.0, 1.0, -1.0]
    assert joints.is_head.tolist() == [True, False, False, False]
    assert joints.is_tail.tolist() == [False, True, True, True]
    assert joints.ahead_part[2].tolist() == [True, True, True, False, True]
    assert joints.has_rolls


def test_the_legs_of_an_h_are_as_far_back_as_the_module_they_are_docked_to():
    joints = find_joints(letter_h(3))
    assert joints.parents == (-1, 0, 1, 0, 0, 2, 2)
    assert joints.steps == pytest.approx([0, 1, 1, 0, 0, 0, 0])
    assert joints.side.tolist() == [0, 0, 1, -1, 1, -1]
    assert joints.is_tail.tolist() == [False, False, True, True, True, True]


def test_a_single_module_has_no_joint():
    joints = find_joints(snake(1))
    assert joints.own.shape == (0,)
    assert joints.ahead_part.shape == (0, 1)


@pytest.mark.parametrize("organism", [snake(4), cross(1), letter_h()], ids=["snake", "cross", "h"])
def test_a_positive_angle_is_the_inclination_ahead_minus_that_of_the_own_module(organism):
    joints, model = find_joints(organism), organism.spec().compile()
    data = mujoco.MjData(model)
    for hinge, own in enumerate(joints.own):
        mujoco.mj_resetData(model, data)
        data.qpos[model.joint(f"hinge_{own}").qposadr[0]] = 0.3
        mujoco.mj_kinematics(model, data)
        axes = [data.site(f"module_{i}").xmat.reshape(3, 3)[2] for i in range(organism.num_modules)]
        pitch = np.array([[np.arcsin(axis[0]) for axis in axes]])
        roll = np.array([[np.arctan2(axis[1], axis[2]) for axis in axes]])
        inclination = joints.compute_inclination_ahead(pitch, roll if joints.has_rolls else None)[0, hinge]
        assert inclination - pitch[0, own] == pytest.approx(0.3)
