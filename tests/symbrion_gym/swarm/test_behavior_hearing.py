"""What robots hear and see of a known scene: distance, bearing, departure, shade, collisions, drops ahead."""

import numpy as np
import pytest

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.swarm.behavior.hearing import (
    HearingConfig,
    compute_brightness,
    find_geometry,
    hear,
    read_wires,
)
from symbrion_gym._src.swarm.behavior.percepts import BACK, LEFT, Wired, Words
from symbrion_gym._src.swarm.behavior.sensing import compute_drop, make_scout
from symbrion_gym._src.swarm.docks import compute_dock_poses
from symbrion_gym._src.swarm.kinematic.motion import choose_roots
from symbrion_gym._src.swarm.signals.infrared import NUM_UNITS, compute_readings, find_units
from symbrion_gym._src.swarm.world import SwarmState

EXACT = HearingConfig(bearing_noise=0.0, departure_noise=0.0, bias=0.0, distance_noise=0.0, loss=0.0)
NO_BIAS = np.zeros((2, 3))


def place(*poses: tuple[float, float, float]) -> SwarmState:
    count = len(poses)
    x, y, heading = np.array(poses, float).T
    rotation = np.tile(np.eye(3), (count, 1, 1))
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(heading)
    rotation[:, 1, 0], rotation[:, 0, 1] = np.sin(heading), -np.sin(heading)
    zero = np.zeros((count, 3))
    position = np.stack([x, y, np.full(count, 0.05)], axis=-1)
    return SwarmState(
        position, rotation, zero, zero, np.zeros(count), (), np.zeros((count, 4)), np.zeros((count, 2))
    )


def speak(*docks: tuple[int, int]) -> np.ndarray:
    speaks = np.zeros((3, 4), bool)
    for robot, side in docks:
        speaks[robot, side] = True
    return speaks


def test_a_beacon_straight_ahead_is_heard_with_its_distance_and_angles() -> None:
    state = place((0.0, 0.0, 0.0), (-0.6, 0.0, 0.0), (3.0, 3.0, 0.0))
    speaks = speak((0, BACK))
    words = Words.make_silent(3)._replace(role=np.full((3, 4), 5))
    heard = hear(find_geometry(state, speaks, EXACT), words, speaks, EXACT, NO_BIAS, np.random.default_rng(0))
    assert heard.is_heard.tolist() == [False, True, False]
    scout = make_scout()
    assert heard.distance[1] == pytest.approx(0.6 - scout.dock_reach - scout.arm_reach)
    assert heard.bearing[1] == pytest.approx(0.0)
    assert heard.departure[1] == pytest.approx(0.0)
    assert (heard.role[1], heard.sender_side[1]) == (5, BACK)


@pytest.mark.parametrize(("x", "y", "heading"), [(-1.0, 0.0, 0.0), (-2.0, 0.1, 0.0), (-0.6, 0.3, -0.5)])
def test_a_dock_is_as_bright_as_the_signals_have_it(x: float, y: float, heading: float) -> None:
    state = place((0.0, 0.0, 0.0), (x, y, heading))._replace(hinge=np.array([0.0, np.pi / 2]))
    light, (docks, axes), (units, looks) = (
        EXACT.light,
        compute_dock_poses(state),
        find_units(state, make_scout()),
    )
    readings = compute_readings(docks[0, BACK], axes[0, BACK], units[1], looks[1], light)
    geometry = find_geometry(state, speak((0, BACK))[:2], EXACT)
    brightness = compute_brightness(geometry.distance, geometry.departure, np.abs(geometry.bearing), light)
    assert brightness[0] == pytest.approx(readings.reshape(4, 2).sum(axis=1).max(), rel=0.15)


def test_departure_says_on_which_side_of_the_axis_a_robot_is() -> None:
    speaks = speak((0, BACK))
    for y, sign in ((0.2, -1.0), (-0.2, 1.0)):  # seen along the dock's axis, which looks back
        state = place((0.0, 0.0, 0.0), (-0.6, y, 0.0), (3.0, 3.0, 0.0))
        geometry = find_geometry(state, speaks, EXACT)
        assert np.sign(geometry.departure[0]) == sign
        assert np.sign(geometry.bearing[0]) == -np.sign(y)


def test_nothing_is_heard_from_behind_a_dock_or_through_a_robot() -> None:
    speaks = speak((0, BACK))
    ahead = place((0.0, 0.0, 0.0), (0.6, 0.0, 0.0), (3.0, 3.0, 0.0))
    assert len(find_geometry(ahead, speaks, EXACT).receiver) == 0
    shaded = place((0.0, 0.0, 0.0), (-0.6, 0.0, 0.0), (-0.3, 0.0, 0.0))
    assert find_geometry(shaded, speaks, EXACT).receiver.tolist() == [2]


def test_robots_that_ask_at_once_are_not_understood() -> None:
    state = place((0.0, 0.0, 0.0), (-0.5, 0.15, 0.0), (-0.5, -0.15, 0.0))
    words = Words.make_silent(3)
    for askers, understood in (([1], True), ([1, 2], False)):
        speaks = np.zeros((3, 4), bool)
        speaks[askers] = True
        geometry = find_geometry(state, speaks, EXACT)
        heard = hear(geometry, words, speaks, EXACT, NO_BIAS, np.random.default_rng(0), collides=True)
        assert bool(heard.is_heard[0]) is understood


def test_wires_carry_words_to_the_neighbor_alone() -> None:
    wire = Wired(*np.zeros((4, 3, 4), np.int64))
    wire.roles[:] = np.array([1, 2, 4])[:, None]
    received = read_wires(wire, (Docking(0, "left", 1, "front"),))
    assert received.roles[0].tolist() == [0, 0, 2, 0]
    assert received.roles[1].tolist() == [1, 0, 0, 0]
    assert not received.roles[2].any()
    assert received.roles[0, LEFT] == 2


def test_level_ground_has_no_drop_a_pit_has_its_depth_a_rim_has_no_end() -> None:
    scout = make_scout()
    rays = find_scout_rays(scout)
    origins, directions = rays.origins[NUM_UNITS:], rays.directions[NUM_UNITS:]
    for depth, expected in ((0.0, 0.0), (0.25, 0.25)):
        ranges = (-scout.size[2] / 2 - depth - origins[:, 2]) / directions[:, 2]
        assert compute_drop(ranges[None], np.zeros(1), scout)[0] == pytest.approx(expected, abs=1e-9)
    nothing = np.full((1, len(origins)), scout.laser_range)
    assert np.isinf(compute_drop(nothing, np.zeros(1), scout)[0])


def test_a_newcomer_does_not_move_the_group_it_docks_to() -> None:
    groups, roots = np.array([0, 0, 0, 3]), np.array([0, 1, 1, 3])
    still = np.zeros(4)
    assert choose_roots(groups, roots, still).tolist() == [1, 1, 1, 3]
    assert choose_roots(np.arange(4), np.array([1, 1, 1, 3]), still).tolist() == [0, 1, 2, 3]


def test_of_two_robots_that_dock_the_one_that_stands_keeps_its_pose() -> None:
    groups, roots = np.array([0, 0, 2]), np.arange(3)
    assert choose_roots(groups, roots, np.array([0.02, 0.0, 0.0])).tolist() == [1, 1, 2]
    assert choose_roots(groups, roots, np.array([0.0, 0.02, 0.0])).tolist() == [0, 0, 2]


def test_bad_hearing_is_refused() -> None:
    with pytest.raises(OptionError, match="bias_time"):
        HearingConfig(bias_time=0.0)
    with pytest.raises(OptionError, match="loss"):
        HearingConfig(loss=-0.1)
