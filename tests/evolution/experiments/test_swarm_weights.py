"""The search for weights: bounds, refusals, equal seeds, and candidates side by side in one world."""

import numpy as np
import pytest

from evolution._src.errors import RunError
from evolution._src.experiments.swarm.weights_search import WeightsConfig, evolve_weights, find_docking_times
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights, list_bounds


@pytest.mark.slow
def test_faster_robots_dock_sooner_side_by_side_in_one_world() -> None:
    config = WeightsConfig(pairs=5, duration=40.0)
    slow, fast = BehaviorWeights(locate_speed=0.015), BehaviorWeights(locate_speed=0.06)
    times = find_docking_times([slow, fast], config, seed=0)
    assert times[0] > times[1] + 5.0
    assert times.max() <= 40.0
    alone = find_docking_times([slow], config, seed=0)
    np.testing.assert_array_equal(alone, find_docking_times([slow], config, seed=0))


def test_the_search_stays_within_bounds_and_repeats_by_the_seed() -> None:
    config = WeightsConfig(
        seed=3, names=("locate_speed",), pairs=2, duration=15.0, population_size=3, generations=2
    )
    first, second = evolve_weights(config), evolve_weights(config)
    assert first.weights == second.weights
    np.testing.assert_array_equal(first.fitness, second.fitness)
    low, high = list_bounds()["locate_speed"]
    assert low <= first.weights.locate_speed <= high
    assert first.weights.dock_speed == BehaviorWeights().dock_speed


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"pairs": 0}, "pairs"),
        ({"sigma": 0.0}, "sigma"),
        ({"seed": -1}, "seed is -1"),
        ({"names": ("speed",)}, "give some of: explore_speed"),
        ({"names": ()}, "give some of"),
    ],
)
def test_impossible_searches_are_refused(values: dict, message: str) -> None:
    with pytest.raises(RunError, match=message):
        WeightsConfig(**values)


def test_stacked_weights_are_one_a_robot_and_stay_within_bounds() -> None:
    stacked = BehaviorWeights.stack([BehaviorWeights(), BehaviorWeights(dock_speed=0.05)], 2)
    np.testing.assert_array_equal(stacked.dock_speed, [0.025, 0.025, 0.05, 0.05])
    with pytest.raises(OptionError, match="dock_speed"):
        BehaviorWeights(dock_speed=np.array([0.01, 9.0]))  # pyright: ignore[reportArgumentType]
