"""The tick of a device beside that of the host, fed with the same physics of the C engine: no Warp is needed."""

from functools import partial
from typing import Any

import jax
import mujoco
import numpy as np
import pytest
from device_beside_host import NUM, RANDOM, Both, run
from gymnasium.vector import AutoresetMode

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.warp.tick import DeviceRun
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.robot.scout_constants import SENSORS
from symbrion_gym._src.tasks.terms import Termination


@pytest.mark.slow
def test_every_sensor_reads_as_on_the_host():
    sensors = tuple(name for name in SENSORS if name != "goal_direction")
    run(Both(modules=4, start="pit", pit=0.3, sensors=sensors, randomize=RANDOM), 60, -0.3, 0.3)


@pytest.mark.slow
def test_bodies_cross_and_are_rewarded_as_on_the_host():
    both = Both(modules=3, start="pit", pit=0.12, sensors=("pitch", "track_odometry", "goal_direction"))
    run(both, 700, 0.0, 0.0)
    assert both.info["success"].all()
    assert (both.info["reward_success"] > 0.0).all()


@pytest.mark.slow
def test_bodies_fail_and_get_stuck_as_on_the_host():
    both = Both(modules=4, start="pit", pit=0.4, stuck_time=2.0, bottomless=True, failure_cost=1.0)
    run(both, 700, -1.0, 1.0)
    assert not both.running.any()
    assert both.info["stuck"].any() or both.info["touched_pit"].any() or both.info["rolled_over"].any()


@pytest.mark.slow
def test_a_body_that_fails_as_it_arrives_has_not_succeeded_as_on_the_host():
    options: dict[str, Any] = {"modules": 3, "start": "pit", "pit": 0.12, "sensors": ("pitch",)}
    both = Both(**options)
    run(both, 700, 0.0, 0.0)
    assert both.info["success"].all()
    last = int(np.round(both.info["time"].min() / both.envs.config.dt))
    task = World(EnvironmentConfig(**options)).task
    late = Termination("late", partial(is_late, last=last), is_failure=True)
    both = Both(**options, task=task.replace(terminations=(*task.terminations, late)))
    run(both, 700, 0.0, 0.0)
    assert both.info["late"].all()
    assert not both.info["success"].any()


def is_late(state: Any, last: int) -> Any:
    """Return whether a decision has come."""
    return state.tick >= last


@pytest.mark.slow
@pytest.mark.parametrize("control", ["body", "modules", "skid"])
def test_driven_tracks_are_commanded_as_on_the_host(control):
    sensors = ("track_odometry", "goal_direction", "roll", "goal")
    run(Both(modules=2, pit=0.0, track_control=control, sensors=sensors), 40, -1.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["cross_gap", "traverse"])
def test_other_tasks_with_straight_ways_agree(task):
    run(Both(modules=3, task=task, sensors=("pitch",)), 40, -1.0, 1.0)


def test_an_unstable_simulation_ends_as_on_the_host():
    both = Both(modules=2, pit=0.0, sensors=("pitch", "hinge_rate"))
    both.envs.batch.bind("qvel")[1, 0] = 1e4
    both.step(np.zeros(both.envs.action_space.shape), unstable=1)
    assert both.info["diverged"].tolist() == [False, True, False, False]


def test_noise_stays_within_the_bounds():
    both = Both(modules=2, pit=0.0, noise=100.0)
    episodes = both.host.episodes
    noisy = DeviceRun(both.envs.world, episodes, NUM, None, AutoresetMode.DISABLED)
    seen = noisy._add_noise(both.episode.observation, jax.random.key(0))
    low, high = map(np.float32, (episodes.observer.low, episodes.observer.high))
    np.testing.assert_array_equal(seen, np.clip(seen, low, high))
    assert (seen == low).any()


def count_low(state: Any) -> Any:
    """Return whether a body was low for five ticks: a term of a user, for NumPy and JAX."""
    ticks = state.remember("low_ticks", 0.0)
    is_low = state.xp.minimum(state.lowest, state.middle[:, 2]) < 10.0
    state.keep("low_ticks", ticks + 1.0, is_low & (state.tick >= 3.0))
    return state.remember("low_ticks", 0.0) >= 5.0


@pytest.mark.slow
def test_a_term_of_a_user_remembers_as_on_the_host():
    task = World(EnvironmentConfig(modules=2, pit=0.0)).task
    own = Termination("low", count_low)
    both = Both(modules=2, pit=0.0, sensors=("pitch",), task=task.replace(terminations=(own,)))
    run(both, 12, -1.0, 1.0)
    assert both.info["low"].all()
    assert both.info["time"] == pytest.approx(7 * both.envs.config.dt)


@pytest.mark.parametrize(("sensor", "is_cast"), [("contact", False), ("laser", True), ("ir", True)])
def test_without_rays_in_the_observation_none_is_cast(sensor, is_cast):
    model = World(EnvironmentConfig(modules=2, pit=0.0, sensors=("pitch", sensor))).model
    assert (model.sensor_type == mujoco.mjtSensor.mjSENS_RANGEFINDER).any() == is_cast
