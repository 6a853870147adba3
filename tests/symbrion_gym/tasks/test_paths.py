"""Ways on drivable ground are proposed."""

import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from symbrion_gym._src.tasks.paths import propose_way


def test_a_way_is_proposed_on_one_side_of_the_stairs():
    start, goal = propose_way(sg.load_arena("stairs"), sg.snake(8))
    assert max(start[0], goal[0]) < 0.0


def test_where_too_little_can_be_driven_no_way_is_proposed():
    assert propose_way(sg.load_arena("stairs"), sg.cross(9)) is None


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
