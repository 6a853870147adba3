"""The audit: agrees on an honest crossing and sees every kind of cheat."""

import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.tasks.audit import audit
from symbrion_gym._src.tasks.audit_checks import AuditLimits, Trajectory
from symbrion_gym._src.tasks.starts import place_tree


@pytest.fixture(scope="module")
def crossing():
    """An honest crossing of a narrow pit by five modules, and its environment."""
    env = OrganismEnv(modules=5, pit=0.2, start="pit")
    env.reset(seed=0)
    rows, times = [env.data.qpos.copy()], [0.0]
    while True:
        *_, terminated, truncated, info = env.step(np.zeros(4))
        rows.append(env.data.qpos.copy())
        times.append(info["time"])
        if terminated or truncated:
            break
    assert info["success"]
    return env, Trajectory(np.array(times), np.array(rows))


def _audit(env, trajectory):
    return audit(trajectory, env.world.task, env.world.scene, env.config.track_speed)


def test_an_honest_crossing_is_honest(crossing):
    assert _audit(*crossing).faults == ()
    assert _audit(*crossing).is_success


def test_it_places_modules_as_the_physics_does(crossing):
    env, trajectory = crossing
    centers, rotations = place_tree(trajectory.qpos[-2:], env.world.scene.organism)
    np.testing.assert_allclose(centers[0], env.physics.position[0], atol=2e-3)
    np.testing.assert_allclose(rotations[0].reshape(-1, 9), env.physics.rotation[0], atol=2e-2)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda q, t: (q[: len(q) // 2], t[: len(t) // 2]), "before the edge"),
        (lambda q, t: (q, t * 0.5), "faster than its tracks"),
        (lambda q, t: (_shift(q, 2, 0.2), t), "on the ground"),
        (lambda q, t: (_shift(q, 2, -0.05), t), "sank"),
        (lambda q, t: (_shift(q, 1, 1.1), t), "at the side"),
        (lambda q, t: (_shift(q, 7, 1.8), t), "beyond its range"),
        (lambda q, t: (_fold(q), t), "came within"),
        (lambda q, t: (_flip(q), t), "rolled over"),
        (lambda q, t: (_jump(q), t), "moves at"),
        (lambda q, t: (np.where(q > 0.3, np.nan, q), t), "not finite"),
    ],
)
def test_every_cheat_is_seen(crossing, change, fault):
    env, trajectory = crossing
    qpos, time = change(trajectory.qpos.copy(), trajectory.time.copy())
    found = _audit(env, Trajectory(time, qpos))
    assert not found.is_success
    assert any(fault in text for text in found.faults), found.faults


def test_limits_can_be_chosen(crossing):
    env, trajectory = crossing
    found = audit(trajectory, env.world.task, env.world.scene, 0.1, AuditLimits(max_speed=0.01))
    assert any("moves at" in text for text in found.faults)


def _shift(qpos, column, by):
    qpos[:, column] += by
    return qpos


def _fold(qpos):
    """Curl the body up so that its fifth module is inside its first."""
    qpos[100:150, 7:] = np.pi / 2
    return qpos


def _flip(qpos):
    qpos[100:150, 3:7] = [0, 1, 0, 0]
    return qpos


def _jump(qpos):
    qpos[150:, 0] += 0.2
    return qpos
