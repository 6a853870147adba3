"""What robots hear and see of a known scene: distance, bearing, departure, shade, collisions, drops ahead."""

import numpy as np
import pytest
from swarm_cases import FLOOR, make_floor, make_sheet, make_state

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.swarm.behavior.memory import Wired, Words
from symbrion_gym._src.swarm.behavior.sensing import (
    compute_brightness,
    compute_drop,
    find_links,
    hear,
    make_scout,
    read_wires,
)
from symbrion_gym._src.swarm.docks import compute_dock_frames
from symbrion_gym._src.swarm.senses import NUM_UNITS, Sight
from symbrion_gym._src.swarm.signals import compute_readings, find_units
from symbrion_gym._src.swarm.world import BACK

FAR = (3.0, 3.0, 0.0)


def speak(*robots: int) -> np.ndarray:
    """Return which docks speak: the back ones of some robots of three."""
    speaks = np.zeros((3, 4), bool)
    speaks[list(robots), BACK] = True
    return speaks


def find(state, speaks, arena=FLOOR):
    return find_links(state, speaks, Sight(arena, make_scout()).find_clear(state, 5.0))


def listen(state, words, speaks, **options):
    rng = np.random.default_rng(0)
    return hear(find(state, speaks), words, speaks, 0.0, np.zeros((2, 3)), rng, **options)


def test_a_beacon_straight_ahead_is_heard_with_its_distance_and_angles() -> None:
    words = Words.make_silent(3)._replace(role=np.full((3, 4), 5), leader=np.array([7, -1, -1]))
    heard = listen(make_state([(0.0, 0.0, 0.0), (-0.6, 0.0, 0.0), FAR]), words, speak(0))
    assert heard.is_heard.tolist() == [False, True, False]
    scout = make_scout()
    assert heard.distance[1] == pytest.approx(0.6 - scout.dock_reach - scout.arm_reach)
    assert heard.bearing[1] == pytest.approx(0.0)
    assert heard.departure[1] == pytest.approx(0.0)
    assert (heard.role[1], heard.sender_side[1], heard.leader[1]) == (5, BACK, 7)


@pytest.mark.parametrize(("x", "y", "heading"), [(-1.0, 0.0, 0.0), (-2.0, 0.1, 0.0), (-0.6, 0.3, -0.5)])
def test_a_dock_is_as_bright_as_the_signals_have_it(x: float, y: float, heading: float) -> None:
    state = make_state([(0.0, 0.0, 0.0), (x, y, heading)], hinge=[0.0, np.pi / 2])
    docks, axes, _ = compute_dock_frames(state)
    units, looks = find_units(state, make_scout())
    readings = compute_readings(docks[0, BACK], axes[0, BACK], units[1], looks[1])
    links = find(state, speak(0)[:2])
    brightness = compute_brightness(links.distance, links.departure, np.abs(links.bearing))
    assert brightness[0] == pytest.approx(readings.reshape(4, 2).sum(axis=1).max(), rel=0.15)


def test_departure_says_on_which_side_of_the_axis_a_robot_is() -> None:
    for y, sign in ((0.2, -1.0), (-0.2, 1.0)):  # seen along the dock's axis, which looks back
        links = find(make_state([(0.0, 0.0, 0.0), (-0.6, y, 0.0), FAR]), speak(0))
        assert np.sign(links.departure[0]) == sign
        assert np.sign(links.bearing[0]) == -np.sign(y)


def test_nothing_is_heard_from_behind_a_dock_or_through_a_robot_or_a_wall() -> None:
    ahead = make_state([(0.0, 0.0, 0.0), (0.6, 0.0, 0.0), FAR])
    assert len(find(ahead, speak(0)).receiver) == 0
    shaded = make_state([(0.0, 0.0, 0.0), (-0.6, 0.0, 0.0), (-0.3, 0.0, 0.0)])
    assert find(shaded, speak(0)).receiver.tolist() == [2]
    assert find(shaded, speak(0), make_floor(make_sheet(-0.2))).receiver.tolist() == []


@pytest.mark.parametrize(("askers", "is_understood"), [([1], True), ([1, 2], False)])
def test_robots_that_ask_at_once_are_not_understood(askers: list[int], is_understood: bool) -> None:
    state, speaks = (
        make_state([(0.0, 0.0, 0.0), (-0.5, 0.15, 0.0), (-0.5, -0.15, 0.0)]),
        np.zeros((3, 4), bool),
    )
    speaks[askers] = True
    heard = listen(state, Words.make_silent(3), speaks, collides=True)
    assert bool(heard.is_heard[0]) is is_understood


def test_wires_carry_words_to_the_neighbor_alone() -> None:
    told = Wired(np.array([1, 2, 4]), *np.zeros((3, 3), np.int64))
    received = read_wires(told, (Docking(0, "left", 1, "front"),))
    np.testing.assert_array_equal(received.roles, [[0, 0, 2, 0], [1, 0, 0, 0], [0, 0, 0, 0]])


def test_level_ground_has_no_drop_a_pit_has_its_depth_a_rim_has_no_end() -> None:
    scout = make_scout()
    rays = find_scout_rays(scout)
    origins, directions = rays.origins[NUM_UNITS:], rays.directions[NUM_UNITS:]
    for depth in (0.0, 0.25):
        ranges = (-scout.size[2] / 2 - depth - origins[:, 2]) / directions[:, 2]
        assert compute_drop(ranges[None], np.zeros(1), scout)[0] == pytest.approx(depth, abs=1e-9)
    nothing = np.full((1, len(origins)), scout.laser_range)
    assert np.isinf(compute_drop(nothing, np.zeros(1), scout)[0])
