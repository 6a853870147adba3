"""Robots in full contact: alone, mating, as one organism, and apart again."""

import mujoco
import numpy as np
import pytest
from swarm_cases import ARENA, latch_row, make_docked, make_row

import symbrion_gym as sg
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm.docks import MATING_TIME
from symbrion_gym._src.swarm.dynamic.transfer import compute_error, compute_share, has_mated, read_motion
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld, read_organism
from symbrion_gym._src.swarm.world import FOLDED, FRONT, SwarmCommands


def make_world(poses) -> DynamicWorld:
    world = DynamicWorld(ARENA, len(poses))
    world.reset(np.array(poses, float))
    return world


def run(world, commands, steps) -> None:
    for _ in range(steps):
        world.step(commands)


def test_robots_stand_where_they_are_placed():
    poses = np.array([[-2.0, 0.3, 1.0], [-0.5, -0.3, -2.0]])
    world = make_world(poses)
    run(world, SwarmCommands.make_idle(2), 5)
    np.testing.assert_allclose(world.state.position[:, :2], poses[:, :2], atol=2e-3)
    np.testing.assert_allclose(world.state.position[:, 2], [0.0525, 0.3025], atol=1e-3)
    assert np.abs(world.state.velocity).max() < 1e-3


def test_tracks_drive_and_turn():
    world = make_world([[-2.0, 0.3, 0.0], [-2.0, -0.3, 0.0]])
    commands = SwarmCommands.make_idle(2)._replace(tracks=np.array([[0.05, 0.05], [-0.05, 0.05]]))
    run(world, commands, 10)
    assert world.state.position[0, 0] == pytest.approx(-1.95, abs=0.003)
    assert np.arctan2(*world.state.rotation[1, 1::-1, 0]) == pytest.approx(0.95, abs=0.2)
    np.testing.assert_allclose(world.state.odometry, 10 * 0.1 * commands.tracks)


@pytest.mark.slow
def test_a_row_becomes_the_organism_of_snake_to_the_last_digit():
    world, _ = make_docked(3)
    (tree,) = world.assembly.layout.trees
    assert tree.organism == sg.snake(3, world.scout)
    assert world.state.links == (Docking(0, "back", 1, "front"), Docking(1, "back", 2, "front"))
    model, exact = world.assembly.model, sg.snake(3, world.scout).spec().compile()
    assert model.nv == exact.nv
    for name in ("body_mass", "body_inertia", "body_ipos", "body_pos"):
        np.testing.assert_array_equal(getattr(model, name)[1:], getattr(exact, name)[1:])
    np.testing.assert_array_equal(model.dof_armature, exact.dof_armature)


def test_a_weld_holds_the_pose_in_which_docks_latched_and_pulls_them_to_the_exact_one():
    world = make_world(make_row(2, gap=0.006))
    errors = []
    for _ in range(round(MATING_TIME / 0.1)):
        world.step(latch_row(2))
        errors.append(compute_error(world.assembly, world.data, world.state.links[0])[0][0])
        assert len(world.assembly.layout.welds) == 1
    shares = [compute_share(0.1 * (step + 1)) for step in range(len(errors))]
    np.testing.assert_allclose(errors, 0.006 * np.array(shares), atol=4e-4)
    assert has_mated(world.assembly, world.data, world.state.links[0])
    assert [compute_share(time) for time in (0.0, MATING_TIME / 2, MATING_TIME, 9.0)] == [1.0, 0.5, 0.0, 0.0]


@pytest.mark.slow
def test_neither_joining_nor_parting_jumps(monkeypatch):
    world, changes = make_world(make_row(3, gap=0.006)), []

    def enter(layout, before, same, enter=world._enter):
        enter(layout, before, same)
        after = read_motion(world.assembly, world.data)
        turn = np.abs(after.rotation - before.rotation).max()
        changes.append(
            (np.ptp(after.position - before.position), turn, np.ptp(after.velocity - before.velocity))
        )

    monkeypatch.setattr(world, "_enter", enter)
    run(world, latch_row(3, 0.05), 35)
    run(world, latch_row(3, 0.05)._replace(latch=np.zeros((3, 4), bool)), 2)
    assert len(changes) >= 4
    position, turn, velocity = np.max(changes, axis=0)
    assert position < 1e-4
    assert turn < np.deg2rad(0.1)
    assert velocity < 5e-3


def test_release_lets_robots_drive_away():
    world, _ = make_docked(2)
    commands = SwarmCommands.make_idle(2)._replace(tracks=np.array([[0.08, 0.08], [-0.08, -0.08]]))
    run(world, commands, 5)
    assert world.state.links == ()
    assert np.linalg.norm(world.state.position[0] - world.state.position[1]) > 0.17
    assert world.assembly.model.nv == 14


def test_free_arms_of_an_organism_fold_unless_their_dock_is_to_latch():
    world, commands = make_docked(2)
    assert world.state.hinge[0] == FOLDED
    commands.latch[0, FRONT] = True
    run(world, commands, 25)
    assert abs(world.state.hinge[0]) < 0.05
    assert not world.assembly.layout.trees[0].is_organism


@pytest.mark.slow
def test_an_organism_is_read_as_one_and_hinges_lift_what_is_docked():
    world, commands = make_docked(3)
    run(world, commands, 5)
    parts = read_organism(world, [0, 1, 2])
    assert [len(parts[name]) for name in ("hinge_angle", "pitch", "roll", "contact")] == [2, 3, 3, 3]
    assert np.abs(parts["pitch"]).max() < 0.01
    weight = 3 * (world.scout.chassis_mass + world.scout.arm_mass) * 9.81
    assert parts["contact"].sum() == pytest.approx(weight, rel=0.05)
    run(world, commands._replace(hinge=np.array([0.0, 0.3, 0.0])), 15)
    assert world.state.hinge[1] == pytest.approx(0.3, abs=0.05)
    assert world.state.position[0, 2] > 0.06
    with pytest.raises(OptionError, match="not one organism"):
        read_organism(world, [0, 1])


def test_a_reset_forgets_the_past_and_equal_runs_have_equal_bits():
    world, _ = make_docked(2)
    world.reset(make_row(2, gap=0.004))
    fresh = make_world(make_row(2, gap=0.004))
    for each in (world, fresh):
        run(each, latch_row(2), 2)
    for one, other in zip(world.state, fresh.state, strict=True):
        np.testing.assert_array_equal(one, other)


def test_matrices_stay_dense_from_60_degrees_of_freedom_on_and_nine_robots_fall_as_one_does():
    """MuJoCo 4.0.0 factors sparse ones wrongly there."""
    worlds = [
        make_world([[-2.4 + 0.3 * (i % 5), 0.4 * (i // 5), 0.0] for i in range(count)]) for count in (9, 1)
    ]
    for world in worlds:
        run(world, SwarmCommands.make_idle(world.num_robots), 10)
    assert worlds[0].assembly.model.nv == 63
    assert not mujoco.mj_isSparse(worlds[0].assembly.model)
    np.testing.assert_allclose(worlds[0].state.position[0], worlds[1].state.position[0], atol=1e-5)


@pytest.mark.parametrize(
    ("other", "error", "what"),
    [
        ((-2.05, 0.0, 0.5), ArenaError, "overlap"),
        ((9.0, 0.0, 0.0), ArenaError, "off the surface"),
        ((np.nan, 0.0, 0.0), OptionError, "finite"),
    ],
)
def test_impossible_places_are_refused(other, error, what):
    with pytest.raises(error, match=what):
        make_world([[-2.0, 0.0, 0.0], other])


def test_impossible_commands_are_refused():
    world, idle = make_world([[-2.0, 0.0, 0.0]]), SwarmCommands.make_idle(1)
    for bad in (idle._replace(tracks=np.zeros((2, 2))), idle._replace(hinge=np.array([np.inf]))):
        with pytest.raises(OptionError, match=r"commands\."):
            world.step(bad)
    with pytest.raises(OptionError, match="duration"):
        world.step(idle, 0.013)
