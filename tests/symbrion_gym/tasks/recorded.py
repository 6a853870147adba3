"""Episodes that are driven straight ahead and recorded, for the audit."""

import numpy as np

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.tasks.audit import Trajectory, audit


def drive(task, **options):
    """Drive straight ahead; return the environment, the last `info` and the trajectory."""
    env = OrganismEnv(task=task, track_control="body", **options)
    env.reset(seed=0)
    moves = [*range(7), *env.world.hinge_qpos]
    action = np.append(np.zeros(env.world.num_hinges), 1.0)
    rows, times = [env.data.qpos[moves].copy()], [0.0]
    while True:
        *_, terminated, truncated, info = env.step(action)
        rows.append(env.data.qpos[moves].copy())
        times.append(info["time"])
        if terminated or truncated:
            return env, info, Trajectory(np.array(times), np.array(rows))


def check(env, trajectory):
    """Return what the audit finds."""
    return audit(trajectory, env.world.task, env.world.scene, env.config.track_speed)
