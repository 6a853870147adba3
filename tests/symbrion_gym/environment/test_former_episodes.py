"""`SnakePit-v0` behaves as before tasks became values: observations, rewards and flags of whole episodes."""

import pytest
from former_episodes import OPTIONS, SEEDS, digest

from symbrion_gym._src.environment.organism_env import OrganismEnv

BEFORE = {
    "pit": ["fedd794f3c74ccf9", "6f02c72b3143a79e"],
    "stretched": ["2cb79370666ae520", "b613af54c19cc8f9"],
    "randomized": ["027269ef10373b0e", "dc1f9460773323d6"],
    "bottomless": ["318dbff12344c29b", "af5b2d80c5740fdd"],
    "noisy": ["f5c601ceab796490", "1ce6304fc321cfd9"],
    "stairs": ["8843686a5d19633f", "b2dfd9f9a7b7ae53"],
    "turned": ["b4fad53a37a1fde9", "59948ca8c700c481"],
    "crossing": ["b4999d5c18b8f33b", "00f2c79f6e10d1c5"],
    "stuck": ["86a4e1889d9e0dbb", "ffc5906e80feace4"],
}
"""Digests of the last commit before, one for each of `SEEDS`."""


@pytest.mark.parametrize("name", OPTIONS)
def test_episodes_are_as_before(name: str) -> None:
    env = OrganismEnv(**OPTIONS[name])
    assert [digest(env, seed) for seed in SEEDS] == BEFORE[name]
