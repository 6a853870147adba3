"""The names under which environments are made."""

import gymnasium as gym
import numpy as np
import pytest

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import StairsCourse
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.registration import ENVIRONMENTS, register


def test_registering_twice_changes_nothing():
    before = dict(gym.registry)
    register()
    assert {name: spec for name, spec in gym.registry.items() if name in before} == before
    assert set(ENVIRONMENTS) <= set(gym.registry)


@pytest.mark.parametrize("arena", ["truth", "simple", "gsrm", "gg"])
def test_the_pit_is_the_default_one(arena):
    env = gym.make("symbrion_gym/SnakePit-v1", arena=arena, modules=2)
    near, far, _ = env.unwrapped.world.route.pit
    is_scanned = env.unwrapped.world.arena.course is None
    assert is_scanned == (arena in ("gsrm", "gg"))
    assert far - near == pytest.approx(0.45, abs=0.003 if is_scanned else 1e-9)
    narrower = gym.make("symbrion_gym/SnakePit-v1", arena="truth", pit=0.3, modules=2)
    assert narrower.unwrapped.world.arena.course.pit == 0.3


def test_a_pit_that_no_scan_has_is_refused():
    with pytest.raises(ArenaError, match=r"its own pit; 0\.3"):
        gym.make("symbrion_gym/SnakePit-v1", arena="gsrm", pit=0.3)


def test_stairs_can_be_climbed_and_the_ramp_crossed():
    """With the hinges straight and the tracks at full speed, on low steps."""
    low = Arena.from_course(StairsCourse(steps=2, rise=0.012), "low stairs")
    for name, options in (
        ("symbrion_gym/CrossGap-v0", {"task": "snake_pit", "arena": low}),
        ("symbrion_gym/CrossGap-v0", {"task": "snake_pit", "pit": 0.0, "track_speed": 0.3}),
    ):
        env = gym.make(name, modules=4, **options)
        env.reset(seed=0)
        while True:
            *_, terminated, truncated, info = env.step(np.array([0.0, 0.0, 0.0, 1.0]))
            if terminated or truncated:
                break
        assert info["success"], (name, info)


@pytest.mark.parametrize("name", [name for name in ENVIRONMENTS if "Snake" in name])
def test_ids_work_through_the_module_prefix(name):
    env = gym.make(
        f"symbrion_gym:{name}", modules=2, arena="truth", start=(-2.0, 0.0), goal=(0.0, 0.0), pit=0.0
    )
    env.reset(seed=0)
    env.close()
