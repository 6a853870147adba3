"""The audit: agrees on honest successes of every task, and sees every kind of cheat and what is missing."""

import numpy as np
import pytest
import trimesh
from recorded import check, drive

from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.robot.body_plans import make_random_organism
from symbrion_gym._src.robot.organism import letter_h, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.tasks.audit import Trajectory, place_tree

DRIVES = {
    "cross_gap": {"pit": 0.2, "modules": 5, "start": "pit"},
    "climb": {"modules": 2, "obstacle": "ramp", "start": (-1.2, 0.0)},
    "traverse": {"modules": 2, "share": 0.1},
    "reach": {"modules": 1, "start": (-2.5, 0.3), "goal": (-2.1, 0.3)},
}
TOO_SOON = {"reach": "never was"}


@pytest.fixture(scope="module")
def crossing():
    """An honest crossing of a narrow pit by five modules, and its environment."""
    env, info, trajectory = drive("cross_gap", **DRIVES["cross_gap"])
    assert info["success"], info
    return env, trajectory


@pytest.mark.parametrize("task", DRIVES)
def test_the_audit_agrees_with_an_honest_success_and_misses_the_end_of_half_of_it(task):
    env, info, trajectory = drive(task, **DRIVES[task])
    assert info["success"], info
    assert check(env, trajectory).faults == ()
    assert check(env, trajectory).is_success
    half = Trajectory(*(each[: len(each) // 2] for each in trajectory))
    faults = check(env, half).faults
    assert any(TOO_SOON.get(task, "before the edge") in text for text in faults), faults


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda q, t: (q, t * 0.5), "faster than its tracks"),
        (lambda q, t: (_shift(q, 2, 0.2), t), "on the ground"),
        (lambda q, t: (_shift(q, 2, -0.05), t), "sank"),
        (lambda q, t: (_shift(q, 1, 1.1), t), "at the side"),
        (lambda q, t: (_shift(q, 7, 1.8), t), "beyond its range"),
        (lambda q, t: (_change(q, slice(7, None), np.pi / 2), t), "came within"),
        (lambda q, t: (_change(q, slice(3, 7), [0, 1, 0, 0]), t), "rolled over"),
        (lambda q, t: (_change(q, 0, 9.0), t), "moves at"),
        (lambda q, t: (np.where(q > 0.3, np.nan, q), t), "not finite"),
    ],
)
def test_every_cheat_is_seen(crossing, change, fault):
    env, trajectory = crossing
    qpos, time = change(trajectory.qpos.copy(), trajectory.time.copy())
    found = check(env, Trajectory(time, qpos))
    assert not found.is_success
    assert any(fault in text for text in found.faults), found.faults


def _shift(qpos, column, by):
    qpos[:, column] += by
    return qpos


def _change(qpos, columns, to):
    """Change the coordinates for a while; with all hinges at a right angle the fifth module is inside the first."""
    qpos[100:150, columns] = to
    return qpos


def test_a_body_on_its_back_is_seen_at_the_end():
    env, _, (time, qpos) = drive("reach", **DRIVES["reach"])
    qpos[:, 3:7] = 0.0, 1.0, 0.0, 0.0
    assert "a module does not end upright" in check(env, Trajectory(time, qpos)).faults


@pytest.mark.parametrize(
    "organism",
    [letter_h(), snake(3, ScoutConfig(dofs=2)), make_random_organism(7, np.random.default_rng(3))],
    ids=["H", "two joints", "tree"],
)
def test_modules_of_any_tree_are_placed_as_the_physics_does(organism):
    import mujoco

    env = OrganismEnv(modules=organism, start=(-2.5, 0.0), goal=(-1.9, 0.1))
    env.reset(seed=0)
    joints = env.world.hinge_qpos
    env.data.qpos[joints] = np.random.default_rng(0).uniform(-0.7, 0.7, len(joints))
    mujoco.mj_forward(env.model, env.data)
    centers, rotations = place_tree(env.data.qpos[[*range(7), *joints]][None], organism)
    np.testing.assert_allclose(centers[0], env.physics.position[0], atol=1e-12)
    np.testing.assert_allclose(rotations[0].reshape(-1, 9), env.physics.rotation[0], atol=1e-12)


def test_below_a_shelf_an_honest_arrival_counts_and_one_that_sinks_does_not():
    boxes = [((-1, -1, -0.1), (3, 1, 0)), ((1.2, -1, 0.6), (3, 1, 0.7))]
    arena = make_arena(trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in boxes]))
    env, info, (time, qpos) = drive("reach", arena=arena, modules=1, start=(0.8, 0.0), goal=(1.5, 0.0))
    assert info["success"], info
    assert check(env, Trajectory(time, qpos)).is_success
    qpos[:, 2] -= np.interp(np.arange(len(qpos)), [len(qpos) // 2, len(qpos) - 1], [0.0, 0.4])
    assert any("sank" in text for text in check(env, Trajectory(time, qpos)).faults)
