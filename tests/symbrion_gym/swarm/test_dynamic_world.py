"""Robots in full contact: alone, mating, as one organism, and apart again."""

import mujoco
import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import DockConfig
from symbrion_gym._src.swarm.dynamic.motion import (
    FOLDED,
    compute_jump,
    compute_kinetic_energy,
    compute_momentum,
)
from symbrion_gym._src.swarm.dynamic.world import DynamicConfig, DynamicWorld
from symbrion_gym._src.swarm.world import SwarmCommands
from tests.symbrion_gym.swarm.dynamic_cases import ARENA, FRONT, latch_row, make_docked, make_row


def test_robots_stand_where_they_are_placed():
    world = DynamicWorld(ARENA, 2)
    poses = np.array([[-2.0, 0.3, 1.0], [-0.5, -0.3, -2.0]])
    world.reset(poses)
    for _ in range(5):
        world.step(SwarmCommands.make_idle(2))
    np.testing.assert_allclose(world.state.position[:, :2], poses[:, :2], atol=2e-3)
    np.testing.assert_allclose(world.state.position[:, 2], [0.0525, 0.3025], atol=1e-3)
    assert np.abs(world.state.velocity).max() < 1e-3


def test_tracks_drive_and_turn():
    world = DynamicWorld(ARENA, 2)
    world.reset(np.array([[-2.0, 0.3, 0.0], [-2.0, -0.3, 0.0]]))
    commands = SwarmCommands.make_idle(2)._replace(tracks=np.array([[0.05, 0.05], [-0.05, 0.05]]))
    for _ in range(10):
        world.step(commands)
    assert world.state.position[0, 0] == pytest.approx(-1.95, abs=0.003)
    assert world.state.spin[1, 2] == pytest.approx(1.0, abs=0.35)
    np.testing.assert_allclose(world.state.odometry, 10 * 0.1 * commands.tracks)


def test_row_becomes_the_organism_of_snake():
    world, _ = make_docked(3)
    (tree,) = world.assembly.layout.trees
    assert tree.organism == sg.snake(3, world.scout)
    assert world.state.links == (Docking(0, "back", 1, "front"), Docking(1, "back", 2, "front"))


def test_tree_is_that_of_the_organism_to_the_last_digit():
    world, _ = make_docked(3)
    model, exact = world.assembly.model, sg.snake(3, world.scout).spec().compile()
    assert model.nv == exact.nv
    for name in ("body_mass", "body_inertia", "body_ipos", "body_pos"):
        np.testing.assert_array_equal(getattr(model, name)[1:], getattr(exact, name)[1:])
    np.testing.assert_array_equal(model.dof_armature, exact.dof_armature)


def test_neither_joining_nor_parting_jumps():
    world = DynamicWorld(ARENA, 3, docks=DockConfig(mating_time=0.3))
    world.reset(make_row(3, gap=0.006))
    changes = []
    for commands, count in (
        (latch_row(3, 0.05), 35),
        (latch_row(3, 0.05)._replace(latch=np.zeros((3, 4), bool)), 2),
    ):
        for _ in range(count):
            world.step(commands)
            if world.conversion is not None:
                changes.append(world.conversion)
                world.conversion = None
    assert len(changes) >= 4
    for before, after in changes:
        position, angle, velocity = compute_jump(before, after)
        assert position < 1e-4
        assert angle < np.deg2rad(0.1)
        assert velocity < 5e-3
        lost = compute_momentum(after, world.scout)[0] - compute_momentum(before, world.scout)[0]
        assert np.linalg.norm(lost) < 1e-9
        gained = (
            compute_kinetic_energy(after, world.scout).sum()
            - compute_kinetic_energy(before, world.scout).sum()
        )
        assert gained < 1e-9


def test_release_lets_robots_drive_away():
    world, _ = make_docked(2)
    commands = SwarmCommands.make_idle(2)._replace(tracks=np.array([[0.08, 0.08], [-0.08, -0.08]]))
    for _ in range(5):
        world.step(commands)
    assert world.state.links == ()
    assert np.linalg.norm(world.state.position[0] - world.state.position[1]) > 0.17
    assert world.assembly.model.nv == 14


def test_free_arms_of_an_organism_fold_unless_their_dock_is_to_latch():
    world, commands = make_docked(2)
    assert world.state.hinge[0] == FOLDED
    commands.latch[0, FRONT] = True
    for _ in range(25):
        world.step(commands)
    assert abs(world.state.hinge[0]) < 0.05
    assert not world.assembly.layout.trees[0].is_organism


def test_hinges_lift_what_is_docked():
    world, commands = make_docked(3)
    commands = commands._replace(hinge=np.array([0.0, 0.3, 0.0]))
    for _ in range(15):
        world.step(commands)
    assert world.state.hinge[1] == pytest.approx(0.3, abs=0.05)
    assert world.state.position[0, 2] > 0.06


def test_equal_runs_have_equal_bits():
    states = []
    for _ in range(2):
        world, commands = make_docked(3, gap=0.004)
        world.step(commands)
        states.append(world.state)
    for one, other in zip(states[0][:5], states[1][:5], strict=True):
        np.testing.assert_array_equal(one, other)


def test_reset_forgets_the_past():
    world, _ = make_docked(2)
    world.reset(make_row(2, gap=0.2))
    fresh = DynamicWorld(ARENA, 2, docks=world.docks)
    fresh.reset(make_row(2, gap=0.2))
    for each in (world, fresh):
        each.step(SwarmCommands.make_idle(2))
    np.testing.assert_array_equal(world.state.position, fresh.state.position)


def test_matrices_stay_dense_from_60_degrees_of_freedom_on():
    """MuJoCo 4.0.0 factors sparse ones wrongly there."""
    world = DynamicWorld(ARENA, 9)
    assert world.assembly.model.nv == 63
    assert not mujoco.mj_isSparse(world.assembly.model)


def test_nine_robots_fall_as_one_does():
    worlds = [DynamicWorld(ARENA, count) for count in (9, 1)]
    for world in worlds:
        world.reset(np.array([[-2.4 + 0.3 * (i % 5), 0.4 * (i // 5), 0.0] for i in range(world.num_robots)]))
        for _ in range(10):
            world.step(SwarmCommands.make_idle(world.num_robots))
    np.testing.assert_allclose(worlds[0].state.position[0], worlds[1].state.position[0], atol=1e-5)


@pytest.mark.parametrize(
    ("poses", "what"),
    [
        ([[-2.0, 0.0, 0.0], [-2.05, 0.0, 0.5]], "overlap"),
        ([[-2.0, 0.0, 0.0], [9.0, 0.0, 0.0]], "off the surface"),
        ([[-2.0, 0.0, 0.0], [-0.22, 0.0, 0.0]], "steep"),
        ([[-2.0, 0.0, 0.0], [np.nan, 0.0, 0.0]], "finite"),
    ],
)
def test_impossible_places_are_refused(poses, what):
    with pytest.raises(ArenaError, match=what):
        DynamicWorld(ARENA, 2).reset(np.array(poses))


def test_impossible_commands_are_refused():
    world = DynamicWorld(ARENA, 1)
    idle = SwarmCommands.make_idle(1)
    for bad in (idle._replace(tracks=np.zeros((2, 2))), idle._replace(hinge=np.array([np.inf]))):
        with pytest.raises(OptionError, match=r"commands\."):
            world.step(bad)
    with pytest.raises(OptionError, match="duration"):
        world.step(idle, 0.013)


def test_impossible_options_are_refused():
    with pytest.raises(OptionError, match="num_robots"):
        DynamicWorld(ARENA, 0)
    with pytest.raises(OptionError, match="dofs"):
        DynamicWorld(ARENA, 1, ScoutConfig(dofs=2))
    with pytest.raises(OptionError, match="tick"):
        DynamicConfig(timestep=0.003)
    with pytest.raises(OptionError, match="poses"):
        DynamicWorld(ARENA, 2).reset(np.zeros((1, 3)))
