"""What Gymnasium's other vector environments have: call, get_attr, set_attr."""

import gymnasium as gym
import numpy as np
import pytest

from symbrion_gym._src.errors import OptionError


@pytest.fixture(scope="module")
def envs():
    found = gym.make_vec(
        "symbrion_gym/SnakePit-v1", num_envs=3, vectorization_mode="vector_entry_point", modules=2
    )
    found.reset(seed=0)
    return found.unwrapped


def test_attributes_are_read_of_each(envs):
    assert envs.get_attr("dt") == (0.02,) * 3 if hasattr(envs, "dt") else True
    assert [world is envs.world for world in envs.get_attr("world")] == [True] * 3
    domains = envs.get_attr("domain")
    assert len({domain.friction for domain in domains}) == 3
    assert envs.get_attr("action_space")[0] == envs.single_action_space
    assert len({id(rng) for rng in envs.get_attr("np_random")}) == 3
    with pytest.raises(AttributeError):
        envs.get_attr("no_such_attribute")


def test_methods_are_called(envs):
    assert envs.call("render") == (None,) * 3
    assert envs.call("num_envs") == (3, 3, 3)
    assert envs.call("get_attr", "num_envs") == ((3, 3, 3),) * 3


def test_attributes_are_set(envs):
    envs.set_attr("note", "same")
    assert envs.get_attr("note") == ("same",) * 3
    fresh = [np.random.default_rng(seed) for seed in range(3)]
    envs.set_attr("np_random", fresh)
    assert list(envs.get_attr("np_random")) == fresh
    with pytest.raises(OptionError, match="2 values for 3"):
        envs.set_attr("note", [1, 2])
    with pytest.raises(OptionError, match="all simulations share 'note'"):
        envs.set_attr("note", [1, 2, 3])
