"""Bodies as data: their rules, and that they stand."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, letter_h, snake


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


def test_two_chassis_back_to_back_are_one_rigid_part():
    body = Organism(2, (Docking(0, "back", 1, "back"),))
    model = body.spec().compile()
    assert model.nv == 6
    poses = body.compute_poses()
    assert poses[1].heading % (2 * np.pi) == pytest.approx(np.pi)


def test_two_arms_front_to_front_have_two_hinges():
    body = Organism(2, (Docking(0, "front", 1, "front"),))
    assert body.hinges == (0, 1)
    assert body.spec().compile().nv == 8


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
            4,
            (Docking(0, "back", 1, "front"), Docking(2, "back", 3, "front"), Docking(2, "left", 3, "left")),
            "docked",
        ),
    ],
)
def test_bad_bodies_are_refused(modules, dockings, message):
    with pytest.raises(OrganismError, match=message):
        Organism(modules, dockings)


def test_overlapping_modules_are_refused():
    ring = tuple(Docking(i, "left", i + 1, "back") for i in range(4))
    with pytest.raises(OrganismError, match="overlap"):
        Organism(5, ring)


def test_short_crosses_and_spines_are_refused():
    with pytest.raises(OrganismError, match="cross"):
        cross(0)
    with pytest.raises(OrganismError, match="spine"):
        letter_h(1)
