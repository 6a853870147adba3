"""Arenas of several lengths side by side on Warp's CPU device, beside each alone; and what is refused."""

import numpy as np
import pytest

from symbrion_gym._src.environment.models import LayoutError
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.warp.making import make_vector_env

pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
jax = pytest.importorskip("jax")
slow = pytest.mark.slow

STRETCHES = (0.9, 1.1)
OPTIONS = {
    "modules": 2,
    "pit": 0.3,
    "sensors": ("pitch", "odometry", "goal"),
    "randomize": {"yaw": (-0.1, 0.1)},
}


def make(num=5, **options):
    more = {"backend": "warp", "array": "jax", "device": "cpu", "num_threads": 1, "num_starts": 3}
    return make_vector_env(num, **more | OPTIONS | options)


@pytest.fixture(scope="module")
def side_by_side():
    """Environments that several tests reset."""
    return make(stretches=STRETCHES, autoreset_mode="Disabled")


@slow
def test_each_stretch_is_as_if_it_were_alone(side_by_side):
    alone = [
        make(num, stretch=stretch, autoreset_mode="Disabled")
        for num, stretch in zip((3, 2), STRETCHES, strict=True)
    ]
    np.testing.assert_array_equal(side_by_side.stretch, [0.9, 0.9, 0.9, 1.1, 1.1])
    friction = np.linspace(0.5, 0.9, 5)
    found = side_by_side.reset(seed=4, options={"friction": friction})
    parts = [
        envs.reset(seed=seed, options={"friction": friction[rows]})
        for envs, seed, rows in zip(alone, (4, 7), (slice(0, 3), slice(3, 5)), strict=True)
    ]
    _compare(found, parts)
    goals = np.asarray(found[0])[:, side_by_side.observation_structure["goal"]][:, 0]
    assert goals[3:].min() > goals[:3].max() + 0.1, "the finish is farther away"
    rng = np.random.default_rng(0)
    for _ in range(5):
        actions = rng.uniform(-1.0, 1.0, side_by_side.action_space.shape)
        found = side_by_side.step(actions)
        _compare(found, [alone[0].step(actions[:3]), alone[1].step(actions[3:])])
    assert isinstance(found[0], jax.Array)
    assert np.asarray(side_by_side.find_running()).all()


def _compare(found, parts):
    """Compare to the bit what all and what the parts returned."""
    for whole, *pieces in zip(found, *parts, strict=True):
        if not isinstance(whole, dict):
            np.testing.assert_array_equal(whole, np.concatenate(pieces))
            continue
        assert whole.keys() == pieces[0].keys()
        for name, value in whole.items():
            np.testing.assert_array_equal(value, np.concatenate([each[name] for each in pieces]))


@slow
def test_some_are_reset_whatever_their_stretch(side_by_side):
    side_by_side.reset(seed=4)
    actions = np.zeros(side_by_side.action_space.shape)
    before = np.asarray(side_by_side.step(actions)[0])
    mask = np.array([True, False, False, False, False])
    observation, info = side_by_side.reset(seed=[9, *[None] * 4], options={"reset_mask": mask, "yaw": 0.05})
    np.testing.assert_array_equal(np.asarray(observation)[~mask], before[~mask])
    np.testing.assert_array_equal(info["_yaw"], mask)
    np.testing.assert_allclose(info["yaw"], np.where(mask, 0.05, 0.0), atol=1e-6)
    np.testing.assert_allclose(side_by_side.step(actions)[4]["time"], np.where(mask, 0.02, 0.04), atol=1e-6)


@slow
def test_automatic_resets_keep_the_stretch():
    torch = pytest.importorskip("torch", reason="needs torch")
    envs = make(4, stretches=STRETCHES, autoreset_mode="SameStep", max_episode_steps=2, array="torch")
    begun, _ = envs.reset(seed=0)
    for _ in range(4):
        observation, *_, info = envs.step(torch.zeros(envs.action_space.shape))
    assert isinstance(observation, torch.Tensor)
    assert isinstance(info["final_info"]["time"], torch.Tensor)
    goal = envs.observation_structure["goal"].start
    np.testing.assert_allclose(observation[:, goal], begun[:, goal], atol=0.01)


@slow
def test_resets_that_cannot_be_are_refused(side_by_side):
    for options, message in (
        ({"stretch": 0.9}, "each simulation keeps its stretch"),
        ({"reset_mask": [True]}, "reset_mask has shape"),
        ({"friction": [0.5, 0.6]}, "friction has 2 values for 5"),
    ):
        with pytest.raises(OptionError, match=message):
            side_by_side.reset(options=options)
    with pytest.raises(OptionError, match="2 seeds for 5"):
        side_by_side.reset(seed=[1, 2])
    with pytest.raises(OptionError, match="actions have shape"):
        side_by_side.step(np.zeros((1, 1)))
    with pytest.raises(OptionError, match="the first reset is one of all"):
        make(2, stretches=STRETCHES).reset(options={"reset_mask": [True, False]})


@pytest.mark.parametrize(
    ("num", "stretches", "message"),
    [(4, (0.9, 1.0, 0.9), "has one twice"), (1, STRETCHES, "2 stretches for 1 simulations")],
)
def test_stretches_that_cannot_be_shared_out_are_refused(num, stretches, message):
    with pytest.raises(OptionError, match=message):
        make(num, stretches=stretches)


def test_on_the_host_there_is_one_arena_and_the_way_out_is_named():
    with pytest.raises(LayoutError, match="array='jax' or 'torch' holds all of them, side by side"):
        make_vector_env(2, backend="warp", modules=2, stretches=STRETCHES)


@slow
def test_one_stretch_is_an_option_like_any_other():
    assert make(2, stretches=(0.9,)).config.stretch == 0.9
