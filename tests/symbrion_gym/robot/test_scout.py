"""The compiled module against its constants, and honest physics of one module alone."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.robot.scout import (
    MIDDLE_RISE,
    find_road_wheels,
    find_scout_rays,
    make_scout,
    set_physics,
)
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig


def _put_in_a_room(organism, wall_x=None, wall_behind=None, slope=0.0):
    """A model of a body on a plane, with a wall ahead or behind."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    set_physics(spec.option, 0.005)
    tilt = [np.cos(slope / 2), 0, np.sin(slope / 2), 0]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 0.1], quat=tilt)
    for x in (wall_x, wall_behind):
        if x is not None:
            side = 0.1 * np.sign(x)
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 2, 1], pos=[x + side, 0, 1])
    organism.add_to(spec, spec.worldbody)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = 0.054
    return model, data


def _run(model, data, seconds):
    """Positions and up axes of every chassis after each step."""
    ids = [i for i in range(model.nbody) if model.body(i).name.startswith("chassis")]
    places, ups = [], []
    for _ in range(int(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        places.append(data.xpos[ids].copy())
        ups.append(data.xmat[ids, 8].copy())
    return np.array(places), np.array(ups)


def test_compiled_module_has_the_constants():
    config = ScoutConfig()
    model = make_scout(config).compile()
    assert model.body_mass.sum() == pytest.approx(0.95, abs=0.03)
    hinge = model.joint("hinge_0")
    np.testing.assert_allclose(hinge.range, [-np.pi / 2, np.pi / 2])
    np.testing.assert_allclose(hinge.axis, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(model.actuator("hinge_0").forcerange, [-4.5, 4.5])
    assert model.actuator("hinge_0").gainprm[0] == 120.0
    assert model.joint("hinge_0").armature[0] == 0.01
    touching = np.flatnonzero(model.geom_contype)
    assert (model.geom_priority[touching] == 1).all()
    assert (model.geom_friction[touching, 0] == config.friction).all()


def test_a_track_stands_on_its_outer_wheels():
    lower = np.array([place for place in find_road_wheels(ScoutConfig()) if place[2] < 0])
    is_middle = lower[:, 0] == 0.0
    assert is_middle.sum() == 2
    np.testing.assert_allclose(lower[~is_middle, 2], -0.0325)
    np.testing.assert_allclose(lower[is_middle, 2], -0.0325 + MIDDLE_RISE)


def test_docks_and_sensors_lie_where_the_sources_say():
    model = make_scout().compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.site("module_0_dock_front").xpos, [0.072, 0, 0], atol=1e-12)
    np.testing.assert_allclose(data.site("module_0_dock_back").xpos, [-0.0525, 0, 0], atol=1e-12)
    for side, direction in {"front": [1, 0], "back": [-1, 0], "left": [0, 1], "right": [0, -1]}.items():
        for k in range(2):
            site = data.site(f"module_0_ir_{side}_{k}")
            np.testing.assert_allclose(site.xmat.reshape(3, 3)[:2, 2], direction, atol=1e-9)
            assert np.abs(site.xpos).max() == pytest.approx(0.0525)


def test_module_drives_at_the_speed_of_its_tracks():
    model, data = _put_in_a_room(snake(1))
    places, _ = _run(model, data, 3.0)
    assert places[-1, 0, 0] - places[199, 0, 0] == pytest.approx(0.2, rel=0.03)
    assert abs(places[-1, 0, 1]) < 0.005


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_module_against_a_wall_does_not_climb(direction):
    """It may rear up onto an edge and even tip over, as short vehicles do, but never rises beyond that."""
    model, data = _put_in_a_room(snake(1, ScoutConfig(friction=0.9)), 0.15, -0.15)
    model.geom_surfacevel[:] *= direction
    places, _ = _run(model, data, 12.0)
    assert places[:, 0, 2].max() < 0.0525 * np.sqrt(2) + 0.005


def test_a_limp_body_on_a_ramp_comes_to_rest():
    model, data = _put_in_a_room(snake(4, ScoutConfig(track_speed=0.0)), slope=np.arctan(0.25))
    model.actuator_gainprm[:], model.actuator_biasprm[:] = 0.0, 0.0
    data.qpos[2] = 0.30
    _run(model, data, 4.0)
    assert np.abs(data.qvel).max() < 0.01


def test_modules_do_not_pass_through_each_other():
    model, data = _put_in_a_room(snake(6, ScoutConfig(track_speed=0.0)))
    model.opt.gravity[:] = 0
    data.qpos[2] = 2.0
    data.ctrl[:] = np.pi / 2
    places, _ = _run(model, data, 4.0)
    for gap in range(2, 6):
        assert np.linalg.norm(places[:, gap:] - places[:, :-gap], axis=2).min() > 0.085


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"track_radius": 0.0}, "track_radius"),
        ({"pitch": np.nan}, "pitch"),
        ({"friction": 1e6}, "friction must be a number from 0.001 to 5"),
        ({"track_speed": 100.0}, "track_speed must be a number from 0 to 2"),
        ({"dofs": 3}, "dofs must be 1"),
        ({"dofs": True}, "dofs must be 1"),
    ],
)
def test_impossible_constants_are_refused(change, message):
    with pytest.raises(OrganismError, match=message):
        ScoutConfig(**change)


def test_rays_begin_and_look_as_the_sites_of_the_model():
    model = make_scout().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [f"ir_{side}_{k}" for side in SIDES for k in range(2)] + [f"laser_{k}" for k in range(19)]
    sites = [next(i for i in range(model.nsite) if model.site(i).name.endswith(name)) for name in names]
    body = data.body(int(model.site_bodyid[sites[0]]))
    rotation = body.xmat.reshape(3, 3)
    rays = find_scout_rays()
    assert len(rays.origins) == len(sites)
    origins = (data.site_xpos[sites] - body.xpos) @ rotation
    directions = data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2] @ rotation
    np.testing.assert_allclose(origins, rays.origins, atol=1e-9)
    np.testing.assert_allclose(directions, rays.directions, atol=1e-9)
