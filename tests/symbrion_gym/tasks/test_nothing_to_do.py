"""Tasks that are done at the start are refused."""

import gymnasium as gym
import pytest

from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.catalog import make_task


def make(name: str, **options) -> None:
    gym.make(f"symbrion_gym/{name}", **options).close()


@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_a_start_beyond_the_pit_is_refused_with_its_edges(arena):
    message = r"start \(0.6, 0\) lies beyond the pit .* far edge is 0.2\d m .* near edge, at -0.2"
    with pytest.raises(TaskError, match=message):
        make("SnakePit-v1", arena=arena, start=(0.6, 0.0), modules=2)
    make("SnakePit-v1", arena=arena, start=(-0.6, 0.0), modules=2)


def test_beyond_the_pit_there_may_be_a_goal_or_another_task():
    make("SnakePit-v1", arena="truth", start=(0.6, 0.0), goal=(2.0, 0.0), modules=2)
    make("Traverse-v0", arena="truth", start=(0.6, 0.0), modules=2)
    make("SnakePit-v1", arena="truth", pit=0.0, start=(0.6, 0.0), modules=2)


def test_a_goal_at_the_start_is_refused_with_the_least_distance():
    message = r"goal \(-2.\d+, -?0.0\d\) is 0.0\d m from the middle .* within 0.1\d m; give one at least 0.16 m away"
    with pytest.raises(TaskError, match=message):
        make("Reach-v0", arena="truth", start=(-2.5, 0.0), goal=(-2.45, 0.0))
    with pytest.raises(TaskError, match=r"distance 0.05 m is too short, .* at least 0.16 m"):
        make("Reach-v0", distance=0.05)
    make("Reach-v0", arena="truth", start=(-2.5, 0.0), goal=(-2.2, 0.0))
    make("Reach-v0", arena="truth", start=(-2.5, 0.0), places=((-2.0, 0.0),), goal=(-2.5, 0.0))
    make("Reach-v0", arena="truth", start=(-2.5, 0.0), goal=(-2.35, 0.0), tolerance=0.03)


def test_a_goal_straight_ahead_may_not_be_nearer_than_a_module_is_long():
    with pytest.raises(TaskError, match=r"0.05 m ahead of the head at the start; give one at least 0.1\d m"):
        make("SnakePit-v1", arena="truth", start=(-2.5, 0.0), goal=(-2.45, 0.0), modules=2)
    assert make_task("snake_pit", goal=(-2.0, 0.0)).name == "snake_pit"
