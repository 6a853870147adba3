"""Champions in robots that have docked into their body."""

import numpy as np
import pytest

from evolution._src.champions.docked import DockedChampion
from evolution._src.errors import RunError
from evolution._src.search.validation import Champion
from symbrion_gym._src.swarm.world import SwarmCommands
from tests.symbrion_gym.swarm.swarm_cases import make_docked

NUM_GENES = 12


def make_champion(modules, value=0.0):
    names = tuple(f"slope_{k}" for k in range(NUM_GENES))
    return Champion(
        genotype=(value,) * NUM_GENES,
        names=names,
        arena="truth",
        generation=0,
        fitness=0.0,
        successes=0,
        trials=0,
        modules=modules,
        controller="path",
    )


@pytest.mark.slow
def test_docked_robots_drive_ahead_together():
    world, _ = make_docked(3)
    driver = DockedChampion(make_champion(3), world, [0, 1, 2], start=-1.8)
    before = world.state.position[:, 0].copy()
    for _ in range(25):
        driver.step(SwarmCommands.make_idle(3))
    np.testing.assert_allclose(world.state.position[:, 0] - before, 0.05, atol=0.012)
    assert driver.track_odometry == pytest.approx(-1.75, abs=1e-3)
    assert len(world.state.links) == 2


def test_another_body_is_refused():
    world, _ = make_docked(3)
    with pytest.raises(RunError, match="have not docked into the body"):
        DockedChampion(make_champion(4), world, [0, 1, 2], start=0.0)


def test_another_order_is_refused():
    world, _ = make_docked(3)
    with pytest.raises(RunError, match="have not docked into the body"):
        DockedChampion(make_champion(3), world, [1, 0, 2], start=0.0)
