"""Docks as arrays: frames, matches, releases, groups and organisms."""

import numpy as np
import pytest

import symbrion_gym as sg
from reconstruction._src.geometry.pose import make_rotation
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, cross, letter_h
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import (
    DockConfig,
    can_join,
    compute_dock_frames,
    compute_dock_poses,
    find_groups,
    find_matches,
    find_released,
    make_organism,
)
from symbrion_gym._src.swarm.world import SwarmState

SCOUT = ScoutConfig()


def make_state(poses, hinge=None, links=(), pitch=0.0):
    poses = np.atleast_2d(np.array(poses, float))
    count = len(poses)
    return SwarmState(
        np.column_stack([poses[:, :2], np.full(count, 0.05)]),
        make_rotation(yaw=poses[:, 2], pitch=pitch),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros(count) if hinge is None else np.array(hinge, float),
        tuple(links),
        np.zeros((count, 4)),
        np.zeros((count, 2)),
    )


def all_latch(count):
    return np.ones((count, 4), bool)


def test_docks_of_a_turned_robot_are_where_they_are_known_to_be():
    position, axis = compute_dock_poses(make_state([1.0, 2.0, np.pi / 2]), SCOUT)
    np.testing.assert_allclose(position[0, 0], [1.0, 2.072, 0.05], atol=1e-12)
    np.testing.assert_allclose(position[0, 2], [0.9475, 2.0, 0.05], atol=1e-12)
    np.testing.assert_allclose(axis[0, 1], [0.0, -1.0, 0.0], atol=1e-12)


def test_front_dock_follows_the_hinge():
    frames = compute_dock_frames(make_state([0.0, 0.0, 0.0], hinge=[np.pi / 2]), SCOUT)
    np.testing.assert_allclose(frames.position[0, 0], [0.0, 0.0, 0.05 + 0.072], atol=1e-12)
    np.testing.assert_allclose(frames.axis[0, 0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(frames.up[0, 0], [-1.0, 0.0, 0.0], atol=1e-12)


def test_exact_neighbors_latch():
    state = make_state([[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0]])
    assert find_matches(state, all_latch(2)) == (Docking(0, "back", 1, "front"),)


@pytest.mark.parametrize("organism", [sg.cross(1), letter_h(2), cross(2)])
def test_modules_of_an_organism_latch_into_it(organism):
    poses = [(pose.x, pose.y, pose.heading) for pose in organism.compute_poses()]
    links = find_matches(make_state(poses), all_latch(len(poses)))
    made, order = make_organism(links, range(len(poses)), root=0)
    mapped = {
        frozenset([(order[d.first], d.first_side), (order[d.second], d.second_side)]) for d in made.dockings
    }
    assert mapped == {frozenset(docking.ends) for docking in organism.dockings}


@pytest.mark.parametrize(
    ("name", "move"),
    [
        ("distance", lambda value: [-value, 0.0, 0.0]),
        ("offset", lambda value: [0.0, value, 0.0]),
        ("angle", lambda value: [0.0, 0.0, np.deg2rad(value)]),
    ],
)
def test_tolerances_decide(name, move):
    config = DockConfig(**{name: 0.004 if name != "angle" else 4.0})
    for share, is_match in ((0.9, True), (1.2, False)):
        step = np.array(move(share * getattr(config, name)))
        heading = step[2]
        place = -SCOUT.dock_reach - SCOUT.dock_gap
        pose = [
            place - SCOUT.arm_reach * np.cos(heading) + step[0],
            -SCOUT.arm_reach * np.sin(heading) + step[1],
        ]
        state = make_state([[0.0, 0.0, 0.0], [*pose, heading]])
        assert (find_matches(state, all_latch(2), config) != ()) == is_match


def test_height_and_roll_decide():
    state = make_state([[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0]])
    high = state._replace(position=state.position + np.array([[0.0, 0.0, 0.009], [0.0, 0.0, 0.0]]))
    assert find_matches(high, all_latch(2)) == ()
    rotation = np.stack([np.eye(3), make_rotation(roll=np.deg2rad(12.0))])
    assert find_matches(state._replace(rotation=rotation), all_latch(2)) == ()


def test_both_must_be_told():
    state = make_state([[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0]])
    latch = all_latch(2)
    latch[0, SIDES.index("back")] = False
    assert find_matches(state, latch) == ()


def test_used_docks_do_not_match_again():
    links = (Docking(0, "back", 1, "front"),)
    state = make_state([[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0]], links=links)
    assert find_matches(state, all_latch(2)) == ()


def test_rings_and_overlaps_are_refused():
    links = [Docking(0, "back", 1, "front")]
    assert not can_join(Docking(0, "left", 1, "right"), links, 2, SCOUT)
    around = [Docking(i, "front", i - 1, "left" if i == 1 else "right") for i in range(1, 4)]
    assert can_join(around[2], around[:2], 5, SCOUT)
    assert not can_join(Docking(4, "front", 3, "right"), around, 5, SCOUT)


def test_release_needs_one_end():
    links = (Docking(0, "back", 1, "front"), Docking(1, "back", 2, "front"))
    latch = all_latch(3)
    latch[1, SIDES.index("back")] = False
    assert find_released(links, latch) == links[1:]


def test_groups_have_the_smallest_index():
    links = [Docking(1, "back", 4, "front"), Docking(0, "left", 3, "front"), Docking(3, "back", 4, "left")]
    assert find_groups(links, 6).tolist() == [0, 0, 2, 0, 0, 5]


def test_a_row_of_robots_is_a_snake():
    robots = [5, 2, 7, 0]
    links = [Docking(robots[i], "front", robots[i - 1], "back") for i in range(1, 4)]
    organism, order = make_organism(links, robots)
    assert organism == sg.snake(4)
    assert list(order) == robots


def test_ring_is_no_organism():
    links = [Docking(0, "left", 1, "right"), Docking(0, "right", 1, "left")]
    with pytest.raises(OrganismError):
        make_organism(links, [0, 1])


@pytest.mark.parametrize("bad", [{"distance": 0.0}, {"angle": 90.0}, {"mating_time": -1.0}, {"tears": 1}])
def test_bad_configs_are_refused(bad):
    with pytest.raises(OrganismError, match=next(iter(bad))):
        DockConfig(**bad)
