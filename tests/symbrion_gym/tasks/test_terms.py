"""Terms of a user that return the wrong thing are named; when a body is stuck."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.state import check_function
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terms import Reward, Termination, gain_progress


class Column(PassFinish):
    """Progress of each module instead of each body."""

    def progress(self, state):
        return state.along


class Never(PassFinish):
    """Arrives in the first simulation alone."""

    limits = None

    def has_arrived(self, state):
        return state.rear[0] > state.finish[0]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"rewards": (Reward("rise", lambda state: state.position[:, :, 2]),)},
            r"reward 'rise' returned .*\(3, 2\)",
        ),
        ({"rewards": (Reward("up", lambda s: s.heigth),)}, "'up': there is no 'heigth'; there are: height, "),
        ({"rewards": (Reward("one", lambda state: 1.0),)}, r"reward 'one' returned an array of shape \(\)"),
        ({"rewards": (Reward("none", lambda state: None),)}, "reward 'none' returned None"),
        (
            {"rewards": (Reward("last", lambda state: state.up, at_end=True),), "duration": 0.02},
            "reward 'last'",
        ),
        (
            {"terminations": (Termination("low", lambda state: state.height < 0.0),)},
            r"termination 'low' .*shape \(3, 2\)",
        ),
        ({"rewards": (Reward("log", lambda state: state.tick * np.nan),)}, "reward 'log' .* is not finite"),
        ({"goal": Column()}, r"progress of Column returned an array of shape \(3, 2\)"),
        ({"goal": Never()}, r"has_arrived of Never returned an array of shape \(\).* 3 simulations.*\(3,\)"),
    ],
)
def test_a_wrong_shape_is_told_with_the_name_of_the_term(parts, message):
    options = {"num_envs": 3, "vectorization_mode": "vector_entry_point", "modules": 2}

    def run():
        envs = gym.make_vec("symbrion_gym/SnakePit-v1", task=Task("mine", **parts), **options)
        envs.reset(seed=0)
        envs.step(np.zeros(envs.action_space.shape))

    with pytest.raises(TaskError, match=message):
        run()


def test_only_of_an_unstable_simulation_a_term_may_be_anything():
    check = check_function("reward 'up'", lambda state: state.up)
    state = SimpleNamespace(num=2, is_sound=np.array([True, False]), up=np.array([1.0, np.inf]))
    assert check(state) is state.up
    state.is_sound[1] = True
    with pytest.raises(TaskError, match="not finite"):
        check(state)


def test_terms_of_ours_are_called_as_they_are():
    assert check_function("reward", gain_progress) is gain_progress
    task = Task("mine")
    assert check_function("progress", task.goal.progress) == task.goal.progress
    for term in task.terminations:
        assert check_function("termination", term.function) is term.function
    assert check_function("progress", Column().progress) != Column().progress


def test_a_term_of_the_right_shape_counts():
    env = OrganismEnv(task=Task("mine", rewards=(Reward("tick", lambda state: state.tick, 2.0),)), modules=2)
    env.reset(seed=0)
    assert env.step(np.zeros(1))[1] == 2.0
