"""Infrared, tilt, odometry and laser of kinematic robots against distances known by hand."""

import mujoco
import numpy as np
import pytest
from swarm_cases import FLOOR, make_block, make_floor, make_sheet, make_world

from symbrion_gym._src.robot.scout import LASER_HEIGHT, find_scout_rays
from symbrion_gym._src.swarm.docks import SCOUT
from symbrion_gym._src.swarm.senses import Senses
from symbrion_gym._src.swarm.world import SwarmCommands

HALF = SCOUT.size[0] / 2


def make_senses(poses, arena=FLOOR, noise=0.0, seed=0):
    world = make_world(poses, arena)
    return world, Senses(world, noise, seed)


def test_a_wall_is_seen_by_the_units_that_look_at_it_even_if_it_has_no_thickness():
    _, senses = make_senses([[0.0, 0.0, 0.0]], make_floor(make_sheet(0.15)))
    proximity = senses.read()["proximity"][0]
    np.testing.assert_allclose(proximity[:2], 0.15 - HALF, atol=1e-6)
    np.testing.assert_array_equal(proximity[2:], SCOUT.ir_range)


def test_another_robot_is_seen_at_the_face_of_its_box():
    _, senses = make_senses([[0.0, 0.0, np.pi], [0.25, 0.0, 0.0]])
    proximity = senses.read()["proximity"]
    np.testing.assert_allclose(proximity[:, 2:4], 0.25 - 2 * HALF, atol=1e-9)  # back to back
    np.testing.assert_array_equal(np.delete(proximity, [2, 3], axis=1), SCOUT.ir_range)
    _, senses = make_senses([[0.0, 0.0, 0.0], [0.25, 0.07, 0.0]])  # off to one side: one unit sees it
    np.testing.assert_allclose(senses.read()["proximity"][0, :2], [0.25 - 2 * HALF, SCOUT.ir_range])


def test_the_laser_sees_the_floor_where_its_beams_meet_it_and_the_nearest_robot_ahead():
    world, senses = make_senses([[0.0, 0.0, 0.0], [1.2, 0.0, 0.3], [0.6, 0.0, 0.3]])
    laser = senses.read()["laser"]
    np.testing.assert_array_equal(Senses(world, 0.0, beams=7).read()["laser"], laser[:, :7])
    angles = np.linspace(*SCOUT.laser_angles, SCOUT.laser_beams)
    height = SCOUT.size[2] / 2 + LASER_HEIGHT
    down = angles < -0.3
    np.testing.assert_allclose(laser[0, down], height / np.sin(-angles[down]), rtol=1e-5)
    level = np.abs(angles).argmin()
    assert 0.4 < laser[0, level] < 0.6 - HALF
    assert laser[1, -1] == SCOUT.laser_range


def test_tilt_is_pitch_and_roll():
    arena = make_floor(tilt=0.2)
    _, senses = make_senses([[0.0, 0.0, 0.0], [0.0, 1.0, np.pi], [0.0, -1.0, -np.pi / 2]], arena)
    np.testing.assert_allclose(senses.read()["tilt"], [[0.2, 0.0], [-0.2, 0.0], [0.0, 0.2]], atol=1e-9)


def test_odometry_is_what_the_tracks_ran_since_the_last_reading():
    world, senses = make_senses([[0.0, 0.0, 0.0]])
    for _ in range(2):
        world.step(SwarmCommands(np.array([[0.1, -0.05]]), np.zeros(1), np.zeros((1, 4), bool)))
    np.testing.assert_allclose(senses.read()["odometry"], [[0.02, -0.01]])
    np.testing.assert_allclose(senses.read()["odometry"], 0.0, atol=1e-15)


def test_rays_agree_with_the_rangefinder_of_a_running_simulation():
    """Boxes and surface of the same places, cast by MuJoCo in one model."""
    arena = make_floor(make_block(0.3, 0.2, (0.1, 0.4, 0.2)), make_sheet(1.2))
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(-0.4, 0.1, 6), np.linspace(-1.0, 1.0, 6), rng.uniform(-3, 3, 6)])
    world, senses = make_senses(poses, arena)
    spec = mujoco.MjSpec()
    surface = arena.surface
    spec.add_mesh(name="s", uservert=surface.vertices.ravel(), userface=surface.faces.ravel().astype(np.int32),
                  inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)  # fmt: skip
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="s")
    bodies = [spec.worldbody.add_body(name=f"r{i}", mocap=True) for i in range(6)]
    for body in bodies:
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=np.array(SCOUT.size) / 2)
    model = spec.compile()
    data = mujoco.MjData(model)
    for i in range(6):
        data.mocap_pos[i] = world.state.position[i]
        mujoco.mju_mat2Quat(data.mocap_quat[i], world.state.rotation[i].ravel())
    mujoco.mj_kinematics(model, data)
    rays = find_scout_rays(SCOUT)
    reading = senses.read()
    found = np.concatenate([reading["proximity"], reading["laser"]], axis=1)
    geom = np.zeros(1, np.int32)
    for i in range(6):
        for k in range(len(rays.origins)):
            start = world.state.rotation[i] @ rays.origins[k] + world.state.position[i]
            ahead = world.state.rotation[i] @ rays.directions[k]
            true = mujoco.mj_ray(model, data, start, ahead, None, 1, model.body(f"r{i}").id, geom)
            true = rays.max_ranges[k] if true < 0 else min(true, rays.max_ranges[k])
            assert found[i, k] == pytest.approx(true, abs=1e-5), (i, k)


def test_noise_comes_from_the_seed_and_stays_in_range():
    poses, arena = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]], make_floor(make_sheet(0.45))
    readings = [make_senses(poses, arena, 1.0, seed)[1].read() for seed in (1, 1, 2)]
    exact = make_senses(poses, arena)[1].read()
    for name, values in readings[0].items():
        np.testing.assert_array_equal(values, readings[1][name])
        if name != "odometry":
            assert (values != readings[2][name]).any()
            np.testing.assert_allclose(values, exact[name], atol=0.1)
    assert (readings[0]["proximity"] <= SCOUT.ir_range).all()
