"""The examples work."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import evolution as ev

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


def test_the_own_controller_is_evaluated_and_short() -> None:
    wave = load("own_controller").Wave
    evaluation = ev.evaluate(np.zeros((2, 3)), modules=4, controller=wave, trials=1, duration=1.0)
    assert not any(outcome.error for outcome in evaluation.outcomes)
    assert len((EXAMPLES / "own_controller.py").read_text().splitlines()) <= 25


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
