"""Many at once: equal to one at a time, to the bit."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import trimesh
from gymnasium.vector import AutoresetMode
from side_by_side import assert_equal_ticks

from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import cross, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig

RESET = {
    "friction": np.array([0.5, 0.6, 0.7, 0.8]),
    "torque_scale": (0.9, 1.1),
    "start_offset": (-0.05, 0.05),
    "yaw": (-0.1, 0.1),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("threads", "options"),
    [
        (1, {}),
        (2, {"noise": 1.0, "track_control": "modules"}),
        (1, {"modules": snake(3, ScoutConfig(dofs=2)), "track_control": "body"}),
        (2, {"modules": cross(1), "track_control": "skid"}),
    ],
)
def test_vector_and_single_agree_to_the_bit(threads, options):
    options = {"modules": 4, "start": "pit", "pit": 0.3, "stuck_time": 2.0, **options}
    vector = OrganismVectorEnv(4, num_threads=threads, autoreset_mode="Disabled", **options)
    singles = [OrganismEnv(**options) for _ in range(4)]
    observation, _ = vector.reset(seed=3, options=RESET)
    for i, env in enumerate(singles):
        one, _ = env.reset(seed=3 + i, options={**RESET, "friction": RESET["friction"][i]})
        np.testing.assert_array_equal(observation[i], one)
    assert_equal_ticks(vector, singles, 150, np.random.default_rng(0))


def test_what_is_done_stands_still_and_keeps_its_verdict():
    vector = OrganismVectorEnv(3, modules=4, start="pit", autoreset_mode="Disabled", num_threads=1)
    vector.reset(
        seed=0, options={"friction": np.array([0.7, 0.7, 0.7]), "start_offset": np.array([0.0, 0.0, -0.05])}
    )
    vector.batch.state[0, 1 + 1] = 1.2  # the head's y: off the side
    *_, terminated, _, info = vector.step(np.zeros((3, 3)))
    assert terminated.tolist() == [True, False, False]
    state = vector.batch.state[0].copy()
    for _ in range(5):
        _, reward, terminated, _, info = vector.step(np.full((3, 3), 0.3))
        assert not terminated[0]
        assert reward[0] == 0.0
    np.testing.assert_array_equal(vector.batch.bind("qpos")[0], state[1 : 1 + vector.model.nq])
    assert info["fell"].tolist() == [True, False, False]
    assert info["_fell"].tolist() == [False, True, True]
    assert info["time"][0] == pytest.approx(0.02)
    vector.reset(seed=[5, None, None], options={"reset_mask": np.array([True, False, False])})
    *_, info = vector.step(np.zeros((3, 3)))
    assert info["time"].tolist() == pytest.approx([0.02, 0.14, 0.14])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_automatic_resets_agree_with_those_of_gymnasium(mode):
    options = {"modules": 3, "start": "pit", "duration": 0.1, "randomize": {"yaw": (-0.2, 0.2)}}
    ours = OrganismVectorEnv(2, autoreset_mode=mode, **options)
    theirs = gym.vector.SyncVectorEnv([lambda: OrganismEnv(**options)] * 2, autoreset_mode=mode)
    first, _ = ours.reset(seed=1)
    second, _ = theirs.reset(seed=1)
    np.testing.assert_array_equal(first, second)
    for tick in range(14):
        actions = np.full((2, 2), 0.1 * tick)
        one, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(one[:4], other[:4], strict=True):
            np.testing.assert_array_equal(a, b)
        assert ("final_obs" in one[4]) == ("final_obs" in other[4])
        if "final_obs" in one[4]:
            np.testing.assert_array_equal(one[4]["final_obs"][0], other[4]["final_obs"][0])
    theirs.close()


def test_gymnasium_makes_it_by_the_vector_entry_point():
    envs = gym.make_vec(
        "symbrion_gym/SnakePit-v1", num_envs=3, vectorization_mode="vector_entry_point", modules=2
    ).unwrapped
    assert type(envs) is OrganismVectorEnv
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert envs.observation_space.contains(envs.reset(seed=0)[0])
    assert envs.observation_space.contains(envs.step(envs.action_space.sample())[0])
    assert len({domain.friction for domain in envs.get_attr("domain")}) == 3
    assert len({id(rng) for rng in envs.get_attr("np_random")}) == 3
    assert envs.get_attr("action_space")[0] == envs.single_action_space
    assert envs.call("render") == (None,) * 3
    assert envs.call("num_envs") == (3, 3, 3)
    with pytest.raises(AttributeError):
        envs.get_attr("no_such_attribute")


def test_a_diverged_simulation_leaves_the_others_alone():
    envs = OrganismVectorEnv(2, modules=3, autoreset_mode="Disabled")
    envs.reset(seed=0)
    envs.batch.bind("qvel")[0, 0] = np.inf
    for tick in range(4):
        observation, reward, terminated, _, info = envs.step(np.zeros((2, 2)))
        assert terminated.tolist() == [tick == 0, False]
        assert info["diverged"].tolist() == [True, False]
        assert np.isfinite(observation).all()
        assert np.isfinite(reward).all()


def test_timers_are_those_of_one_simulation():
    with pytest.raises(OptionError, match="a vector environment has no timers"):
        OrganismVectorEnv(2, modules=2, timers=True)


def test_many_static_pieces_are_left_out_of_steps_to_the_bit():
    truth = load_arena("truth")
    boxes = [trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((0.2 * i, 5.0, 0.0)) for i in range(300)]
    options = {"modules": 4, "arena": replace(truth, pieces=[*truth.pieces, *boxes])}
    vector = OrganismVectorEnv(2, num_threads=2, autoreset_mode="Disabled", **options)
    one, all_steps = OrganismEnv(**options), OrganismEnv(**{**options, "arena": truth})
    vector.reset(seed=[0, 0])
    for env in (one, all_steps):
        env.reset(seed=0)
    far = one.model.geom(f"arena_piece_{len(truth.pieces) + 299}").id
    one.data.geom_xpos[far] = 9.0
    assert_equal_ticks(vector, [one, all_steps], 40, np.random.default_rng(0))
    np.testing.assert_array_equal(one.data.geom_xpos[far], 9.0)  # no step has put it back


def test_bad_arguments_are_refused():
    for arguments, message in (
        ({"num_envs": 0}, "num_envs must be"),
        ({"num_thread": 2}, "there are: num_threads, "),
        ({"num_threads": -1}, "num_threads must be"),
        ({"num_threads": "x"}, "num_threads must be a whole number above 0, got 'x'"),
        ({"render_mode": "human"}, "no render mode"),
    ):
        with pytest.raises(ValueError, match=message):
            OrganismVectorEnv(**arguments)


def test_bad_resets_and_actions_are_refused():
    envs = OrganismVectorEnv(2, modules=3)
    for arguments, message in (
        ({"seed": [1]}, "1 seeds for 2"),
        ({"options": {"friction": [0.1, 0.2, 0.3]}}, "3 values for 2"),
        ({"options": {"reset_mask": [True]}}, "one value for each of 2"),
    ):
        with pytest.raises(ValueError, match=message):
            envs.reset(**arguments)
    envs.reset(seed=0)
    for shape in ((2,), (2, 3), (1, 2)):
        with pytest.raises(ValueError, match=r"shape \(2, 2\)"):
            envs.step(np.zeros(shape))
