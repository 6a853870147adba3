"""Docks as arrays: frames, matches, releases, groups and organisms."""

import numpy as np
import pytest
from swarm_cases import make_state

import symbrion_gym as sg
from reconstruction._src.geometry.pose import make_rotation
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, cross, letter_h
from symbrion_gym._src.swarm.docks import (
    LARGEST_ANGLE,
    LARGEST_GAP,
    LARGEST_OFFSET,
    SCOUT,
    can_join,
    change_links,
    compute_dock_frames,
    find_groups,
    find_matches,
    make_organism,
)
from symbrion_gym._src.swarm.world import BACK

ROW = [[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0]]


def all_latch(count):
    return np.ones((count, 4), bool)


def test_docks_of_a_turned_robot_are_where_they_are_known_to_be():
    position, axis, _ = compute_dock_frames(make_state([1.0, 2.0, np.pi / 2]))
    np.testing.assert_allclose(position[0, 0], [1.0, 2.072, 0.05], atol=1e-12)
    np.testing.assert_allclose(position[0, 2], [0.9475, 2.0, 0.05], atol=1e-12)
    np.testing.assert_allclose(axis[0, 1], [0.0, -1.0, 0.0], atol=1e-12)


def test_front_dock_follows_the_hinge():
    frames = compute_dock_frames(make_state([0.0, 0.0, 0.0], hinge=[np.pi / 2]))
    np.testing.assert_allclose(frames.position[0, 0], [0.0, 0.0, 0.05 + 0.072], atol=1e-12)
    np.testing.assert_allclose(frames.axis[0, 0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(frames.up[0, 0], [-1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("organism", [sg.snake(2), sg.cross(1), letter_h(2), cross(2)])
def test_modules_of_an_organism_latch_into_it(organism):
    poses = [(pose.x, pose.y, pose.heading) for pose in organism.compute_poses()]
    links = find_matches(make_state(poses), all_latch(len(poses)))
    made, order = make_organism(links, range(len(poses)), SCOUT, root=0)
    mapped = {
        frozenset([(order[d.first], d.first_side), (order[d.second], d.second_side)]) for d in made.dockings
    }
    assert mapped == {frozenset(docking.ends) for docking in organism.dockings}


@pytest.mark.parametrize(
    "most", [(-LARGEST_GAP, 0.0, 0.0), (0.0, LARGEST_OFFSET, 0.0), (0.0, 0.0, LARGEST_ANGLE)]
)
def test_tolerances_decide(most):
    for share, is_match in ((0.9, True), (1.2, False)):
        x, y, heading = share * np.array(most)
        x += -SCOUT.dock_reach - SCOUT.dock_gap - SCOUT.arm_reach * np.cos(heading)
        state = make_state([ROW[0], [x, y - SCOUT.arm_reach * np.sin(heading), heading]])
        assert (find_matches(state, all_latch(2)) != []) == is_match


def test_height_and_roll_decide():
    state = make_state(ROW)
    high = state._replace(position=state.position + np.array([[0.0, 0.0, 0.009], [0.0, 0.0, 0.0]]))
    assert find_matches(high, all_latch(2)) == []
    rotation = np.stack([np.eye(3), make_rotation(roll=np.deg2rad(12.0))])
    assert find_matches(state._replace(rotation=rotation), all_latch(2)) == []


def test_docks_latch_that_are_free_and_both_told_to_and_open_when_one_is_not():
    latch, link = all_latch(2), Docking(0, "back", 1, "front")
    assert change_links(make_state(ROW), latch) == ([], [link])
    assert change_links(make_state(ROW, links=[link]), latch) == ([], [])
    latch[0, BACK] = False
    assert change_links(make_state(ROW), latch) == ([], [])
    assert change_links(make_state(ROW, links=[link]), latch) == ([link], [])


def test_rings_and_overlaps_are_refused():
    assert not can_join(Docking(0, "front", 1, "right"), [Docking(0, "back", 1, "front")], 2)
    around = [Docking(i, "front", i - 1, "left" if i == 1 else "right") for i in range(1, 4)]
    assert can_join(around[2], around[:2], 5)
    assert not can_join(Docking(4, "front", 3, "right"), around, 5)
    assert not can_join(Docking(0, "left", 1, "right"), [], 2)  # two sockets
    ring = [Docking(0, "left", 1, "front"), Docking(0, "front", 1, "left")]
    with pytest.raises(OrganismError, match="ring"):
        make_organism(ring, [0, 1], SCOUT)


def test_groups_have_the_smallest_index():
    links = [Docking(1, "back", 4, "front"), Docking(0, "left", 3, "front"), Docking(3, "back", 4, "left")]
    assert find_groups(links, 6).tolist() == [0, 0, 2, 0, 0, 5]


def test_a_row_of_robots_is_a_snake():
    robots = [5, 2, 7, 0]
    links = [Docking(robots[i], "front", robots[i - 1], "back") for i in range(1, 4)]
    organism, order = make_organism(links, robots, SCOUT)
    assert organism == sg.snake(4)
    assert list(order) == robots
    with pytest.raises(OrganismError, match="no member"):
        make_organism(links, robots[:3], SCOUT)
