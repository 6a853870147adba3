"""Kinematic robots: how they drive, what stops them, how they dock, and what is refused."""

import numpy as np
import pytest
from swarm_cases import FLOOR, make_block, make_floor, make_sheet, make_world

import symbrion_gym as sg
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm.docks import SCOUT, compute_dock_frames
from symbrion_gym._src.swarm.kinematic.kinematic_world import SLIP, KinematicWorld
from symbrion_gym._src.swarm.kinematic.motion import Poses, choose_roots, find_overlaps, find_pairs, hold_arms
from symbrion_gym._src.swarm.world import BACK, FRONT, SwarmCommands


def command(world, tracks, latch=False, hinge=0.0):
    count = world.num_robots
    tracks = np.broadcast_to(np.array(tracks, float), (count, 2))
    return SwarmCommands(tracks, np.full(count, hinge), np.full((count, 4), latch))


def run(world, steps, tracks, latch=False, hinge=0.0):
    for _ in range(steps):
        world.step(command(world, tracks, latch, hinge))
    return world.state


def test_a_robot_drives_straight_at_the_speed_of_its_tracks():
    state = run(make_world([0.0, 0.0, np.pi / 2]), 10, [0.1, 0.1])
    np.testing.assert_allclose(state.position[0], [0.0, 0.1, SCOUT.size[2] / 2], atol=1e-12)
    np.testing.assert_allclose(state.velocity[0], [0.0, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(state.odometry[0], [0.1, 0.1])


@pytest.mark.parametrize(("hinge", "rate", "pivot"), [(np.pi / 2, 0.768, 0.0), (0.0, 1.001, 0.0202)])
def test_a_robot_turns_as_in_full_contact(hinge, rate, pivot):
    """Rates and pivots of a Scout in MuJoCo at 0.05 m/s."""
    world = make_world([0.0, 0.0, 0.0])
    run(world, 20, [0.0, 0.0], hinge=hinge)
    state = run(world, 10, [-0.05, 0.05], hinge=hinge)
    assert np.arctan2(*state.rotation[0, 1::-1, 0]) == pytest.approx(rate, rel=0.02)
    assert np.linalg.norm(state.velocity[0]) == pytest.approx(pivot * rate, abs=0.002)


def test_a_robot_tilts_with_the_ground_and_drives_along_it():
    arena = make_floor(tilt=0.2)
    world = make_world([0.0, 0.0, 0.0], arena)
    start = world.state.position[0]
    np.testing.assert_allclose(start, [0.0, 0.0, SCOUT.size[2] / 2 / np.cos(0.2)], atol=1e-9)
    state = run(world, 10, [0.1, 0.1])
    assert np.arcsin(state.rotation[0, 2, 0]) == pytest.approx(0.2)
    np.testing.assert_allclose(
        state.position[0] - start, [0.1 * np.cos(0.2), 0.0, 0.1 * np.sin(0.2)], atol=1e-9
    )
    np.testing.assert_allclose(state.rotation[0] @ state.rotation[0].T, np.eye(3), atol=1e-12)


def test_the_first_ramp_of_the_course_is_climbed_and_the_pit_stops_the_robot():
    world = make_world([-1.8, 0.0, 0.0], sg.load_arena("truth"))
    state = run(world, 250, [0.1, 0.1])
    assert world.blocked[0]
    edge = -sg.load_arena("truth").course.pit / 2
    assert edge - 0.08 < state.position[0, 0] <= edge - SCOUT.size[0] / 2 + 0.01
    assert state.position[0, 2] == pytest.approx(0.25 + SCOUT.size[2] / 2)
    turned = run(world, 15, [-0.1, 0.1])
    assert turned.rotation[0, 0, 0] < -0.9
    assert run(world, 10, [0.1, 0.1]).position[0, 0] < turned.position[0, 0]


@pytest.mark.parametrize("thing", [make_sheet(0.3), make_block(0.4, 0.0, (0.2, 0.5, 0.3))])
def test_walls_stop_a_robot_before_they_are_within_it(thing):
    world = make_world([0.0, 0.0, 0.0], make_floor(thing))
    state = run(world, 60, [0.1, 0.1])
    assert world.blocked[0]
    assert 0.23 < state.position[0, 0] <= 0.3 - SCOUT.size[0] / 2


def test_low_steps_do_not_stop_a_robot_and_higher_ones_do():
    for height, is_climbed in ((0.008, True), (0.015, False)):
        world = make_world([0.0, 0.0, 0.0], make_floor(make_block(0.8, 0.0, (1.0, 1.0, height))))
        run(world, 60, [0.1, 0.1])
        assert world.blocked[0] != is_climbed
        assert (world.state.position[0, 0] > 0.5) == is_climbed


def test_the_end_of_the_surface_stops_a_robot():
    world = make_world([1.7, 0.0, 0.0])
    assert run(world, 60, [0.1, 0.1]).position[0, 0] < 2.0
    assert world.blocked[0]


def test_robots_stop_at_each_other_and_never_overlap():
    world = make_world([[0.0, 0.0, 0.0], [0.4, 0.0, np.pi]])
    state = run(world, 40, [0.1, 0.1])
    gap = state.position[1, 0] - state.position[0, 0]
    assert world.blocked.all()
    assert 2 * SCOUT.arm_reach <= gap < 2 * SCOUT.arm_reach + 0.021
    folded = make_world([[0.0, 0.0, 0.0], [0.4, 0.0, np.pi]])
    run(folded, 25, [0.0, 0.0], hinge=np.pi / 2)
    state = run(folded, 40, [0.1, 0.1], hinge=np.pi / 2)
    assert SCOUT.size[0] <= state.position[1, 0] - state.position[0, 0] < SCOUT.size[0] + 0.021


def test_a_standing_robot_does_not_stop_one_that_drives_away():
    world = make_world([[0.0, 0.0, np.pi], [0.106, 0.0, 0.0]])
    tracks = np.array([[0.1, 0.1], [0.0, 0.0]])
    run(world, 10, tracks)
    assert world.state.position[0, 0] == pytest.approx(-0.1)
    assert not world.blocked.any()


def dock_front_to_back(gap=0.005, offset=0.0, angle=0.0):
    """Return a world of two robots, the front dock of robot 1 near the back dock of robot 0."""
    world = make_world([[0.0, 0.0, 0.0], [-SCOUT.pitch - gap, offset, angle]])
    run(world, 1, [0.0, 0.0], latch=True)
    return world


def test_docks_within_tolerance_latch_and_reach_their_exact_pose():
    world = dock_front_to_back(offset=0.004, angle=0.05)
    assert world.state.links == (Docking(0, "back", 1, "front"),)
    before = world.state
    for _ in range(11):
        last, state = world.state, run(world, 1, [0.0, 0.0], latch=True)
        assert np.linalg.norm(state.position - last.position, axis=1).max() < 0.002  # no jump
    assert np.linalg.norm(before.position[1] - state.position[1]) > 0.004  # it was off
    place, axis, _ = compute_dock_frames(state)
    np.testing.assert_allclose(place[1, FRONT] - place[0, BACK], SCOUT.dock_gap * axis[0, BACK], atol=1e-9)
    np.testing.assert_allclose(axis[1, FRONT], -axis[0, BACK], atol=1e-9)


def test_a_docked_group_moves_as_one_rigid_body_and_parts_on_release():
    world = dock_front_to_back()
    run(world, 12, [0.0, 0.0], latch=True)
    distance = np.linalg.norm(np.diff(world.state.position, axis=0))
    state = run(world, 30, [-0.05, 0.1], latch=True)
    assert np.linalg.norm(np.diff(state.position, axis=0)) == pytest.approx(distance)
    np.testing.assert_allclose(state.rotation[0], state.rotation[1], atol=1e-9)
    assert np.linalg.norm(state.velocity[0]) > 0.01
    world.step(command(world, [[0.1, 0.1], [0.0, 0.0]]))
    assert world.state.links == ()
    state = run(world, 10, [[0.1, 0.1], [0.0, 0.0]])
    assert np.linalg.norm(np.diff(state.position, axis=0)) == pytest.approx(distance + 0.11, abs=1e-6)


def test_a_newcomer_does_not_move_the_organism_to_which_it_docks():
    world = make_world([[-SCOUT.pitch - 0.006, 0.004, 0.05], [0.0, 0.0, 0.0], [SCOUT.pitch, 0.0, 0.0]])
    latch = np.zeros((3, 4), bool)
    latch[1:] = True
    stand = np.zeros((3, 2))
    for _ in range(12):
        world.step(SwarmCommands(stand, np.zeros(3), latch))
    before = world.state.position
    run(world, 12, stand, latch=True)
    assert len(world.state.links) == 2
    np.testing.assert_allclose(world.state.position[1:], before[1:], atol=1e-9)
    assert np.linalg.norm(world.state.position[0] - before[0]) > 0.005
    still = np.zeros(4)
    assert choose_roots(np.array([0, 0, 0, 3]), np.array([0, 1, 1, 3]), still).tolist() == [1, 1, 1, 3]
    assert choose_roots(np.arange(4), np.array([1, 1, 1, 3]), still).tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("drives", [0, 1])
def test_of_two_robots_that_dock_the_one_that_stands_keeps_its_pose(drives):
    speed = 0.02 * (np.arange(3) == drives)
    assert choose_roots(np.array([0, 0, 2]), np.arange(3), speed).tolist() == [1 - drives, 1 - drives, 2]


def test_a_member_that_cannot_move_holds_its_group():
    world = make_world([[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0]], make_floor(make_sheet(0.07)))
    state = run(world, 30, [0.1, 0.1], latch=True)
    assert world.blocked.all()
    assert state.position[0, 0] <= 0.07 - SCOUT.size[0] / 2
    assert state.position[0, 0] - state.position[1, 0] == pytest.approx(SCOUT.pitch)


def test_random_robots_never_reach_into_each_other():
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2) * 0.17
    rng = np.random.default_rng(0)
    world = make_world(np.column_stack([grid, rng.uniform(-3, 3, 20)]), slip=SLIP)
    for step in range(100):
        if step % 10 == 0:
            tracks, hinge = rng.uniform(-0.1, 0.1, (20, 2)), rng.uniform(-1.0, 1.6, 20)
            latch = rng.random((20, 4)) < 0.5
        world.step(SwarmCommands(tracks, hinge, latch))
        state = world.state
        outlines = Poses(state.position, state.rotation, state.hinge).outlines
        first, second = find_pairs(state.position, 0.3)
        apart = world.groups[first] != world.groups[second]
        assert find_overlaps(outlines[first[apart]], outlines[second[apart]]).max(initial=0.0) < 1e-4
        assert np.isfinite(state.position).all()


def test_equal_seeds_give_equal_bits_and_others_do_not():
    worlds = [make_world([0.0, 0.0, 0.0], slip=SLIP, seed=seed) for seed in (1, 1, 2)]
    ends = [run(world, 20, [0.1, 0.05]).position for world in worlds]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert (ends[0] != ends[2]).any()


def test_a_world_goes_on_from_a_state():
    world = dock_front_to_back()
    run(world, 12, [0.05, 0.1], latch=True)
    other = KinematicWorld(FLOOR, 2, slip=0.0)
    other.set_state(world.state, world.time)
    run(world, 5, [0.05, 0.1], latch=True)
    run(other, 5, [0.05, 0.1], latch=True)
    np.testing.assert_allclose(other.state.position, world.state.position, atol=1e-9)
    assert other.time == pytest.approx(world.time)


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ([[3.0, 0.0, 0.0]], "off the surface"),
        ([[0.5, 0.0, 0.0]], "step of 0.030"),
        ([[0.0, 1.0, 0.0], [0.05, 1.0, 0.0]], "overlap"),
    ],
)
def test_places_where_no_robot_can_stand_are_refused(poses, message):
    with pytest.raises(ArenaError, match=message):
        make_world(poses, make_floor(make_block(0.6, 0.0, (0.1, 0.5, 0.03))))


def test_steep_ground_is_refused():
    with pytest.raises(ArenaError, match="slope of 29 degrees; it climbs 20"):
        make_world([0.0, 0.0, 0.0], make_floor(tilt=0.5))


def test_impossible_poses_and_commands_are_refused():
    with pytest.raises(OptionError, match=r"\[2, 3\]"):
        KinematicWorld(FLOOR, 2).reset(np.zeros((1, 3)))
    world = make_world([0.0, 0.0, 0.0])
    with pytest.raises(OptionError, match="finite"):
        world.step(command(world, [np.nan, 0.0]))
    with pytest.raises(OptionError, match=r"tracks must be finite, of shape \(1, 2\)"):
        world.step(SwarmCommands.make_idle(2))


def test_an_arm_stops_at_a_robot_of_its_own_group():
    position = np.array([[0.0, 0.0, 0.05], [0.12, 0.0, 0.05], [0.0, 0.5, 0.05]])
    lifted, level = np.full(3, 1.4), np.array([0.0, 1.4, 0.0])
    new = Poses(position, np.tile(np.eye(3), (3, 1, 1)), level)
    held = hold_arms(new, lifted, np.array([0, 0, 0]))
    np.testing.assert_array_equal(held.hinge, [1.4, 1.4, 0.0])
    np.testing.assert_array_equal(held.position, position)
    assert hold_arms(new, lifted, np.arange(3)) is new
    assert hold_arms(new, level, np.zeros(3, int)) is new
