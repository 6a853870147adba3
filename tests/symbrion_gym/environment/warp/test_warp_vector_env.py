"""On Warp's CPU device: the same episodes as on the C engine, within single precision; equal seeds give equal bits."""

import numpy as np
import pytest
from device_beside_host import RANDOM as LEVEL
from gymnasium.vector import AutoresetMode

from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.errors import OptionError

pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
pytestmark = pytest.mark.long

NUM = 4
RANDOM = {"torque_scale": (0.9, 1.1), "start_offset": (-0.05, 0.05), **LEVEL}


def make(backend, **options):
    more = {"device": "cpu"} if backend == "warp" else {"num_threads": 1}
    usual = {"modules": 4, "start": "pit", "pit": 0.3, "randomize": RANDOM}
    return make_vector_env(NUM, backend=backend, **more, **(usual | options))


@pytest.fixture(scope="module")
def warp_envs():
    """Environments that several tests reset, as each compiled model takes its time."""
    envs = make("warp")
    yield envs
    envs.close()


def step_both(one, two, ticks, seed=0):
    """Yield what both return for the same random actions."""
    rng = np.random.default_rng(seed)
    for tick in range(ticks):
        if tick % 25 == 0:
            actions = rng.uniform(-0.7, 1.0, one.action_space.shape)
        yield one.step(actions), two.step(actions)


def test_episodes_begin_as_on_the_c_engine_and_follow_it(warp_envs):
    reference = make("mujoco")
    (first, info), (second, other) = (envs.reset(seed=3) for envs in (reference, warp_envs))
    np.testing.assert_array_equal(first, second)
    assert info.keys() == other.keys()
    for name in info:
        np.testing.assert_array_equal(info[name], other[name])
    space = reference.single_observation_space
    limit = np.full(space.shape, 1e-4)
    for name in ("acceleration", "contact"):  # they change by much where a contact changes by little
        limit[reference.observation_structure[name]] = 0.1
    for one, two in step_both(reference, warp_envs, 50):
        assert (np.abs(one[0] - two[0]) / (space.high - space.low) < limit).all()
        np.testing.assert_allclose(one[1], two[1], atol=1e-4)
        np.testing.assert_array_equal(one[2:4], two[2:4])
    qpos = [envs.batch.bind("qpos") for envs in (reference, warp_envs)]
    np.testing.assert_allclose(*qpos, atol=1e-4)


def test_rays_are_cast_once_in_a_control_step(warp_envs, monkeypatch):
    from mujoco_warp._src import ray

    cast, calls = ray.rays, []
    monkeypatch.setattr(ray, "rays", lambda *given: calls.append(1) or cast(*given))
    warp_envs.reset(seed=0)
    for _ in range(3):
        warp_envs.step(np.zeros(warp_envs.action_space.shape))
    assert warp_envs.config.frame_skip == 4
    assert len(calls) == 3


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_automatic_resets_follow_the_same_rules(mode):
    one, two = (
        make(backend, autoreset_mode=mode, max_episode_steps=7, start=None) for backend in ("mujoco", "warp")
    )
    for envs in (one, two):
        envs.reset(seed=5)
    truncations = 0
    for first, second in step_both(one, two, 20):
        np.testing.assert_array_equal(first[2:4], second[2:4])
        np.testing.assert_allclose(first[1], second[1], atol=1e-4)
        assert first[4].keys() == second[4].keys()
        np.testing.assert_array_equal(first[4]["time"], second[4]["time"])
        truncations += int(second[3].sum())
    assert truncations == NUM * (1 if mode is AutoresetMode.DISABLED else 2)
    assert one.get_attr("domain") == two.get_attr("domain")


def test_what_is_done_stands_still_until_it_is_reset():
    envs = make("warp", autoreset_mode="Disabled", max_episode_steps=3)
    envs.reset(seed=0)
    actions = np.zeros(envs.action_space.shape)
    for _ in range(3):
        *_, truncated, _ = envs.step(actions)
    assert truncated.all()
    state = envs.batch.bind("qpos").copy()
    mask = np.arange(NUM) == 1
    envs.reset(seed=[None, 7, None, None], options={"reset_mask": mask})
    begun = envs.batch.bind("qpos")[1].copy()
    _, reward, *_, info = envs.step(actions)
    np.testing.assert_array_equal(envs.batch.bind("qpos")[~mask], state[~mask])
    assert (envs.batch.bind("qpos")[1] != begun).any()
    assert (reward[~mask] == 0.0).all()
    assert info["time"] == pytest.approx([0.06, 0.02, 0.06, 0.06])


def test_equal_seeds_give_equal_bits(warp_envs):
    runs = []
    for _ in range(2):
        warp_envs.reset(seed=11)
        rng = np.random.default_rng(1)
        steps = [warp_envs.step(rng.uniform(-1, 1, warp_envs.action_space.shape)) for _ in range(30)]
        runs.append(np.array([[*step[0].ravel(), *step[1]] for step in steps]))
    np.testing.assert_array_equal(*runs)


def test_friction_and_strength_of_every_world_are_its_own(warp_envs):
    wanted = {"friction": np.array([0.2, 0.9, 0.9, 0.2]), "torque_scale": np.array([1.0, 1.0, 0.01, 1.0])}
    both = make("mujoco"), warp_envs
    for envs in both:
        envs.reset(seed=1, options={**wanted, "yaw": 0.0, "start_offset": 0.0, "track_speed": 0.1})
    for _ in range(25):
        for envs in both:
            envs.step(np.full(envs.action_space.shape, 0.5))
    first, second = (envs.batch.bind("qpos") for envs in both)
    np.testing.assert_allclose(first, second, atol=1e-4)
    assert min(np.abs(second[i] - second[k]).max() for i, k in ((0, 1), (0, 2), (1, 2))) > 1e-3
    np.testing.assert_array_equal(second[0], second[3])


def test_driven_tracks_turn_as_on_the_c_engine():
    one, two = (
        make(backend, modules=1, start=None, pit=0.0, track_control="skid", sensors=("pitch", "roll"))
        for backend in ("mujoco", "warp")
    )
    for envs in (one, two):
        envs.reset(seed=0)
    for _ in range(25):
        for envs in (one, two):
            envs.step(np.tile([-1.0, 1.0], (NUM, 1)))
    first, second = (envs.batch.bind("qpos") for envs in (one, two))
    assert (np.abs(first[:, 6]) > 0.1).all(), "they turn"
    np.testing.assert_allclose(first, second, atol=1e-3)


def test_a_device_that_is_not_there_is_refused_by_name():
    with pytest.raises(OptionError, match=r"no device 'cuda:7' .*there are: cpu"):
        make_vector_env(1, backend="warp", device="cuda:7", modules=1)
    with pytest.raises(OptionError, match="max_contacts must be a whole number above 0, got 0"):
        make_vector_env(1, backend="warp", device="cpu", modules=1, max_contacts=0)


def test_dropped_contacts_are_reported(caplog):
    envs = make("warp", max_contacts=2)
    envs.reset(seed=0)
    for _ in range(5):
        envs.step(np.zeros(envs.action_space.shape))
    assert envs.batch.engine.has_overflowed
    assert "raise max_contacts" in caplog.text
