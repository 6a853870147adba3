"""Whole environments on Warp's CPU device: what they take and return, resets, and what they refuse."""

from functools import partial

import numpy as np
import pytest
from device_beside_host import RANDOM as LEVEL

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.tasks.terms import Termination

pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
jax = pytest.importorskip("jax")
long = pytest.mark.long

NUM = 4
RANDOM = {"torque_scale": (0.9, 1.1), **LEVEL}


def make(backend="warp", **options):
    more = {"device": "cpu", "array": "jax", "num_starts": NUM} if backend == "warp" else {}
    usual = {"modules": 3, "start": "pit", "pit": 0.3, "randomize": RANDOM, "num_threads": 1}
    return make_vector_env(NUM, backend=backend, **more | usual | options)


def compare_steps(one, two, ticks, low=-0.7):
    """Step both with the same random actions; return what they returned last."""
    rng = np.random.default_rng(0)
    span = one.single_observation_space.high - one.single_observation_space.low
    for tick in range(ticks):
        if tick % 25 == 0:
            actions = rng.uniform(low, 1.0, one.action_space.shape)
        first, second = one.step(actions), two.step(actions)
        assert (np.abs(first[0] - np.asarray(second[0])) / span).max() < 1e-3
        np.testing.assert_allclose(first[1], second[1], atol=1e-4)
        for i in (2, 3):
            np.testing.assert_array_equal(first[i], second[i])
    return first, second


@long
def test_episodes_follow_the_c_engine():
    one, two = make("mujoco", autoreset_mode="Disabled"), make(autoreset_mode="Disabled")
    first, second = (envs.reset(seed=3) for envs in (one, two))
    np.testing.assert_allclose(first[0], second[0], atol=1e-5)
    assert first[1].keys() == second[1].keys()
    for name in first[1]:
        is_text = np.asarray(first[1][name]).dtype.kind == "U"
        compare = np.testing.assert_array_equal if is_text else partial(np.testing.assert_allclose, atol=1e-5)
        compare(first[1][name], second[1][name])
    last, found = compare_steps(one, two, 40)
    assert last[4].keys() == found[4].keys()
    assert isinstance(found[0], jax.Array)
    assert isinstance(found[4]["progress"], jax.Array)


@long
@pytest.mark.parametrize(
    ("mode", "times"),
    [
        ("NextStep", [1, 2, 3, 4, 5, None, 1, 2]),
        ("SameStep", [1, 2, 3, 4, 0, 1, 2, 3]),
        ("Disabled", [1, 2, 3, 4, *[5] * 4]),
    ],
)
def test_automatic_resets_follow_the_same_rules(mode, times):
    envs = make(autoreset_mode=mode, max_episode_steps=5)
    begun = np.asarray(envs.reset(seed=5)[0])
    actions = np.zeros(envs.action_space.shape, dtype=np.float32)
    for tick, time in enumerate(times):
        observation, reward, terminated, truncated, info = envs.step(actions)
        assert not np.asarray(terminated).any()
        assert np.asarray(truncated).all() == np.asarray(truncated).any() == (tick == 4)
        if time is None:  # it has begun anew
            assert (np.asarray(reward) == 0.0).all()
            assert _all_begin(observation, begun)
        else:
            np.testing.assert_allclose(info["time"], time * envs.config.dt, atol=1e-6)
            ended = tick >= 4 and mode != "SameStep"
            assert set(np.asarray(info["reason"])) == {"timeout" if ended and time > 4 else ""}
        if "final_obs" in info and tick == 4:
            assert info["final_info"]["reason"][0] == "timeout"
            assert np.asarray(info["_final_obs"]).all()
            assert _all_begin(observation, begun)
            assert not _all_begin(info["final_obs"], begun)


def _all_begin(observation, begun):
    """Return whether every observation is one of those at the starts."""
    found = np.asarray(observation)
    return all(np.abs(begun - row).max(axis=1).min() < 1e-6 for row in found)


@long
def test_starts_differ_in_the_physics_after_an_automatic_reset():
    envs = make(autoreset_mode="SameStep", max_episode_steps=3, randomize={"yaw": (-0.3, 0.3)})
    envs.reset(seed=1)
    first = np.asarray(envs.batch.view()["qpos"]).copy()
    for _ in range(3):
        envs.step(np.zeros(envs.action_space.shape, dtype=np.float32))
    second = np.asarray(envs.batch.view()["qpos"]).copy()
    assert all(np.abs(first - row).max(axis=1).min() == 0.0 for row in second), "they are at starts again"
    assert (np.asarray(envs.batch.view()["qvel"]) == 0.0).all()


@long
def test_only_some_are_reset_and_equal_seeds_give_equal_bits():
    envs = make(autoreset_mode="Disabled", max_episode_steps=3)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (3, *envs.action_space.shape))
    runs = []
    for _ in range(2):
        envs.reset(seed=7)
        runs.append([np.asarray(envs.step(each)[0]) for each in actions])
    np.testing.assert_array_equal(*runs)
    mask = np.arange(NUM) == 2
    observation, info = envs.reset(seed=[None, None, 9, None], options={"reset_mask": mask, "friction": 0.7})
    np.testing.assert_array_equal(np.asarray(observation)[~mask], runs[0][-1][~mask])
    assert np.asarray(info["friction"])[2] == pytest.approx(0.7)
    info = envs.step(actions[0])[4]
    np.testing.assert_allclose(info["time"], np.where(mask, 0.02, 0.06), atol=1e-6)


@long
def test_laser_and_infrared_see_the_exact_surface_as_on_the_c_engine():
    options = {"arena": "gsrm", "pit": None, "start": None, "sensors": ("laser", "ir")}
    one, two = (make(backend, autoreset_mode="Disabled", **options) for backend in ("mujoco", "warp"))
    for envs in (one, two):
        envs.reset(seed=2)
    span = one.single_observation_space.high - one.single_observation_space.low
    actions, worst = np.full(one.action_space.shape, 0.4), []
    for _ in range(12):
        first, second = one.step(actions)[0], np.asarray(two.step(actions)[0])
        worst.append((np.abs(first - second) / span).max())
        assert np.ptp(first[:, one.observation_structure["laser"]]) > 0.5
    assert np.sort(worst)[9] < 1e-5, "in ten ticks of twelve"
    assert max(worst) < 1e-2, "in others C reads a physics step later, as its clock rounds the interval"


@long
def test_torch_tensors_share_the_memory():
    torch = pytest.importorskip("torch", reason="needs torch")
    envs = make(array="torch")
    observation, _ = envs.reset(seed=0)
    assert isinstance(observation, torch.Tensor)
    observation, reward, terminated, *_ = envs.step(torch.zeros(envs.action_space.shape))
    assert observation.shape == envs.observation_space.shape
    assert terminated.dtype == torch.bool
    assert torch.isfinite(reward).all()


@long
def test_reaching_follows_the_c_engine():
    """Bodies drive on their tracks; shares and distances are such that they arrive within the ticks."""
    goal = {"places": ((-2.04, 0.0),), "goal": (-1.98, 0.0), "tolerance": 0.03}
    options = {"arena": "gsrm", "task": "reach", "modules": 1, "start": (-2.1, 0.0), "pit": None, **goal}
    options |= {"track_control": "skid", "sensors": ("pitch", "roll", "goal", "goal_direction")}
    one, two = (make(backend, autoreset_mode="Disabled", **options) for backend in ("mujoco", "warp"))
    for envs in (one, two):
        envs.reset(seed=3)
    before, _ = compare_steps(one, two, 1, 0.7)
    last, found = compare_steps(one, two, 90, 0.7)
    # 1 % of the goal's tolerance: float32 over 90 ticks of contact, whose last digits differ between processors
    np.testing.assert_allclose(last[4]["progress"], found[4]["progress"], atol=3e-4)
    assert (last[4]["progress"] > before[4]["progress"] + 0.02).all(), "they have moved on"
    np.testing.assert_array_equal(last[4]["success"], found[4]["success"])
    assert last[4]["success"].any()
    assert last[4]["time"].min() > 0.8, "not at the start"


def look_at_each(state):
    """Return whether bodies are low: a term of a user that looks at single simulations."""
    return np.array([each < -1.0 for each in state.lowest])


def test_terms_that_need_the_host_are_refused_by_name():
    task = World(EnvironmentConfig(modules=2, pit=0.0)).task
    task = task.replace(name="own", terminations=(Termination("low", look_at_each),))
    with pytest.raises(TaskError, match="task 'own' has a term that does not run on a device"):
        make_vector_env(2, backend="warp", array="jax", device="cpu", modules=2, task=task)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"render_mode": "rgb_array"}, "has no render_mode"),
        ({"num_starts": 0}, "num_starts must be a whole number"),
    ],
)
def test_what_a_device_lacks_is_refused(options, message):
    with pytest.raises(OptionError, match=message):
        make(**options)


@long
def test_some_are_reset_alone_only_where_nothing_resets_by_itself():
    envs = make()
    for options in ({"reset_mask": np.arange(NUM) == 0}, {"friction": [0.5, 0.6, 0.7, 0.8]}):
        with pytest.raises(OptionError, match="need autoreset_mode='Disabled'"):
            envs.reset(options=options)
