"""What docked robots sense as one organism."""

import numpy as np
import pytest

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.senses import find_modules, read_organism
from tests.symbrion_gym.swarm.dynamic_cases import ARENA, make_docked, make_row


def test_modules_are_found_from_the_head():
    world, _ = make_docked(3)
    assert find_modules(world, [2, 0, 1]) == (0, 1, 2)


def test_readings_of_a_level_organism():
    world, commands = make_docked(3)
    for _ in range(5):
        world.step(commands)
    parts = read_organism(world, [0, 1, 2])
    assert [len(parts[name]) for name in ("hinge_angle", "pitch", "roll", "contact")] == [2, 3, 3, 3]
    assert np.abs(parts["pitch"]).max() < 0.01
    weight = 3 * (world.scout.chassis_mass + world.scout.arm_mass) * 9.81
    assert parts["contact"].sum() == pytest.approx(weight, rel=0.05)


def test_lone_robots_are_no_organism():
    world = DynamicWorld(ARENA, 2)
    world.reset(make_row(2, gap=0.1))
    with pytest.raises(OptionError, match="not one organism"):
        read_organism(world, [0, 1])
