"""What tests of many simulations share: the same ticks in one vector environment and one by one."""

import numpy as np

REWARDS = ("reward_forward", "reward_success", "reward_failure", "reward_effort")
NUMBERS = ("x_position", "progress", "time", *REWARDS, "lowest_module", "least_upright")
FLAGS = ("success", "diverged", "rolled_over", "fell", "touched_pit", "stuck")
"""Of `info`."""


def assert_equal_ticks(vector, singles, ticks, rng):
    """Step both with the same random actions until all are done; nothing may differ by a bit."""
    done = np.zeros(len(singles), dtype=bool)
    for tick in range(ticks):
        if tick % 25 == 0:
            actions = rng.uniform(-0.7, 1.0, vector.action_space.shape)
        observation, reward, terminated, truncated, info = vector.step(actions)
        for i in np.flatnonzero(~done):
            one = singles[i].step(actions[i])
            np.testing.assert_array_equal(observation[i], one[0])
            assert (reward[i], terminated[i], truncated[i]) == one[1:4]
            assert all(info[name][i] == value for name, value in one[4].items())
        done |= terminated | truncated
