"""What the head believes: where it is by its tracks, and where the goal lies from there."""

from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from side_by_side import assert_equal_ticks

from symbrion_gym._src.environment.observation import find_motion
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import cross, snake

LONE = {"organism": 1, "track_control": "skid", "arena": "truth", "sensors": ("goal_direction", "goal")}
FLAT = {**LONE, "start": (-2.7, 0.0), "goal": (-1.9, 0.0)}


def make(**options) -> OrganismEnv:
    return OrganismEnv(**{**FLAT, **options})


def read(env: OrganismEnv, observation: np.ndarray) -> tuple[float, float]:
    bearing, distance = observation[env.observation_structure["goal_direction"]]
    return float(bearing), float(distance)


def run(env: OrganismEnv, action: tuple[float, float], ticks: int) -> np.ndarray:
    observation = np.zeros(0)
    for _ in range(ticks):
        observation = env.step(np.array(action))[0]
    return observation


def test_straight_ahead_the_distance_shrinks_by_what_the_tracks_run():
    env = make()
    observation, _ = env.reset(seed=0)
    assert read(env, observation) == pytest.approx((0.0, 0.8), abs=1e-6)
    assert read(env, run(env, (1.0, 1.0), 100)) == pytest.approx((0.0, 0.6), abs=1e-3)


def test_a_place_to_the_left_has_a_positive_bearing():
    env = make(task="reach", goal=(-1.9, 0.6))
    env.reset(seed=0)
    observation = run(env, (0.0, 0.0), 3)  # corners nearby are passed first
    ahead, left = observation[env.observation_structure["goal"]]
    assert read(env, observation) == pytest.approx((np.arctan2(left, ahead), np.hypot(ahead, left)), abs=1e-3)


def test_turning_to_the_left_turns_the_goal_to_the_right_at_half_the_rate_without_slip():
    env = make()
    env.reset(seed=0)
    bearing, distance = read(env, run(env, (-1.0, 1.0), 25))
    half_width = env.world.organism.scout.size[1] / 2 - env.world.organism.scout.track_radius
    assert bearing == pytest.approx(-0.5 * 0.5 * 0.10 / half_width, rel=1e-6)
    assert distance == pytest.approx(0.8, abs=1e-3)
    rotation = env.physics.rotation[0, 0]
    assert np.arctan2(rotation[3], rotation[0]) == pytest.approx(-bearing, rel=0.1)


def test_the_noise_of_the_start_is_not_known():
    readings = []
    for seed in range(3):
        env = make(
            randomize={"start_offset": (-0.05, 0.05), "start_lateral": (-0.05, 0.05), "yaw": (-0.5, 0.5)}
        )
        readings.append(read(env, env.reset(seed=seed)[0]))
    assert readings == [readings[0]] * 3


def test_corners_are_passed_by_the_estimate():
    env = make(task="reach", start=(-2.7, -0.5), goal=(-1.9, 0.5), places=((-2.4, 0.2),))
    env.reset(seed=0)
    believed = env._episodes.believed
    for corner in env.world.route.corners[:-1]:
        believed[0] = *corner, 0.0
        bearing, distance = read(env, run(env, (0.0, 0.0), 2))
        assert distance > 0.05
    last = env.world.route.corners[-1]
    believed[0] = last[0] - 0.3, last[1] - 0.3, 0.0
    bearing, distance = read(env, run(env, (0.0, 0.0), 5))
    assert (bearing, distance) == pytest.approx((pi / 4, np.hypot(0.3, 0.3)), abs=1e-6)
    believed[0] = *last, 0.0
    assert read(env, run(env, (0.0, 0.0), 5))[1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("away", "has_passed"), [(0.09, False), (0.07, True)])
def test_a_place_is_passed_in_belief_nearer_than_counts_as_there(away, has_passed):
    """Within 0.105 m counts: one that turns at the very edge would miss the place by any error of its belief."""
    env = make(task="reach", places=((-2.3, 0.0),))
    env.reset(seed=0)
    env._episodes.believed[0] = -2.3 - away, 0.0, 0.0
    assert (read(env, run(env, (0.0, 0.0), 2))[1] > 0.2) == has_passed


@pytest.mark.slow
@pytest.mark.parametrize("body", [1, "cross"])
def test_single_and_many_are_equal_to_the_bit(body):
    options = {**LONE, "task": "reach", "distance": 0.5, "arena": "gsrm", "organism": body}
    options["randomize"] = {"yaw": (-0.5, 0.5), "start_offset": (-0.02, 0.02)}
    envs, singles = OrganismVectorEnv(2, **options), [OrganismEnv(**options) for _ in range(2)]
    many, _ = envs.reset(seed=4)
    for i, single in enumerate(singles):
        np.testing.assert_array_equal(single.reset(seed=4 + i)[0], many[i])
    assert_equal_ticks(envs, singles, 30, np.random.default_rng(0))


def test_motion_of_a_straight_body():
    ahead, left, turn = find_motion(snake(1))
    half_width = 0.105 / 2 - 0.02
    assert ahead == pytest.approx([0.5, 0.5])
    assert left == pytest.approx([0.0, 0.0])
    assert turn == pytest.approx([-1 / (4 * half_width), 1 / (4 * half_width)])
    ahead, left, turn = find_motion(snake(4))
    assert ahead.sum() == pytest.approx(1.0)
    assert turn[1] > 0 > turn[0]
    assert left[1] > 0  # the head lies before the middle
    assert find_motion(cross(1))[0].sum() == pytest.approx(0.6)  # two arms look to the side


def test_a_part_of_the_simulations_may_begin_first():
    """As in evolution, where those that have not begun head for nothing; straight gaps have a single place."""
    options = {"organism": 1, "track_control": "skid", "arena": "gsrm", "task": "cross_gap"}
    envs = OrganismVectorEnv(3, autoreset_mode="Disabled", sensors=("goal_direction",), **options)
    observation, _ = envs.reset(seed=0, options={"reset_mask": np.array([True, False, False])})
    one, _ = OrganismEnv(sensors=("goal_direction",), **options).reset(seed=0)
    assert np.array_equal(observation[0], one)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"size": 0}, TaskError, "a size of 1 or more"),
        ({"low": (0.0, 1.0, 2.0)}, TaskError, "finite low < high of that size"),
        ({"name": "a b"}, TaskError, "a name is an identifier"),
        ({"function": 3}, TaskError, "cannot be called"),
        (
            {"function": lambda state: state.tick},
            TaskError,
            r"returned \(1,\); an array of shape \(1, 2\) is needed",
        ),
        ({"function": lambda state: state.up * np.nan}, TaskError, "sensor 'up' returned .* not finite"),
        ({"name": "pitch"}, OptionError, "two sensors have one name"),
    ],
)
def test_bad_sensors_of_ones_own_are_refused(changes, error, message):
    given = {"name": "up", "size": 2, "low": -1.0, "high": (1.0, 1.0), "function": lambda state: state.up}
    with pytest.raises(error, match=message):
        OrganismEnv(modules=2, sensors=("pitch", SimpleNamespace(**given | changes))).reset(seed=0)


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
