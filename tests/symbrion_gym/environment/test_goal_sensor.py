"""The sensor `goal`."""

import gymnasium as gym
import numpy as np
import pytest

import symbrion_gym  # noqa: F401


@pytest.mark.parametrize("name", ["Explore-v0", "Recover-v0"])
@pytest.mark.filterwarnings("error")
def test_it_is_zero_where_a_task_has_no_place_to_head_for(name: str) -> None:
    env = gym.make(f"symbrion_gym/{name}", sensors=("goal",))
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(observation, 0.0)
    observation, *_ = env.step(env.action_space.sample())
    np.testing.assert_array_equal(observation, 0.0)
    env.close()


def test_it_is_where_the_goal_lies_from_the_head() -> None:
    env = gym.make("symbrion_gym/Reach-v0", sensors=("goal",), randomize={})
    observation, _ = env.reset(seed=0)
    state = env.unwrapped._episodes.state  # type: ignore[attr-defined]
    distance = np.linalg.norm(state.target[0] - state.position[0, 0, :2])
    assert np.linalg.norm(observation) == pytest.approx(distance, rel=1e-6)
    env.close()
