"""Welds while docks mate, and the loads that latched docks carry."""

import numpy as np
import pytest

from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.docks import DockConfig
from symbrion_gym._src.swarm.dynamic.transfer import compute_error, compute_share, has_mated
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from tests.symbrion_gym.swarm.dynamic_cases import ARENA, BACK, FRONT, latch_row, make_docked, make_row

NEVER = 1e6


def make_welded(gap, mating_time=NEVER):
    world = DynamicWorld(ARENA, 2, docks=DockConfig(mating_time=mating_time))
    world.reset(make_row(2, gap))
    return world, latch_row(2)


def push(world, robot, force):
    body = world.assembly.model.site_bodyid[world.assembly.sites[robot]]
    world.data.xfrc_applied[body, :3] = force


def test_weld_holds_the_pose_in_which_docks_latched():
    world, commands = make_welded(gap=0.005)
    before = world.state.position.copy()
    for _ in range(5):
        world.step(commands)
    assert len(world.assembly.layout.welds) == 1
    np.testing.assert_allclose(world.state.position[:, 0], before[:, 0], atol=3e-4)
    offset, _ = compute_error(world.assembly, world.data, world.state.links[0], world.scout)
    assert offset[0] == pytest.approx(0.005, abs=2e-4)


def test_docks_mate_in_the_time_that_is_given():
    world, commands = make_welded(gap=0.006, mating_time=0.5)
    for _ in range(6):
        world.step(commands)
    assert has_mated(world.assembly, world.data, world.state.links[0], world.scout)


def test_share_begins_and_ends_at_rest():
    assert [compute_share(t, 2.0) for t in (0.0, 1.0, 2.0, 3.0)] == [1.0, 0.5, 0.0, 0.0]
    assert compute_share(0.0, 0.0) == 0.0


@pytest.mark.parametrize("is_welded", [True, False])
def test_load_of_a_pulled_pair_is_half_of_the_pull(is_welded):
    if is_welded:
        world, commands = make_welded(gap=0.0)
        for _ in range(5):
            world.step(commands)
    else:
        world, commands = make_docked(2)
    world.assembly.model.opt.gravity[:] = 0.0
    world.data.qpos[2] += 1.0
    if is_welded:
        world.data.qpos[world.assembly.find_root(world.assembly.layout.trees[1])[0] + 2] += 1.0
    world.data.qvel[:] = 0.0
    push(world, 1, [-20.0, 0.0, 0.0])
    world.step(commands, 0.02)
    assert world.state.load[0, BACK] == pytest.approx(10.0, rel=0.03)
    assert world.state.load[1, FRONT] == world.state.load[0, BACK]


def test_nothing_latched_carries_nothing():
    world = DynamicWorld(ARENA, 2)
    world.reset(make_row(2, gap=0.1))
    world.step(latch_row(2))
    assert not world.state.load.any()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_latch_gives_less_than_a_millimeter_at_its_largest_load(axis):
    world, commands = make_welded(gap=0.0)
    for _ in range(5):
        world.step(commands)
    model, data = world.assembly.model, world.data
    docks = [world.assembly.docks[robot, SIDES.index(side)] for robot, side in world.state.links[0].ends]
    for _ in range(10):
        place = data.site_xpos[docks].mean(axis=0)
        for dock, sign in zip(docks, (-1.0, 1.0), strict=True):
            body = model.site_bodyid[dock]
            force = sign * world.scout.dock_force * np.eye(3)[axis]
            data.xfrc_applied[body] = [*force, *np.cross(place - data.xipos[body], force)]
        world.step(commands, 0.02)
    offset, turn = compute_error(world.assembly, data, world.state.links[0], world.scout)
    assert np.linalg.norm(offset) < 1e-3
    assert np.rad2deg(np.linalg.norm(turn)) < 0.5
    assert world.state.load[0, BACK] == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize("tears", [True, False])
def test_latches_tear_only_where_they_are_told_to(tears):
    world, commands = make_docked(2, tears=tears)
    push(world, 1, [-150.0, 0.0, 300.0])
    world.step(commands, 0.02)
    assert world.state.load[0, BACK] > world.scout.dock_force
    world.step(commands, 0.02)
    assert (world.state.links == ()) == tears
