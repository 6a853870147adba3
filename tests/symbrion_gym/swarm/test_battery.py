"""What batteries lose, and what docked robots share."""

import numpy as np
import pytest

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm.battery import Batteries, BatteryConfig
from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

CONFIG = BatteryConfig(capacity=1000.0)


def make_state(count, run=0.0, hinge=0.0, links=()):
    zero = np.zeros((count, 3))
    rotation = np.tile(np.eye(3), (count, 1, 1))
    return SwarmState(
        zero,
        rotation,
        zero,
        zero,
        np.full(count, hinge),
        links,
        np.zeros((count, 4)),
        np.full((count, 2), run),
    )


def step(batteries, count, run=0.0, hinge=0.0, links=()):
    batteries.step(make_state(count, links=links), make_state(count, run, hinge, links), 0.1, 0.8)


def test_a_resting_robot_spends_its_idle_power_and_a_driving_one_more():
    batteries = Batteries(1, CONFIG)
    step(batteries, 1)
    assert batteries.charge[0] == pytest.approx(1000.0 - 0.1 * CONFIG.idle_power)
    step(batteries, 1, run=-0.01, hinge=0.08)
    power = 2 * CONFIG.idle_power + CONFIG.drive_power + CONFIG.hinge_power
    assert batteries.charge[0] == pytest.approx(1000.0 - 0.1 * power)


@pytest.mark.parametrize("charge", [[1.0, 0.2, 0.0], [0.0, 0.2, 1.0]])
def test_docked_robots_share_until_they_are_equal_and_never_gain(charge):
    config = BatteryConfig(capacity=1000.0, idle_power=0.0)
    batteries = Batteries(3, config, charge=charge)
    links = (Docking(0, "back", 1, "front"), Docking(1, "back", 2, "front"))
    total = batteries.charge.sum()
    for _ in range(3000):
        before = batteries.charge
        step(batteries, 3, links=links)
        assert batteries.charge.sum() <= before.sum() + 1e-9
        assert np.abs(batteries.charge - before).max() <= 2 * 0.1 * config.share_power + 1e-9
    assert np.ptp(batteries.charge) < 1.0
    assert 0.8 * total < batteries.charge.sum() < total


def test_robots_apart_share_nothing():
    batteries = Batteries(2, BatteryConfig(capacity=1000.0, idle_power=0.0), charge=[1.0, 0.0])
    step(batteries, 2)
    np.testing.assert_array_equal(batteries.charge, [1000.0, 0.0])


def test_an_empty_robot_stands_still():
    batteries = Batteries(2, CONFIG, charge=[0.0, 1.0])
    commands = SwarmCommands(np.full((2, 2), 0.1), np.ones(2), np.ones((2, 4), bool))
    limited = batteries.limit(commands, make_state(2, hinge=0.3))
    np.testing.assert_array_equal(limited.tracks, [[0.0, 0.0], [0.1, 0.1]])
    np.testing.assert_array_equal(limited.hinge, [0.3, 1.0])
    assert limited.latch.all()
    step(batteries, 2)
    assert batteries.charge[0] == 0.0


def test_refusals():
    with pytest.raises(OptionError, match="between 0 and 1"):
        Batteries(1, charge=1.5)
    for options in ({"capacity": 0.0}, {"idle_power": -1.0}, {"share_efficiency": 1.1}):
        with pytest.raises(OptionError, match=next(iter(options))):
            BatteryConfig(**options)
