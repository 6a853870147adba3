"""Bodies as data: their rules, and that they stand."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, letter_h, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig


def test_a_snake_has_a_hinge_less_than_modules():
    body = snake(8)
    model = body.spec().compile()
    assert body.hinges == tuple(range(1, 8))
    assert (model.nv, model.nu, model.njnt) == (13, 7, 8)


def test_a_positive_hinge_lifts_what_is_ahead():
    model = snake(2).spec().compile()
    data = mujoco.MjData(model)
    data.joint("hinge_1").qpos[0] = 0.4
    mujoco.mj_kinematics(model, data)
    tail = data.site("module_1").xmat.reshape(3, 3)
    ahead = tail.T @ (data.site("module_0").xpos - data.site("module_1").xpos)
    assert ahead[2] == pytest.approx(0.1254 * np.sin(0.4))


@pytest.mark.parametrize(("body", "modules"), [(cross(), 9), (letter_h(), 7), (snake(1), 1), (cross(1), 5)])
def test_bodies_compile_and_stand(body, modules):
    spec = body.spec()
    spec.option.timestep = 0.005
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
    model = spec.compile()
    model.geom_surfacevel[:] = 0
    data = mujoco.MjData(model)
    data.qpos[2] = 0.06
    mujoco.mj_step(model, data, nstep=400)
    centers = np.array([data.site(f"module_{i}").xpos for i in range(modules)])
    ups = np.array([data.site(f"module_{i}").xmat[8] for i in range(modules)])
    np.testing.assert_allclose(centers[:, 2], 0.0525, atol=0.004)
    assert ups.min() > 0.99
    assert np.abs(data.qvel).max() < 0.02


def test_parents_lead_to_module_0_and_free_sides_see_the_world():
    assert cross(1).parents == (-1, 0, 1, 1, 1)
    backwards = Organism(3, (Docking(0, "front", 2, "back"), Docking(2, "front", 1, "left")))
    assert (backwards.parents, backwards.order) == ((-1, 2, 0), (0, 2, 1))
    assert snake(2).free_sides == [
        (0, "front"),
        (0, "left"),
        (0, "right"),
        (1, "back"),
        (1, "left"),
        (1, "right"),
    ]


@pytest.mark.parametrize(
    ("modules", "dockings", "message"),
    [
        (0, (), "at least 1 module, got 0"),
        (-3, (), "at least 1 module"),
        (2.5, (), "whole number"),
        (True, (), "whole number"),
        (2, (), "need 1 dockings"),
        (
            3,
            (Docking(0, "back", 1, "front"), Docking(0, "back", 2, "front")),
            "'back' of module 0 is used twice",
        ),
        (2, (Docking(0, "back", 0, "front"),), "dock to itself"),
        (2, (Docking(0, "back", 5, "front"),), "no module 5"),
        (2, (Docking(0, "top", 1, "front"),), "no dock 'top'"),
        (
            2,
            (Docking(0, "back", 1, "back"),),
            "'back' of module 0 cannot hold 'back' of module 1; join the arm",
        ),
        (2, (Docking(0, "front", 1, "front"),), "'front' of module 0 cannot hold 'front'"),
        (2, (("0", "front", 1, "back"),), "no module '0'"),
        (2, ((0, "front", 1),), "a sequence of dockings such as"),
        (2, Docking(0, "front", 1, "back"), "a sequence of dockings such as"),
        (
            4,
            (Docking(0, "back", 1, "front"), Docking(2, "back", 3, "front"), Docking(2, "front", 3, "left")),
            "docked",
        ),
    ],
)
def test_bad_bodies_are_refused(modules, dockings, message):
    with pytest.raises(OrganismError, match=message):
        Organism(modules, dockings)


def test_four_values_are_a_docking():
    assert Organism(2, [(1, "front", 0, "back")]) == snake(2)


TWO = ScoutConfig(dofs=2)


def find_up(model: mujoco.MjModel, module: int, **angles: float) -> np.ndarray:
    """Return the up axis of a module seen from module 0."""
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    base = data.site("module_0").xmat.reshape(3, 3)
    return base.T @ data.site(f"module_{module}").xmat.reshape(3, 3)[:, 2]


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


def test_actions_and_observations_have_the_hinges_first():
    env = OrganismEnv(
        organism=cross(1, ScoutConfig(dofs=2)), sensors=("hinge_angle", "hinge_rate", "dock_force")
    )
    env.reset(seed=0)
    assert env.action_space.shape == (8,)
    assert [part.stop - part.start for part in env.observation_structure.values()] == [8, 8, 12]
    action = np.zeros(8)
    action[6] = 0.2  # twist of the third hinge's module
    for _ in range(40):
        observation, *_ = env.step(action)
    joint = env.world.organism.servos[6]
    assert joint == f"twist_{env.world.organism.hinges[2]}"
    assert env.data.joint(joint).qpos[0] == pytest.approx(0.2 * np.pi / 2, abs=0.1)
    assert observation[6] == env.data.joint(joint).qpos[0]
