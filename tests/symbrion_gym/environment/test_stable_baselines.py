"""The adapter to stable-baselines3 agrees with the vector environment, and with its own checks."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")

from symbrion_gym import make_sb3_env
from symbrion_gym._src.environment.stable_baselines_env import StableBaselinesEnv

ID = "symbrion_gym/SnakePit-v1"
SHORT: dict[str, Any] = {"modules": 3, "duration": 0.2, "start": "pit"}


def test_steps_and_resets_are_those_of_the_vector_environment() -> None:
    adapted = make_sb3_env(ID, 3, seed=5, **SHORT)
    plain = gym.make_vec(
        ID, 3, vectorization_mode="vector_entry_point", autoreset_mode=AutoresetMode.SAME_STEP, **SHORT
    )
    np.testing.assert_array_equal(adapted.reset(), plain.reset(seed=5)[0])
    rng, num_ended = np.random.default_rng(0), 0
    for _ in range(25):
        actions = rng.uniform(-1, 1, (3, 2))
        observation, reward, done, infos = adapted.step(actions)
        wanted, rewards, terminated, truncated, info = plain.step(actions)
        np.testing.assert_array_equal(observation, wanted)
        np.testing.assert_array_equal(reward, rewards)
        np.testing.assert_array_equal(done, terminated | truncated)
        num_ended += int(done.sum())
        for row in np.flatnonzero(done):
            np.testing.assert_array_equal(infos[row]["terminal_observation"], info["final_obs"][row])
            assert infos[row]["TimeLimit.truncated"]
            assert infos[row]["is_success"] is False
            assert infos[row]["progress"] == info["final_info"]["progress"][row]
    assert num_ended == 6, "each episode of 0.2 s ends twice within 25 steps of 20 ms"


def test_another_way_to_reset_is_refused() -> None:
    plain = gym.make_vec(ID, 1, vectorization_mode="vector_entry_point", **SHORT)
    with pytest.raises(ValueError, match="SameStep"):
        StableBaselinesEnv(plain)


def test_its_attributes_are_one_per_environment() -> None:
    adapted = make_sb3_env(ID, 2, **SHORT)
    assert len(adapted.get_attr("num_envs")) == 2
    assert len(adapted.get_attr("num_envs", indices=[1])) == 1
    assert adapted.env_is_wrapped(gym.Wrapper) == [False, False]
    assert adapted.get_images() == [None, None]
