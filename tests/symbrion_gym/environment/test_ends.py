"""Why episodes end, what they are worth without success, and what a spec says of them."""

import gymnasium as gym
import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.registration import ENVIRONMENTS

PIT = "symbrion_gym/SnakePit-v1"
VECTOR = {"vectorization_mode": "vector_entry_point"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reason", "action", "options"),
    [
        ("timeout", 0.0, {"duration": 0.5}),
        ("stuck", 0.0, {"stuck_time": 0.3, "track_speed": 0.0}),
        ("rolled_over", -1.0, {"start": "pit"}),
        ("touched_pit", -0.1, {"start": "pit", "modules": 5, "bottomless": True}),
        ("success", 0.0, {"pit": 0.0, "start": (0.0, 0.0), "goal": (0.2, 0.0)}),
    ],
)
def test_only_a_success_has_a_return_above_nothing(reason, action, options):
    """Single and vector environments say the same word."""
    options = {"modules": 3, "randomize": {}} | options
    env, envs = OrganismEnv(**options), OrganismVectorEnv(2, autoreset_mode="Disabled", **options)
    env.reset(seed=0), envs.reset(seed=[0, 0])
    total, is_over = 0.0, False
    while not is_over:
        _, reward, terminated, truncated, info = env.step(np.full(env.action_space.shape, action))
        *_, infos = envs.step(np.full(envs.action_space.shape, action))
        total, is_over = total + reward, terminated or truncated
        assert infos["reason"].tolist() == [info["reason"]] * 2
        assert (info["reason"] != "") == is_over
    assert info["reason"] == reason
    assert (total > 0.0) == (reason == "success")
    assert total == pytest.approx(-1.0, abs=0.01) or not terminated or total > 0.0


def test_a_limit_of_the_vector_environment_is_a_timeout_and_keeps_no_progress():
    envs = gym.make_vec(PIT, 2, modules=3, max_episode_steps=5, autoreset_mode="SameStep", **VECTOR)
    envs.reset(seed=0)
    rewards = [envs.step(np.zeros((2, 2)))[1:] for _ in range(5)]
    assert rewards[-1][-1]["final_info"]["reason"].tolist() == ["timeout", "timeout"]
    assert rewards[-1][-1]["reason"].tolist() == ["", ""]
    assert (sum(each[0] for each in rewards) <= 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "steps", "threshold"),
    [
        ({}, 4500, 3.0),
        ({"noise": 0.5}, 4500, 3.0),
        ({"duration": 20.0}, 1000, None),
        ({"task": sg.make_task("snake_pit")}, None, None),
    ],
)
def test_a_spec_says_what_is_true_of_the_id_and_nothing_of_a_task_of_ones_own(options, steps, threshold):
    for env in (gym.make(PIT, modules=8, **options), gym.make_vec(PIT, 2, **options, **VECTOR)):
        assert env.spec.max_episode_steps == steps
    assert gym.make(PIT, **options).spec.reward_threshold == threshold


def test_the_seed_draws_the_start_in_every_id():
    for name, options in ENVIRONMENTS.items():
        assert {"start_offset", "start_lateral", "yaw"} <= set(options["randomize"]), name
