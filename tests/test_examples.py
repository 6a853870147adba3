"""The examples work."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import symbrion_gym as sg

EXAMPLES = Path(__file__).parents[1] / "examples"


def load(name: str) -> ModuleType:
    """Return an example as a module."""
    found = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_the_hand_written_controller_crosses() -> None:
    assert load("hand_written_controller").main()


def test_a_task_of_ones_own_takes_few_lines_and_is_solved() -> None:
    assert len((EXAMPLES / "own_task.py").read_text().splitlines()) <= 25
    own = load("own_task")
    assert own.env.unwrapped.world.task == own.task
    assert any(info["success"] for *_, info in own.results)
    assert sum(info["reward_rise"] for *_, info in own.results) > 0.1


@pytest.mark.slow
def test_ppo_trains() -> None:
    pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")
    example = load("train_ppo")
    model, envs = example.train(steps=2048, num_envs=4, verbose=0)
    policies = (
        lambda observation: np.zeros((len(observation), *model.action_space.shape)),
        lambda observation: model.predict(envs.normalize_obs(observation), deterministic=True)[0],
    )
    for policy in policies:
        progress, successes = example.evaluate(policy, trials=4)
        assert progress > 0
        assert 0 <= successes <= 1


@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_a_scout_drives_to_random_places(arena: str) -> None:
    ground = sg.load_arena(arena)
    places = ground.traversability()
    rng, drive = np.random.default_rng(5), load("drive_to_a_place").drive
    for _ in range(2):
        goal = rng.choice(np.flatnonzero(places.region >= 0))
        start = rng.choice(np.flatnonzero(places.region == places.region[goal]))
        assert drive(ground, *(tuple(places.positions[place, :2]) for place in (start, goal)))
