"""Actions become targets of servos and speeds of tracks, on the left and on the right."""

import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import OptionError


def find_heading(env):
    forward = env.physics.rotation[0, 0, [0, 3]]
    return np.arctan2(forward[1], forward[0])


def test_a_lone_scout_turns_on_the_spot_and_drives_straight():
    env = OrganismEnv(modules=1, track_control="skid", track_speed=0.05)
    env.reset(seed=0)
    assert env.action_space.shape == (2,)
    before, place = find_heading(env), env.physics.position[0, 0].copy()
    for _ in range(50):
        env.step(np.array([-1.0, 1.0]))
    turned = find_heading(env) - before
    assert 0.5 < turned < 1.1  # without slip it would be 1 s * 0.05 m/s / 0.0325 m
    assert np.linalg.norm(env.physics.position[0, 0] - place) < 0.01
    place = env.physics.position[0, 0].copy()
    for _ in range(50):
        env.step(np.ones(2))
    way = env.physics.position[0, 0] - place
    assert np.linalg.norm(way) == pytest.approx(0.05, abs=0.005)
    assert np.arctan2(way[1], way[0]) == pytest.approx(find_heading(env), abs=0.1)


@pytest.mark.parametrize("control", ["skid", "modules"])
def test_each_number_goes_to_its_own_side_of_its_own_module(control):
    """In a tree, parts are not in the order of the modules."""
    env = OrganismEnv(organism="H", track_control=control)
    env.reset(seed=0)
    hinges, modules = env.world.num_hinges, env.world.num_modules
    sides = 2 if control == "skid" else 1
    speeds = np.linspace(-1.0, 1.0, modules * sides)
    env.step(np.concatenate([np.zeros(hinges), speeds]))
    for module in range(modules):
        for k, left in ((0, True), (9, False)):
            name = f"module_{module}_track_{k}"
            rate = env.model.geom_surfacevel[env.model.geom(name).id, 4]
            assert (env.model.geom(name).pos[1] > 0) or env.world.is_by_site or not left
            wanted = speeds[module * sides + (0 if left or sides == 1 else 1)]
            assert rate == pytest.approx(0.1 * wanted / 0.02)


def test_what_is_not_a_number_is_refused_where_a_simulation_is_stepped():
    envs = OrganismVectorEnv(
        2, modules=2, track_control="skid", autoreset_mode="Disabled", max_episode_steps=2
    )
    envs.reset(seed=0)
    first, second = np.array([[0.0, 1e200, -0.5, 0.3, 0.3]] * 2), np.zeros((2, 5))
    envs.step(first)
    second[1, 2] = np.nan
    with pytest.raises(OptionError, match=r"action\[2\] of simulation 1 \(track speed 1\) is nan"):
        envs.step(second)
    envs.step(first)
    envs.reset(options={"reset_mask": np.array([True, False])})
    envs.step(second)  # the other one has ended
    part = envs.observation_structure["previous_action"]
    np.testing.assert_array_equal(envs.step(second)[0][:, part], [second[0], np.clip(first[1], -1.0, 1.0)])
