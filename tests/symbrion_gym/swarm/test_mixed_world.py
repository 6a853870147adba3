"""Two levels of physics in one world: who is where, and what a change of level keeps."""

import numpy as np
import pytest

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.docks import DockConfig
from symbrion_gym._src.swarm.dynamic.transfer import read_motion
from symbrion_gym._src.swarm.mixed import MixedConfig, MixedWorld
from symbrion_gym._src.swarm.world import SwarmCommands
from tests.symbrion_gym.swarm.dynamic_cases import ARENA, BACK, FRONT, PITCH

POSES = np.array([[-1.8, 0.0, 0.0], [-1.806 - PITCH, 0.0, 0.02], [-2.4, 0.5, 0.5], [-2.4, -0.5, 0.0]])


def make_world(poses=POSES, **config):
    world = MixedWorld(ARENA, len(poses), docks=DockConfig(mating_time=0.3), config=MixedConfig(**config))
    world.reset(poses)
    return world


def make_commands(count=4, speed=0.0):
    commands = SwarmCommands.make_idle(count)
    commands.latch[0, BACK] = commands.latch[1, FRONT] = True
    commands.tracks[:] = speed
    return commands


def test_lone_robots_are_kinematic():
    world = make_world()
    world.step(SwarmCommands.make_idle(4))
    assert world.dynamic is None
    assert world.robots == ()


def test_docked_robots_are_dynamic_and_the_others_are_not():
    world = make_world()
    for _ in range(30):
        world.step(make_commands())
    assert world.robots == (0, 1)
    assert len(world.state.links) == 1
    dynamic, rows = world.find_dynamic([1, 0])
    assert rows == [1, 0]
    assert dynamic.assembly.layout.trees[0].is_organism


def test_all_go_on_at_both_levels():
    world = make_world()
    commands = make_commands(speed=0.05)
    for _ in range(20):
        world.step(commands)
    way = world.state.position - POSES[:, [0, 1, 1]]
    np.testing.assert_allclose(way[[0, 3], 0], 0.1, atol=0.012)
    np.testing.assert_allclose(world.state.odometry, 0.1, atol=1e-9)
    assert world.time == pytest.approx(2.0)


def test_change_to_dynamic_and_back_moves_nothing():
    world = make_world()
    commands = make_commands()
    for _ in range(10):
        world.step(commands)
    docked = world.state
    apart = SwarmCommands.make_idle(4)._replace(hinge=docked.hinge)
    world.step(apart)
    world.step(apart)
    moved = np.linalg.norm(world.state.position - docked.position, axis=1)
    assert moved.max() < 2e-3
    assert world.state.links == ()
    for _ in range(2):
        world.step(apart)
    assert world.robots == ()
    assert np.linalg.norm(world.state.position - docked.position, axis=1).max() < 2e-3


def test_mating_goes_on_when_another_robot_comes_near():
    poses = POSES.copy()
    poses[2] = [-1.8, 0.24, -np.pi / 2]
    world = make_world(poses)
    commands = make_commands()
    commands.tracks[2] = 0.1
    for _ in range(12):
        world.step(commands)
    assert world.robots == (0, 1, 2)
    assert len(world.state.links) == 1
    assert not world.dynamic.assembly.layout.welds


def test_a_robot_that_has_tipped_over_stays_dynamic():
    world = make_world()
    for _ in range(3):
        world.step(make_commands())
    assert world.robots == (0, 1)
    side = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    motion = read_motion(world.dynamic.assembly, world.dynamic.data)
    world.dynamic.begin(motion._replace(rotation=np.stack([motion.rotation[0], side])))
    idle = SwarmCommands.make_idle(4)
    for _ in range(3):
        world.step(idle)
    assert world.state.links == ()
    assert abs(world.state.rotation[1, 2, 2]) < 0.1
    assert 1 in world.robots


def test_robots_leave_the_dynamic_level_later_than_they_enter_it():
    poses = POSES.copy()
    poses[2] = [-1.8, 0.22, 0.0]
    world = make_world(poses)
    world.step(make_commands())
    assert world.robots == (0, 1)
    near = poses.copy()
    near[2, 1] = 0.19
    world.reset(near)
    world.step(make_commands())
    assert world.robots == (0, 1, 2)


def test_short_steps_add_up():
    worlds = [make_world() for _ in range(2)]
    commands = make_commands(speed=0.05)
    for _ in range(6):
        worlds[0].step(commands)
        for _ in range(5):
            worlds[1].step(commands, 0.02)
    np.testing.assert_allclose(worlds[0].state.position[2:], worlds[1].state.position[2:], atol=1e-12)
    np.testing.assert_allclose(worlds[0].state.position, worlds[1].state.position, atol=3e-3)


def test_equal_runs_have_equal_bits():
    states = []
    for _ in range(2):
        world = make_world()
        for _ in range(15):
            world.step(make_commands(speed=0.03))
        states.append(world.state)
    for one, other in zip(states[0][:5], states[1][:5], strict=True):
        np.testing.assert_array_equal(one, other)


def test_kinematic_robots_are_not_found_in_the_dynamic_world():
    world = make_world()
    with pytest.raises(OptionError, match="dynamic"):
        world.find_dynamic([0])


def test_far_below_near_is_refused():
    with pytest.raises(OptionError, match="far"):
        MixedConfig(near=0.3, far=0.2)
