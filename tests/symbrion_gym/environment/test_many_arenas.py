"""Different arenas in one vector environment: each as if it were alone, to the bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import symbrion_gym as sg
from symbrion_gym._src.environment import organism_vector_env
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.tasks.recorders import Extremes

ARENAS = ["truth", "gsrm", sg.Arena.from_course(sg.Course(pit=0.3), "narrow")]
OPTIONS = {"modules": 3, "start": "pit", "duration": 0.16, "noise": 1.0, "recorders": (Extremes(),)}
ROWS = [slice(0, None, 3), slice(1, None, 3), slice(2, None, 3)]


def assert_equal(whole, part, rows):
    """Compare what many arenas return with what one of them returns for its rows."""
    for key in part if isinstance(part, dict) else range(len(part)):
        if isinstance(part[key], dict):
            assert_equal(whole[key], part[key], rows)
        else:
            assert whole[key].dtype == part[key].dtype
            np.testing.assert_equal(list(whole[key][rows]), list(part[key]))


@pytest.mark.slow
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_each_arena_is_as_if_it_were_alone(mode):
    options, rng, finals = {**OPTIONS, "autoreset_mode": mode}, np.random.default_rng(0), []
    many = make_vector_env(5, arenas=ARENAS, **options)
    alone = [make_vector_env(2 - i // 2, arena=arena, **options) for i, arena in enumerate(ARENAS)]

    def do(call):
        whole = call(many, slice(None))
        for envs, rows in zip(alone, ROWS, strict=True):
            assert_equal(whole, call(envs, rows), rows)
        return whole[-1]

    seeds, friction = [*range(5)], {"friction": np.linspace(0.5, 0.9, 5), "yaw": (-0.1, 0.1)}
    do(lambda envs, i: envs.reset(seed=seeds[i], options={**friction, "friction": friction["friction"][i]}))
    again, mask = [9, None, None, None, None], np.arange(5) % 3 == 0
    for tick in range(20):
        if tick == 5:  # so that episodes in the first arena end later than those in the others
            do(lambda envs, i: envs.reset(seed=again[i], options={"reset_mask": mask[i]}))
        actions = rng.uniform(-1, 1, (5, 2))
        finals.append(do(lambda envs, i: envs.step(actions[i])).get("_final_obs", mask).tolist())  # noqa: B023
    assert mode is not AutoresetMode.SAME_STEP or (~mask).tolist() in finals
    for i, records in enumerate(many.call("read_records")):
        np.testing.assert_equal([records, many.read_records(i)], [alone[i % 3].read_records(i // 3)] * 2)
        assert many.get_attr("domain")[i] == alone[i % 3].get_attr("domain")[i // 3]
    np.testing.assert_array_equal(many.reset(seed=4)[0], many.reset(seed=range(4, 9))[0])
    many.close()
    assert all(part.closed for part in many.parts)


def test_an_id_with_an_arena_of_its_own_takes_several_and_finds_a_way_in_each():
    options = {"arenas": ["gsrm", "truth"], "modules": 2, "render_mode": "rgb_array", "width": 32}
    envs = gym.make_vec("symbrion_gym/Traverse-v0", 2, "vector_entry_point", **options)
    with pytest.raises(ValueError, match=r"make_vec\(id, vectorization_mode='vector_entry_point'\)"):
        gym.make("symbrion_gym/Traverse-v0", **options)
    assert envs.spec.reward_threshold is None
    assert len({part.world.route.finish for part in envs.parts}) == 2
    envs.reset(seed=0)
    assert (envs.render()[0] != envs.render()[1]).any()
    for actions, message in (([[0.0], [0.0]], r"shape \(2, 2\)"), ([[0, 0], [0, np.nan]], "of simulation 1")):
        with pytest.raises(ValueError, match=message):
            envs.step(np.array(actions))
    assert envs.step(np.zeros((2, 2)))[-1]["time"].tolist() == [0.02, 0.02], "nothing was stepped before"


def test_arenas_with_other_spaces_are_refused_by_name(monkeypatch):
    odd, one = map(gym.spaces.Discrete, (2, 3)), gym.spaces.Discrete(1)
    monkeypatch.setattr(organism_vector_env, "make_spaces", lambda _: (next(odd), one))
    with pytest.raises(ValueError, match="'truth' and 'narrow' differ in single_action_space"):
        make_vector_env(2, modules=2, arenas=["truth", ARENAS[2]])
