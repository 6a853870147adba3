"""The environment: conventions of Gymnasium, the strict test, bad input, copies."""

import copy
import pickle
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from scanned_surface import make_scanned_surface
from side_by_side import FLAGS, NUMBERS

import symbrion_gym as sg
from symbrion_gym._src.environment.config import DEFAULT_SENSORS
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.registration import ENVIRONMENTS
from symbrion_gym._src.robot.scout_constants import SensorNoise

EXTRA_SENSORS = ("odometry", "track_odometry", "laser", "hinge_target", "dock_force")


@pytest.mark.slow
@pytest.mark.parametrize("name", list(ENVIRONMENTS))
def test_every_id_passes_the_checker_without_warnings(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*out of date")  # of every v0 that has a v1
        env = gym.make(name, modules=3)
        check_env(env.unwrapped, skip_render_check=True)
        env.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hfield", "prisms"])
def test_every_arena_kind_passes_the_checker_without_warnings(kind):
    arena = sg.make_arena(make_scanned_surface(sg.Course().profile(), num_vertices=800), kind=kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gym.make("symbrion_gym/SnakePit-v1", arena=arena, modules=3)
        check_env(env.unwrapped, skip_render_check=True)
        env.close()


@pytest.mark.slow
def test_zero_controller_crosses_a_narrow_pit_and_not_a_wide_one():
    outcomes = {}
    for pit in (0.20, 0.40):
        env = OrganismEnv(modules=6, pit=pit, start="pit")
        env.reset(seed=0)
        while True:
            _, _, terminated, truncated, info = env.step(np.zeros(5))
            if terminated or truncated:
                break
        outcomes[pit] = info
        assert terminated == info["success"]
    assert outcomes[0.20]["success"]
    assert not outcomes[0.40]["success"]
    assert outcomes[0.40]["stuck"]


def test_reward_is_the_sum_of_its_terms_and_progress_that_of_rewards():
    env = OrganismEnv(modules=4, start="pit")
    env.reset(seed=0)
    total = 0.0
    for _ in range(50):
        _, reward, _, _, info = env.step(np.full(3, 0.1))
        terms = info["reward_forward"] + info["reward_success"] + info["reward_effort"]
        assert reward == pytest.approx(terms, abs=1e-15)
        total += info["reward_forward"]
    assert total == pytest.approx(info["progress"], abs=1e-12)
    assert 0.05 < info["progress"] < 0.12


def test_observation_follows_its_structure():
    env = OrganismEnv(modules=5, sensors=(*DEFAULT_SENSORS, *EXTRA_SENSORS))
    observation, _ = env.reset(seed=0)
    parts = env.observation_structure
    assert [s.stop - s.start for s in parts.values()] == [4, 4, 5, 5, 30, 24, 5, 4, 1, 1, 19, 4, 12]
    assert list(parts.values())[-1].stop == len(observation) == env.observation_space.shape[0]
    np.testing.assert_allclose(observation[parts["pitch"]], 0.0, atol=1e-6)
    for _ in range(40):
        observation, *_ = env.step(np.array([0.3, 0.0, 0.0, 0.0]))
    assert observation[parts["hinge_angle"]][0] > 0.1
    assert observation[parts["pitch"]][0] > 0.1
    assert observation[parts["contact"]].sum() > 0.5 * 5 * 0.95 * 9.81
    np.testing.assert_allclose(observation[parts["previous_action"]], [0.3, 0, 0, 0])
    gravity = observation[parts["acceleration"]].reshape(5, 6)[4, [2, 5]]
    np.testing.assert_allclose(gravity, 9.81, atol=4.0)


@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_actions_that_are_no_numbers_are_refused_by_name(value):
    env = OrganismEnv(modules=3, start="pit", track_control="body")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=rf"action\[1\] \(hinge 1\) is {value}; a number from -1 to 1"):
        env.step(np.array([0.0, value, 0.0]))
    with pytest.raises(ValueError, match=rf"action\[2\] \(track speed 0\) is {value}"):
        env.step(np.array([0.0, 0.0, value]))


def test_large_numbers_in_actions_do_no_harm():
    env = OrganismEnv(modules=3, start="pit")
    env.reset(seed=0)
    for _ in range(20):
        observation, reward, *_ = env.step(np.array([1e30, -1e200]))
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward)


def test_actions_of_another_shape_are_refused():
    env = OrganismEnv(modules=3)
    env.reset(seed=0)
    for shape in ((), (1,), (3,), (1, 2)):
        with pytest.raises(ValueError, match=r"shape \(2,\)"):
            env.step(np.zeros(shape))


def test_divergence_ends_the_episode_with_a_finite_reward():
    env = OrganismEnv(modules=3)
    env.reset(seed=0)
    env.data.qvel[0] = 1e9
    observation, reward, terminated, _, info = env.step(np.zeros(2))
    assert terminated
    assert info["diverged"]
    assert np.isfinite(reward)
    assert env.observation_space.contains(observation)
    env.reset(seed=0)
    assert not env.step(np.zeros(2))[2]


@pytest.mark.parametrize(
    ("places", "values", "flag"), [(slice(3, 7), [0, 1, 0, 0], "rolled_over"), (1, 1.05, "fell")]
)
def test_lying_on_the_back_and_leaving_the_course_end_the_episode(places, values, flag):
    env = OrganismEnv(modules=3)
    env.reset(seed=0)
    env.data.qpos[places] = values
    *_, terminated, _, info = env.step(np.zeros(2))
    assert terminated
    assert info[flag]
    assert not info["success"]


@pytest.mark.parametrize(
    ("modules", "x", "ticks"),
    [pytest.param(4, 0.45, 5, id="reached over"), pytest.param(3, 0.5, 40, id="too fast")],
)
def test_a_body_that_did_not_drive_all_of_the_way_has_not_succeeded(modules, x, ticks):
    env = OrganismEnv(modules=modules, start="pit", pit=0.2)
    env.reset(seed=0)
    env.data.qpos[:] = [x, 0.0, 0.25 + 0.0525, 1.0, *[0.0] * (modules + 2)]
    assert not any(env.step(np.zeros(modules - 1))[4]["success"] for _ in range(ticks))


@pytest.mark.parametrize("control", ["body", "modules"])
def test_track_speeds_can_be_part_of_the_action(control):
    env = OrganismEnv(modules=3, track_control=control)
    count = 1 if control == "body" else 3
    assert env.action_space.shape == (2 + count,)
    env.reset(seed=0)
    ahead = [env.step(np.r_[0, 0, np.ones(count)])[4]["x_position"] for _ in range(50)]
    back = [env.step(np.r_[0, 0, -np.ones(count)])[4]["x_position"] for _ in range(50)]
    assert ahead[-1] - ahead[0] == pytest.approx(0.098, abs=0.02)
    assert back[-1] < back[0] - 0.07


def test_noise_stays_within_the_bounds():
    env = OrganismEnv(modules=2, noise=100.0)
    envs = gym.make_vec(
        "symbrion_gym/SnakePit-v1", 2, vectorization_mode="vector_entry_point", modules=2, noise=100.0
    )
    for made in (env, envs):
        observation, _ = made.reset(seed=0)
        for _ in range(5):
            assert made.observation_space.contains(observation)
            observation = made.step(np.zeros(made.action_space.shape))[0]
        made.close()


def test_sensor_noise_can_be_chosen():
    options = {
        "modules": 2,
        "noise": 2.0,
        "sensors": ["pitch", "roll"],
        "sensor_noise": SensorNoise(pitch=0.03),
    }
    env = OrganismEnv(**options)
    noisy = np.array([env.reset(seed=seed)[0] for seed in range(200)])
    np.testing.assert_allclose(noisy.std(axis=0), [0.06, 0.06, 0.02, 0.02], rtol=0.2)


def test_reset_options_are_drawn_from_ranges_and_reported():
    env = OrganismEnv(modules=3, randomize={"yaw": (-0.1, 0.1)})
    _, info = env.reset(seed=1, options={"friction": (0.5, 0.9), "torque_scale": 1.1})
    assert 0.5 <= info["friction"] <= 0.9
    assert info["torque_scale"] == 1.1
    assert -0.1 <= info["yaw"] <= 0.1
    assert info["yaw"] != 0.0
    assert (env.model.geom_friction[env.world.robot_geoms, 0] == info["friction"]).all()
    np.testing.assert_allclose(env.model.actuator("hinge_1").forcerange, [-4.95, 4.95])
    _, info = env.reset(seed=1)
    assert info["friction"] == 0.7


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fricton": 0.5}, "there is no 'fricton'; there are: friction"),
        ({"friction": -1.0}, "friction must be"),
        ({"friction": (0.9, 0.5)}, "upside down"),
        ({"friction": "slippery"}, "friction must be"),
        ({"yaw": np.nan}, "yaw must be"),
    ],
)
def test_bad_reset_options_are_refused(options, message):
    env = OrganismEnv(modules=2)
    with pytest.raises(ValueError, match=message):
        env.reset(options=options)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"modules": 0}, sg.OrganismError, "modules must be 1 to 50"),
        ({"modules": -2}, sg.OrganismError, "got -2"),
        ({"modules": "eight"}, sg.OrganismError, "eight"),
        ({"arena": "moon"}, sg.ArenaError, "moon"),
        ({"arena": 3}, sg.ArenaError, "arena must be"),
        ({"pit": -0.1}, ValueError, "pit must be at least 0"),
        ({"randomize": {"friction": (0.9, 0.5)}}, ValueError, "upside down"),
        ({"sensors": ()}, ValueError, "sensors is empty"),
        ({"friction": -1}, ValueError, "friction must be a number from 0.001 to 5"),
        ({"track_speed": np.nan}, ValueError, "track_speed"),
        ({"hinge_torque": 0}, ValueError, "hinge_torque must be a number from 0.001 to 100"),
        ({"frame_skip": 0}, ValueError, "frame_skip"),
        ({"timestep": 0.5}, ValueError, "timestep must be at most"),
        ({"timestep": 1e-12}, ValueError, "timestep must be at least 0.0001 s"),
        ({"duration": 1e12}, ValueError, "duration must be at most 50000 s"),
        ({"task_parameters": {"duration": 1e12}}, ValueError, "duration must be at most 50000 s"),
        ({"sensors": ("smell",)}, ValueError, "no 'smell'"),
        ({"sensors": "pitch"}, ValueError, "sequence of names"),
        ({"start": "moon"}, ValueError, "no 'moon'"),
        ({"start": (50.0, 0.0)}, sg.ArenaError, "off the surface"),
        ({"color": "red"}, ValueError, "no 'color'"),
        ({"render_mode": "ascii"}, ValueError, "no render mode 'ascii'"),
        ({"randomize": {"wind": 3}}, ValueError, "no 'wind'"),
    ],
)
def test_bad_options_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        OrganismEnv(**options)


EPISODE = """
import hashlib
import numpy as np
from symbrion_gym import OrganismEnv

env = OrganismEnv(modules=4, noise=1.0, start="pit")
rng = np.random.default_rng(0)
digest = hashlib.sha256(env.reset(seed=7, options={"yaw": (-0.1, 0.1)})[0].tobytes())
for _ in range(100):
    observation, reward, *_ = env.step(rng.uniform(-1, 1, 3))
    digest.update(observation.tobytes() + np.float64(reward).tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_equal_seeds_give_equal_bytes_in_another_process(capsys):
    exec(EPISODE, {})
    again = subprocess.run([sys.executable, "-c", EPISODE], capture_output=True, text=True, check=True)
    assert again.stdout == capsys.readouterr().out


def test_an_environment_is_not_copied():
    with pytest.raises(TypeError, match="make another one"):
        copy.deepcopy(OrganismEnv(modules=2))


def test_spec_goes_through_json_and_pickle():
    env = gym.make("symbrion_gym/SnakePit-v1", modules=3, friction=0.6)
    for spec in (EnvSpec.from_json(env.spec.to_json()), pickle.loads(pickle.dumps(env.spec))):
        again = gym.make(spec)
        assert again.unwrapped.config.friction == 0.6
        assert again.unwrapped.world.num_modules == 3


def test_render_fps_follows_the_tick():
    assert OrganismEnv(modules=2, frame_skip=2).metadata["render_fps"] == 100
    assert gym.make("symbrion_gym/SnakePit-v1", modules=2).unwrapped.metadata["render_fps"] == 50


def test_info_holds_its_numbers_and_flags_in_their_order():
    env = OrganismEnv(modules=2)
    _, first = env.reset(seed=0)
    *_, info = env.step(np.zeros(1))
    assert tuple(info) == (*NUMBERS, *FLAGS, "reason")
    assert tuple(first)[: len(info)] == tuple(info)


def test_timers_are_in_info_where_asked_for():
    env = OrganismEnv(modules=2, timers=True)
    env.reset(seed=0)
    info = env.step(np.zeros(1))[4]
    assert info["physics_us"] > info["collision_us"] > 0.0
    assert info["raycast_us"] > 0.0


def test_terrain_finds_its_way_between_two_places():
    env = OrganismEnv(modules=3, arena="truth", start=(-2.0, 0.0), goal=(1.9, 0.2), track_speed=0.2)
    _, info = env.reset(seed=0)
    start = info["x_position"]
    for _ in range(100):
        *_, info = env.step(np.zeros(2))
    assert info["x_position"] - start == pytest.approx(0.4, abs=0.05)
    assert env.world.route.heading == pytest.approx(np.arctan2(0.2, 3.9))
