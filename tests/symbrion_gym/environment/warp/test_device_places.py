"""Reaching and exploring on a device beside the host: the same terms, fed with the same physics or the same states."""

from dataclasses import replace

import jax
import numpy as np
import pytest
import trimesh
from device_beside_host import RANDOM, Both, run

import symbrion_gym as sg
from symbrion_gym._src.arenas.placed_objects import PlacedObject
from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.warp.state import DeviceGround
from symbrion_gym._src.environment.world import World

SENSES = ("pitch", "goal", "goal_direction")
DRIVEN = {"track_control": "skid", "sensors": SENSES}


@pytest.mark.slow
def test_places_are_reached_in_turn_as_on_the_host():
    places = {"places": ((-1.9, 0.0), (-1.75, 0.05)), "goal": (-1.5, 0.0), "tolerance": 0.06}
    both = Both(arena="gsrm", task="reach", modules=1, start=(-2.1, 0.0), **places, **DRIVEN)
    run(both, 400, 0.9, 1.0)
    memory = both.envs._episodes.state.memory
    np.testing.assert_array_equal(both.episode.memory["reach_number"], memory["reach_number"])
    assert sorted(set(memory["reach_number"])) == [1, 2], "one misses a place, one passes all"
    assert 0 < both.info["success"].sum() < 4
    assert (np.asarray(both.episode.headed) > 0).all(), "by dead reckoning, too"


@pytest.mark.slow
def test_the_way_around_corners_is_as_long_as_on_the_host():
    run(Both(modules=3, task="reach", distance=0.8, randomize=RANDOM, sensors=SENSES), 60, -1.0, 1.0)


@pytest.mark.slow
def test_an_object_is_reached_as_on_the_host():
    box, facing = trimesh.creation.box((0.2, 0.2, 0.2)), np.diag([-1.0, -1.0, 1.0])
    station = PlacedObject("station", np.array([-2.0, 0.3, 0.1]), facing, box)
    arena = replace(sg.load_arena("truth"), objects=(station,))
    options = {"arena": arena, "goal": "station", "start": (-2.35, 0.3), "sensors": ("pitch", "goal")}
    both = Both(task="reach", modules=1, track_control="body", **options)
    run(both, 200, 1.0, 1.0)
    assert both.info["success"].all()


@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_heights_of_the_ground_are_those_of_the_host(arena):
    scene = World(EnvironmentConfig(arena=arena, modules=2)).scene
    low, high = scene.arena.surface.bounds
    x, y = np.random.default_rng(0).uniform(low[:2] - 0.1, high[:2] + 0.1, (2000, 2)).T
    x[0], x[1] = np.nan, 1e9
    z = np.full(len(x), 5.0)
    wanted = scene.find_ground(x, y, z)
    found = np.asarray(jax.jit(DeviceGround(scene).find_ground)(*np.float32([x, y, z])))
    assert np.isnan(found[:2]).all()
    assert (np.isfinite(found) == np.isfinite(wanted)).mean() > 0.999, "but for places on a rim"
    difference = np.abs(found - wanted)[np.isfinite(wanted) & np.isfinite(found)]
    assert np.median(difference) < 1e-6
    assert (difference < 1e-4).mean() > 0.99, "but for places at a wall"
