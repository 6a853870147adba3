"""Heights of the ground on a device, beside those of the host."""

import jax
import numpy as np
import pytest

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.warp.state import DeviceGround
from symbrion_gym._src.environment.world import World


@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_heights_are_those_of_the_host(arena):
    scene = World(EnvironmentConfig(arena=arena, modules=2)).scene
    rng = np.random.default_rng(0)
    low, high = scene.arena.surface.bounds
    x, y = rng.uniform(low[:2] - 0.1, high[:2] + 0.1, (2000, 2)).T
    z = np.full(len(x), 5.0)
    wanted = scene.find_ground(x, y, z)
    found = np.asarray(jax.jit(DeviceGround(scene).find_ground)(*np.float32([x, y, z])))
    is_known = np.isfinite(wanted)
    assert (np.isfinite(found) == is_known).mean() > 0.999, "but for places on a rim"
    both = is_known & np.isfinite(found)
    difference = np.abs(found - wanted)[both]
    assert np.median(difference) < 1e-6
    assert (difference < 1e-4).mean() > 0.99, "but for places at a wall"


def test_places_that_are_no_numbers_have_no_ground():
    scene = World(EnvironmentConfig(arena="truth", modules=2)).scene
    places = np.float32([[np.nan, 1e9], [0.0, 0.0], [1.0, 1.0]])
    found = jax.jit(DeviceGround(scene).find_ground)(*places)
    assert np.isnan(np.asarray(found)).all()
