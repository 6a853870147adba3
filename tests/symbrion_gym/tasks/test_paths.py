"""Ways on drivable ground are proposed."""

import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from symbrion_gym._src.tasks.paths import find_path, propose_way
from symbrion_gym._src.tasks.reach import ReachPlaces, find_passing
from symbrion_gym._src.tasks.route import Start


def test_a_way_is_proposed_on_one_side_of_the_stairs():
    start, goal = propose_way(sg.load_arena("stairs"), sg.snake(8))
    assert max(start[0], goal[0]) < 0.0 or min(start[0], goal[0]) > 1.2


def test_where_too_little_can_be_driven_no_way_is_proposed():
    assert propose_way(sg.load_arena("stairs"), sg.cross(9)) is None


def make_two_rooms():
    """Two rooms, and between them a wall with a door of 0.4 m."""
    boxes = [
        ((-2, -1, -0.1), (2, 1, 0)),
        ((-0.02, -1, -0.1), (0.02, -0.2, 0.5)),
        ((-0.02, 0.2, -0.1), (0.02, 1, 0.5)),
    ]
    return sg.make_arena(trimesh.boolean.union([trimesh.creation.box(bounds=each) for each in boxes]))


def test_an_environment_leads_a_scout_along_the_way_that_the_arena_proposes():
    arena, ends = make_two_rooms(), ((-1.0, 0.7), (1.0, 0.7))
    proposed = arena.find_route(start=ends[0], goal=ends[1]).path[:, :2]
    route = find_path(arena, sg.Organism(1), Start(ends[0]), ends[1:])
    away = np.linalg.norm(np.array(route.corners)[:, None] - proposed, axis=2).min(axis=1)
    assert away == pytest.approx(0.0)


def test_a_corner_is_passed_beside_the_way_from_it_but_not_through_a_wall():
    """Who drives around the jamb of a door on a way of its own need not come near the corner."""
    route = find_path(make_two_rooms(), sg.Organism(1), Start((-1.0, 0.7)), ((1.0, 0.7),))
    legs, corners = ReachPlaces().list_legs(route, 0.105), np.array(route.corners)
    assert min(route.room) < 0.15 < max(route.room)
    for number in range(len(legs) - 1):
        along = corners[number + 1] - corners[number]
        aside = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        middle = corners[number] + 0.5 * along
        near, far = (share * legs[number, 4] * aside for share in (0.9, 1.1))
        places = np.array([middle + near, middle - near, middle + far, corners[number] - 3 * along])
        passes = find_passing(np.tile(legs[number], (4, 1)), places, np)
        assert passes.tolist() == [True, True, False, False]
    beyond = corners[-1:] + np.array([[0.0, 0.11]])
    assert not find_passing(legs[-1:], beyond, np).any(), "a goal is passed within its tolerance only"


@pytest.mark.parametrize(("start", "goal"), [((-0.35, -0.3), (-0.35, 0.3)), ((0.2, -0.35), (-0.5, 0.5))])
def test_who_heads_for_the_next_corner_does_not_get_stuck_at_a_wall(start, goal):
    """The way leads around the end of a thin wall, by 1 m wide ground."""
    boxes = [((-1, -1, -0.1), (1, 1, 0)), ((-1, -0.02, -0.1), (0.4, 0.02, 0.5))]
    boxes += [((0.7, -1, -0.1), (1, 1, 0.5)), ((-0.2, -0.02, 0), (-0.16, 0.4, 0.5))]
    arena = sg.make_arena(trimesh.boolean.union([trimesh.creation.box(bounds=each) for each in boxes]))
    env = sg.OrganismEnv(
        arena=arena, task="reach", modules=1, start=start, goal=goal, track_control="skid", sensors=("goal",)
    )
    (ahead, left), info = env.reset(seed=0)
    is_over = False
    while not is_over:
        turn = np.clip(np.arctan2(left, ahead), -1.0, 1.0)
        speed = 1.0 - abs(turn)
        (ahead, left), _, terminated, truncated, info = env.step(np.array([speed - turn, speed + turn]))
        is_over = terminated or truncated
    assert info["success"], info["reason"]


@pytest.mark.parametrize(("task", "control"), [("reach", "skid"), ("traverse", "constant")])
def test_a_goal_below_a_shelf_is_reached_from_the_open(task, control):
    boxes = [((-1, -1, -0.1), (3, 1, 0)), ((1.2, -1, 0.6), (3, 1, 0.7))]
    pieces = [trimesh.creation.box(bounds=each) for each in boxes]
    arena = sg.make_arena(trimesh.util.concatenate(pieces))
    env = sg.OrganismEnv(
        arena=arena, modules=1, task=task, track_control=control, start=(0, 0), goal=(1.7, 0)
    )
    env.reset(seed=0)
    info, is_over = {}, False
    while not is_over:
        _, _, terminated, truncated, info = env.step(np.ones(env.action_space.shape))
        is_over = terminated or truncated
    assert info["success"], info["reason"]


def test_a_body_is_put_on_the_floor_where_only_its_tail_lies_below_a_shelf():
    boxes = [((-2, -1, -0.1), (2, 1, 0)), ((-2, -1, 0.5), (-0.04, 1, 0.6))]
    pieces = [trimesh.creation.box(bounds=each) for each in boxes]
    arena = sg.make_arena(trimesh.util.concatenate(pieces))
    env = sg.OrganismEnv(arena=arena, modules=1, task="reach", start=(0.02, 0), goal=(1, 0))
    env.reset(seed=0)
    assert env.physics.position[0, 0, 2] == pytest.approx(0.0525, abs=0.005)
    assert env.physics.rotation[0, 0].reshape(3, 3)[2, 2] > 0.99
