"""The second rotational degree of freedom of a module."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, snake
from symbrion_gym._src.robot.scout import make_scout
from symbrion_gym._src.robot.scout_constants import ScoutConfig

TWO = ScoutConfig(dofs=2)


def find_up(model: mujoco.MjModel, module: int, **angles: float) -> np.ndarray:
    """Return the up axis of a module seen from module 0."""
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    base = data.site("module_0").xmat.reshape(3, 3)
    return base.T @ data.site(f"module_{module}").xmat.reshape(3, 3)[:, 2]


def test_modules_have_one_joint_unless_asked():
    model = snake(3).spec().compile()
    assert snake(3).servos == ("hinge_1", "hinge_2")
    assert (model.nv, model.nu) == (8, 2)


def test_a_second_joint_has_its_name_its_range_and_its_servo():
    body = snake(3, ScoutConfig(dofs=2, twist_range=1.0, twist_torque=2.0))
    model = body.spec().compile()
    assert body.servos == ("hinge_1", "hinge_2", "twist_1", "twist_2")
    assert (model.nv, model.nu) == (10, 4)
    np.testing.assert_allclose(model.joint("twist_1").range, [-1.0, 1.0])
    np.testing.assert_allclose(model.actuator("twist_2").forcerange, [-2.0, 2.0])


def test_a_positive_angle_lifts_the_left_side_of_what_is_ahead():
    model = snake(2, TWO).spec().compile()
    up = find_up(model, 1, twist_1=0.3)  # of module 1, seen from module 0 ahead of it
    np.testing.assert_allclose(up, [0.0, np.sin(0.3), np.cos(0.3)], atol=1e-12)


def test_it_turns_about_the_arm_even_if_that_is_lifted():
    """The center of what is docked stays: it lies on the axis, whichever part is the root."""
    bodies = [Organism(2, (Docking(0, "front", 1, "back"),), TWO), snake(2, TWO)]
    for body, module in zip(bodies, (0, 1), strict=True):
        model = body.spec().compile()
        data = mujoco.MjData(model)
        places = []
        for twist in (0.0, 0.7):
            data.joint(f"hinge_{module}").qpos[0], data.joint(f"twist_{module}").qpos[0] = 0.5, twist
            mujoco.mj_kinematics(model, data)
            frame = data.site(f"module_{module}").xmat.reshape(3, 3)
            other = data.site(f"module_{1 - module}").xpos - data.site(f"module_{module}").xpos
            places.append(frame.T @ other)
        np.testing.assert_allclose(places[0], places[1], atol=1e-12)
        assert places[0][2] == pytest.approx(0.1254 * np.sin(0.5))


def test_the_number_is_one_or_two():
    for dofs in (0, 3, True, 1.5):
        with pytest.raises(OrganismError, match="dofs must be 1"):
            ScoutConfig(dofs=dofs)


def test_one_module_alone_has_both_joints():
    assert make_scout(TWO).compile().nu == 2


def test_actions_and_observations_have_the_hinges_first():
    env = OrganismEnv(
        organism=cross(1, ScoutConfig(dofs=2)), sensors=("hinge_angle", "hinge_rate", "dock_force")
    )
    env.reset(seed=0)
    assert env.action_space.shape == (10,)
    assert [part.stop - part.start for part in env.observation_structure.values()] == [10, 10, 15]
    action = np.zeros(10)
    action[7] = 0.2  # twist of the third hinge's module
    for _ in range(40):
        observation, *_ = env.step(action)
    joint = env.world.organism.servos[7]
    assert joint == f"twist_{env.world.organism.hinges[2]}"
    assert env.data.joint(joint).qpos[0] == pytest.approx(0.2 * np.pi / 2, abs=0.1)
    assert observation[7] == env.data.joint(joint).qpos[0]
