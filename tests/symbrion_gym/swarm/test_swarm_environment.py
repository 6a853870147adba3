"""The PettingZoo environment of a swarm: its own tests, refusals, equal seeds, what success is."""

import warnings
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from symbrion_gym import swarm_v0
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm.environment import LEVELS, SwarmEnv
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.placing import find_field, scatter

pytest.importorskip("pettingzoo", reason="the extra `swarm` is not installed")


@pytest.fixture(scope="module")
def env() -> SwarmEnv:
    return swarm_v0.parallel_env(arena="truth", num_robots=3, duration=2.0)


@pytest.mark.parametrize("fidelity", LEVELS)
def test_passes_the_tests_of_pettingzoo(fidelity: str) -> None:
    from pettingzoo.test import parallel_api_test
    from pettingzoo.test.seed_test import parallel_seed_test

    def make(**options: Any) -> SwarmEnv:
        return swarm_v0.parallel_env(arena="truth", num_robots=2, fidelity=fidelity, **options)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(make(duration=1.0), num_cycles=20)
        parallel_seed_test(make, num_cycles=15)


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", LEVELS)
def test_robots_dock_drive_and_part_at_every_fidelity(fidelity: str) -> None:
    env = swarm_v0.parallel_env(arena="truth", num_robots=3, fidelity=fidelity)
    assert type(env.world) is LEVELS[fidelity]
    env.reset(seed=0)
    pitch = env.world.scout.pitch
    env.world.reset(np.array([[-2.2, 0.0, 0.0], [-2.206 - pitch, 0.0, 0.0], [-2.8, 0.5, 0.0]]))
    front, back = np.full(15, -1.0), np.full(15, -1.0)
    front[:3] = back[:3] = [0.2, 0.2, 0.0]
    front[3], back[4] = 1.0, 1.0
    for _ in range(30):
        observations, *_, info = env.step({"robot_0": back, "robot_1": front})
    assert [info[agent]["organism"] for agent in env.agents] == [0, 0, 2]
    assert observations["robot_1"][13] == observations["robot_0"][14] == 1.0
    way = env.world.state.position[:, 0] - [-2.2, -2.206 - pitch, -2.8]
    np.testing.assert_allclose(way, [0.06, 0.06, 0.0], atol=0.012)
    *_, info = env.step({})
    assert [info[agent]["organism"] for agent in env.agents] == [0, 1, 2]


def test_images_show_the_robots_where_they_are() -> None:
    env = swarm_v0.parallel_env(arena="truth", num_robots=2, render_mode="rgb_array")
    with pytest.raises(OptionError, match="call reset"):
        env.render()
    env.reset(seed=0)
    first = env.render()
    assert first is not None
    assert first.shape == (400, 640, 3)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first, env.render())
    env.world.reset(np.array([[-2.0, 0.0, 0.0], [-2.0, 0.4, 0.0]]))
    assert (env.render() != first).any(axis=-1).sum() > 500
    env.close()
    env.close()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_robots": 0}, "num_robots must be a whole number from 1"),
        ({"num_robots": 2.5}, "num_robots must be a whole number"),
        ({"duration": -1.0}, "duration"),
        ({"noise": "much"}, "noise must be a number"),
        ({"robots": 3}, "there is no 'robots'; there are: num_robots, arena"),
        ({"render_mode": "human"}, "no render mode 'human'; there is 'rgb_array'"),
        ({"task": "dance"}, "task: there is no 'dance'; there are: cross, assemble"),
        ({"fidelity": "exact"}, "fidelity: there is no 'exact'; there are: kinematic, dynamic"),
    ],
)
def test_bad_options_are_refused_in_one_line(options: dict, message: str) -> None:
    with pytest.raises(OptionError, match=message) as error:
        swarm_v0.parallel_env(**{"arena": "truth", **options})
    assert "\n" not in str(error.value)


def test_arenas_without_a_pit_or_room_are_refused() -> None:
    with pytest.raises(ArenaError, match="has no pit"):
        swarm_v0.parallel_env(arena="stairs")
    with pytest.raises(ArenaError, match="there is room for"):
        swarm_v0.parallel_env(arena="truth", num_robots=200).reset(seed=0)


def test_robots_are_scattered_where_they_can_stand() -> None:
    """Not astride a wall that is thinner than they are, nor beside it."""
    wall = trimesh.creation.box((0.02, 6.0, 0.3))
    floor = trimesh.creation.box((6.0, 6.0, 0.1))
    floor.apply_translation((0.0, 0.0, -0.05))
    walls = [wall.copy().apply_translation((x, 0.0, 0.15)) for x in np.arange(-2.8, 2.9, 0.7)]
    arena = sg.make_arena(trimesh.util.concatenate([floor, *walls]), name="walls")
    world, rng = KinematicWorld(arena, 6), np.random.default_rng(0)
    field = find_field(sg.load_arena("truth"))._replace(low=-2.5, high=2.5, half_width=2.5)
    poses = scatter(field, 6, world, rng)
    assert world.find_standing(poses).all()
    assert (np.abs((poses[:, 0] + 0.35) % 0.7 - 0.35) > 0.05).all()
    assert not world.find_standing(np.array([(0.0, 0.0, 0.0)])).any(), "on the wall"


def test_fifty_robots_find_room() -> None:
    env = swarm_v0.parallel_env(arena="gsrm", num_robots=50)
    env.reset(seed=0)
    away = np.linalg.norm(np.diff(env.world.state.position[list(combinations(range(50), 2))], axis=1), axis=2)
    assert away.min() > 0.2


@pytest.mark.parametrize("fidelity", LEVELS)
def test_docking_is_studied_alone_from_poses_on_any_arena(fidelity: str) -> None:
    env = swarm_v0.parallel_env(arena="stairs", num_robots=2, task="assemble", fidelity=fidelity)
    x, y = (float(each) for each in env.field.route.place(env.field.low + 0.3, 0.0))
    env.reset(seed=0, options={"poses": [(x, y, 0.0), (x - env.world.scout.pitch, y, 0.0)]})
    latched = np.concatenate([np.zeros(3), np.ones(4), -np.ones(8)])
    _, rewards, terminated, _, info = env.step(dict.fromkeys(env.agents, latched))
    assert rewards == {"robot_0": 1.5, "robot_1": 1.5}  # half a body more, and the bonus
    assert terminated == {"robot_0": True, "robot_1": True}
    assert info["robot_1"]["organism"] == 0
    for poses in ([(x, y, 0.0)], [(x, y, 0.0), (x, np.nan, 0.0)], "here"):
        with pytest.raises(OptionError, match=r"poses must be \[2, 3\] finite numbers"):
            env.reset(options={"poses": poses})


def test_actions_are_checked_and_an_agent_without_one_stands_still(env: SwarmEnv) -> None:
    env.reset(seed=1)
    for agent, action, message in (
        ("robot_0", np.full(15, np.nan), "15 finite numbers"),
        ("robot_0", np.zeros(3), "15 finite numbers"),
        ("robot_9", np.zeros(15), "no agent 'robot_9'"),
    ):
        with pytest.raises(OptionError, match=message):
            env.step({agent: action})
    before = env.world.state.position
    env.step({"robot_1": np.r_[1.0, 1.0, np.zeros(13)]})
    moved = np.linalg.norm(env.world.state.position - before, axis=1)
    assert moved[1] == pytest.approx(0.01, rel=0.2)
    np.testing.assert_allclose(moved[[0, 2]], 0.0, atol=1e-6)


def test_an_episode_ends_after_its_duration(env: SwarmEnv) -> None:
    env.reset(seed=0)
    for count in range(20):
        *_, truncated, _ = env.step({})
        assert all(truncated.values()) == (count == 19)
    assert env.agents == []
    with pytest.raises(OptionError, match="call reset"):
        env.step({})


def test_success_is_all_beyond_the_pit_upright_and_undocked(env: SwarmEnv) -> None:
    env.reset(seed=0)
    world = env.world
    far = np.array([[0.6, y, 0.0] for y in (-0.4, 0.0, 0.4)])
    world.reset(far)
    _, reward, terminated, _, info = env.step({})
    assert all(terminated.values())
    assert info["robot_0"]["success"]
    assert min(reward.values()) >= env.options.success_bonus
    for poses, across in (((-0.6, 0.0, 0.0), False), ((0.285, 0.0, 0.0), False), ((0.45, 0.0, 0.0), True)):
        env.reset(seed=0)
        world.reset(np.vstack([far[[0, 2]], poses]))
        *_, info = env.step({})
        assert info["robot_2"]["across"] is across
    env.reset(seed=0)
    world.reset(np.array([[0.6, 0.0, 0.0], [0.6 - world.scout.pitch, 0.0, 0.0], [0.6, 0.5, 0.0]]))
    world.state = world.state._replace(links=(Docking(0, "back", 1, "front"),))
    hold = np.zeros(15)
    hold[3:7] = 1.0
    *_, info = env.step({"robot_0": hold, "robot_1": hold})
    assert [info[f"robot_{i}"]["across"] for i in range(3)] == [False, False, True]


def test_the_extra_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    import reconstruction._src.base.extras

    monkeypatch.setattr(reconstruction._src.base.extras, "find_spec", lambda _: None)
    with pytest.raises(
        reconstruction._src.base.extras.MissingExtraError, match=r"pip install 'symbrion-gym\[swarm\]'"
    ):
        swarm_v0.parallel_env()
