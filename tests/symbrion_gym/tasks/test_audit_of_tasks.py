"""The audit of each task: agrees on honest successes, and sees what is missing."""

import numpy as np
import pytest
from recorded import check, drive

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.robot.body_plans import make_random_organism
from symbrion_gym._src.robot.organism import cross, letter_h, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.tasks.audit_checks import Trajectory
from symbrion_gym._src.tasks.starts import place_tree

DRIVES = {
    "cross_gap": {"arena": "truth", "pit": 0.2, "modules": 5, "start": "pit"},
    "climb": {"arena": "truth", "modules": 2, "obstacle": "ramp", "start": (-1.2, 0.0)},
    "traverse": {"arena": "truth", "modules": 2, "share": 0.1},
    "reach": {"arena": "truth", "modules": 1, "start": (-2.5, 0.3), "goal": (-2.1, 0.3)},
    "explore": {"arena": "truth", "modules": 1, "start": (-3.0, 0.0), "share": 0.2},
    "recover": {"arena": "truth", "modules": 2, "least": 0.0, "most": 1.0},
}


@pytest.mark.parametrize("task", DRIVES)
def test_the_audit_agrees_with_an_honest_success(task):
    env, info, trajectory = drive(task, **DRIVES[task])
    assert info["success"], info
    assert check(env, trajectory).faults == ()


@pytest.mark.parametrize(
    ("task", "fault"),
    [
        ("cross_gap", "before the edge"),
        ("climb", "before the edge"),
        ("traverse", "before the edge"),
        ("reach", "never was"),
        ("explore", "of the ground was seen"),
    ],
)
def test_an_episode_that_ends_too_soon_is_no_success(task, fault):
    env, _, (time, qpos) = drive(task, **DRIVES[task])
    half = len(time) // 2
    found = check(env, Trajectory(time[:half], qpos[:half]))
    assert not found.is_success
    assert any(fault in text for text in found.faults), found.faults


def test_a_jump_and_a_body_on_its_back_are_seen():
    env, _, (time, qpos) = drive("reach", **DRIVES["reach"])
    flown = qpos.copy()
    flown[-40:, 0] += 1.0
    assert any("moves at" in text for text in check(env, Trajectory(time, flown)).faults)
    assert any("faster" in text for text in check(env, Trajectory(0.2 * time, qpos)).faults)
    over = qpos.copy()
    over[:, 3:7] = 0.0, 1.0, 0.0, 0.0
    faults = check(env, Trajectory(time, over)).faults
    assert "a module rolled over" in faults
    assert "a module does not end upright" in faults


@pytest.mark.parametrize(
    "organism",
    [
        snake(5),
        cross(2),
        letter_h(),
        snake(3, ScoutConfig(dofs=2)),
        make_random_organism(7, np.random.default_rng(3)),
    ],
    ids=["snake", "cross", "H", "two joints", "tree"],
)
def test_modules_are_placed_as_the_physics_does(organism):
    import mujoco

    env = OrganismEnv(modules=organism, start=(-2.5, 0.0), goal=(-1.9, 0.1))
    env.reset(seed=0)
    joints = env.world.hinge_qpos
    env.data.qpos[joints] = np.random.default_rng(0).uniform(-0.7, 0.7, len(joints))
    mujoco.mj_forward(env.model, env.data)
    centers, rotations = place_tree(env.data.qpos[[*range(7), *joints]][None], organism)
    np.testing.assert_allclose(centers[0], env.physics.position[0], atol=1e-12)
    np.testing.assert_allclose(rotations[0].reshape(-1, 9), env.physics.rotation[0], atol=1e-12)
