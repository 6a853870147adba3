"""Robots on friction patches: the rule of contact, reset options, and cuts that robots do not feel."""

from dataclasses import replace

import numpy as np
import pytest
from side_by_side import assert_equal_ticks

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import snake

PATCH = (-1.9, -1.5, 0.2)


def make_env(patches: tuple[tuple[float, ...], ...], **options) -> OrganismEnv:
    arena = Arena.from_course(Course(friction_patches=patches))
    return OrganismEnv(arena=arena, modules=2, **options)


def test_friction_scales_with_that_of_the_episode() -> None:
    env = make_env((PATCH,))
    world = env.world
    for friction, wanted in ((0.7, 0.2), (0.35, 0.1)):
        env.reset(seed=0, options={"friction": friction})
        assert env.model.geom_friction[world.patch_geoms, 0] == pytest.approx(wanted)
        assert (env.model.geom_friction[world.robot_geoms, 0] == friction).all()


def test_patches_move_within_their_intervals() -> None:
    found = FrictionMap((FrictionPatch.of_rectangle((-2.0, -1.0), (-1.5, 1.0), 0.3, 0.1),))
    arena = Arena.from_course(Course())
    env = OrganismEnv(arena=replace(arena, friction_map=found), modules=2)
    for place, wanted in ((-1.0, 0.2), (0.0, 0.3), (1.0, 0.4)):
        _, info = env.reset(seed=0, options={"patch_friction": place})
        assert env.model.geom_friction[env.world.patch_geoms, 0] == pytest.approx(wanted)
        assert info["patch_friction"] == place


def test_contacts_have_the_friction_of_the_ground_that_they_are_on() -> None:
    env = make_env((PATCH,))
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.zeros(env.action_space.shape))
    contacts = env.data.contact
    found = {
        (bool(set(pair) & set(env.world.patch_geoms)), round(float(friction[0]), 6))
        for pair, friction in zip(contacts.geom, contacts.friction, strict=True)
    }
    assert found == {(True, 0.2), (False, 0.7)}, "half of the robot stands on the patch"


def test_vector_and_single_environments_agree() -> None:
    arena = Arena.from_course(Course(friction_patches=(PATCH, (-1.2, -0.8, 0.4))))
    options = {"friction": (0.5, 0.9), "patch_friction": (-1.0, 1.0)}
    envs = OrganismVectorEnv(2, arena=arena, modules=2, randomize=options)
    singles = [OrganismEnv(arena=arena, modules=2, randomize=options) for _ in range(2)]
    first, _ = envs.reset(seed=3)
    for i, single in enumerate(singles):
        np.testing.assert_array_equal(single.reset(seed=3 + i)[0], first[i])
    assert_equal_ticks(envs, singles, 20, np.random.default_rng(0))


def drive(patches: tuple[tuple[float, ...], ...], seconds: float = 12.0) -> np.ndarray:
    """Return the heights of two docked modules that drive over floor, ramp and plateau [m]."""
    arena = Arena.from_course(Course(friction_patches=patches))
    env = OrganismEnv(arena=arena, organism=snake(2), randomize={})
    env.reset(seed=0)
    heights = []
    for _ in range(int(seconds / env.dt)):
        env.step(np.zeros(env.action_space.shape))
        heights.append([*env.data.qpos[:3]])
    return np.array(heights)


def test_cuts_are_not_felt() -> None:
    bars = [(x, x + 0.07, 0.7) for x in np.arange(-2.5, -0.3, 0.15)]
    whole, cut = drive(()), drive(tuple(bars))
    grid = np.linspace(-1.7, -0.8, 200)
    apart = np.interp(grid, cut[:, 0], cut[:, 2]) - np.interp(grid, whole[:, 0], whole[:, 2])
    assert np.abs(apart).max() < 2e-4, "30 cuts across the way"
    assert abs(cut[-1, 0] - whole[-1, 0]) < 0.005


def test_a_slope_of_ice_is_not_climbed() -> None:
    assert drive(((-1.6, -0.9, 0.15),))[-1, 0] < drive(())[-1, 0] - 0.2


def test_places_beyond_the_intervals_and_arenas_without_patches_are_refused() -> None:
    for value in (1.5, -2.0, (-1.0, 3.0)):
        with pytest.raises(OptionError, match="patch_friction must be"):
            make_env((PATCH,)).reset(options={"patch_friction": value})
    with pytest.raises(OptionError, match="no friction patches"):
        make_env(()).reset(options={"patch_friction": 0.5})
    make_env(()).reset(options={"patch_friction": 0.0})
