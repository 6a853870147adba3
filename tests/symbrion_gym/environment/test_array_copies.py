"""Deep copies in which arrays stay views of each other."""

import copy

import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv, link_views


def test_views_share_the_memory_of_the_copy():
    whole = np.arange(12.0).reshape(3, 4)
    source = {"whole": whole, "rows": [whole[1], whole[:, ::2].T], "own": np.zeros(2)}
    memo = {}
    link_views(source, memo)
    twin = copy.deepcopy(source, memo)
    twin["whole"][1] = 7.0
    np.testing.assert_array_equal(twin["rows"][0], 7.0)
    np.testing.assert_array_equal(twin["rows"][1][:, 1], 7.0)
    np.testing.assert_array_equal(whole[1], [4.0, 5.0, 6.0, 7.0])
    assert not np.shares_memory(twin["own"], source["own"])


@pytest.mark.parametrize("task", ["snake_pit", "reach"])
def test_a_deep_copy_of_an_environment_ends_and_is_rewarded_alike(task: str):
    env = OrganismEnv(arena="gsrm" if task == "reach" else "truth", task=task, modules=2, stuck_time=2.0)
    env.reset(seed=0)
    for _ in range(30):
        env.step(np.zeros(1))
    twin = copy.deepcopy(env)
    while True:
        observation, *outcome = env.step(np.full(1, 0.9))
        again, *outcome_again = twin.step(np.full(1, 0.9))
        np.testing.assert_array_equal(observation, again)
        assert outcome == outcome_again
        if outcome[1] or outcome[2]:
            break
    assert outcome[3]["time"] > 0.6
