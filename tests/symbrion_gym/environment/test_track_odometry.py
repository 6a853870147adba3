"""Dead reckoning: what the tracks ran, from where the map says that the robot starts."""

import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv

OPTIONS = {"modules": 2, "sensors": ("track_odometry", "pitch")}


def drive(environment: OrganismEnv, ticks: int, action: float = 0.0) -> list[np.ndarray]:
    return [environment.step(np.full(environment.action_space.shape, action))[0] for _ in range(ticks)]


def test_it_begins_where_the_map_has_the_start_and_knows_no_offset():
    environment = OrganismEnv(**OPTIONS, start="pit")
    start = environment.world.route.start
    for offset in (-0.05, 0.0, 0.05):
        observation, info = environment.reset(seed=0, options={"start_offset": offset})
        assert observation[0] == start
        assert info["x_position"] == pytest.approx(start + offset)


def test_it_does_not_know_that_the_arena_is_longer_than_its_map():
    places = [OrganismEnv(**OPTIONS, stretch=factor).reset(seed=0)[0][0] for factor in (0.975, 1.0, 1.025)]
    assert places == pytest.approx([places[1]] * 3)


def test_it_adds_the_way_of_the_tracks_by_the_pitch_of_the_head():
    environment = OrganismEnv(**OPTIONS)
    observation, _ = environment.reset(seed=0)
    observations = np.array([observation, *drive(environment, 200)])
    way = np.diff(observations[:, 0])
    assert way == pytest.approx(0.1 * environment.dt * np.cos(observations[1:, 1]))
    head = environment.physics.position[0, 0, 0]
    assert observations[-1, 0] == pytest.approx(head, abs=0.03)


def test_tracks_that_slip_are_believed():
    environment = OrganismEnv(**OPTIONS, pit=0.0, friction=0.02)
    observation, _ = environment.reset(seed=0)
    last = drive(environment, 1500)[-1]
    assert (
        last[0] - observation[0] > environment.physics.position[0, 0, 0] - environment.world.route.start + 0.5
    )


def test_it_goes_by_the_commanded_speed_of_the_head_the_mean_of_its_sides():
    for control, speeds in (("modules", [-0.5, 1.0]), ("skid", [-1.0, 0.5, 0.3, 0.3])):
        environment = OrganismEnv(**OPTIONS, track_control=control)
        before, _ = environment.reset(seed=0)
        after = environment.step(np.array([0.0, *speeds]))[0]
        wanted = -0.5 if control == "modules" else -0.25
        assert after[0] - before[0] == pytest.approx(wanted * 0.1 * environment.dt, rel=1e-3)


def test_a_reset_of_others_adds_nothing():
    environment = OrganismVectorEnv(2, autoreset_mode="Disabled", **OPTIONS)
    environment.reset(seed=0)
    before, *_ = environment.step(np.zeros((2, 1)))
    after, _ = environment.reset(options={"reset_mask": np.array([True, False])})
    assert after[1, 0] == before[1, 0]
    assert after[0, 0] < before[0, 0]
