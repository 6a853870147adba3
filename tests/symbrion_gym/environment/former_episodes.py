"""Episodes of `SnakePit-v0` as they were before tasks became values; `test_former_episodes.py` compares."""

from collections.abc import Callable
from hashlib import sha256
from typing import Any

import numpy as np

NAMES = (
    *("x_position", "progress", "time", "reward_forward", "reward_success", "reward_effort", "lowest_module"),
    *("least_upright", "success", "diverged", "rolled_over", "fell", "touched_pit", "stuck"),
)
"""Of `info`."""
_RANDOM = {
    "friction": (0.55, 0.85),
    "torque_scale": (0.9, 1.1),
    "start_offset": (-0.05, 0.05),
    "start_lateral": (-0.1, 0.1),
    "yaw": (-0.1, 0.1),
    "track_speed": (0.08, 0.12),
}
OPTIONS: dict[str, dict[str, Any]] = {
    "pit": {"pit": 0.40, "start": "pit"},
    "stretched": {"pit": 0.40, "stretch": 1.04, "start": "pit"},
    "randomized": {"pit": 0.40, "start": "pit", "randomize": _RANDOM},
    "bottomless": {"pit": 0.40, "start": "pit", "bottomless": True, "track_speed": 0.15},
    "noisy": {"pit": 0.35, "noise": 1.0, "start": "pit", "modules": 6},
    "stairs": {"arena": "stairs", "modules": 4},
    "turned": {"arena": "truth", "start": (-2.9, -0.6), "goal": (-2.4, -0.1), "modules": 2},
    "crossing": {"pit": 0.2, "start": "pit", "modules": 3, "track_speed": 0.2, "stuck_time": 3.0},
    "stuck": {"pit": 0.30, "start": "pit", "modules": 3, "track_speed": 0.0, "stuck_time": 1.0},
}
TICKS = 250
SEEDS = (0, 1)


def control(seed: int, actions: int) -> Callable[[float], np.ndarray]:
    """Return the actions of a controller at a time: waves about an offset."""
    rng = np.random.default_rng([7, seed])
    height = rng.uniform(0, 0.6, actions)
    offset, rate, phase = 0.25 * rng.standard_normal(actions), rng.uniform(0.5, 4), rng.uniform(0, 6, actions)
    return lambda time: offset + height * np.sin(rate * time + phase)


def digest(env: Any, seed: int) -> str:
    """Return a digest of an episode: observations, rewards and `info`, rounded to 6 digits."""
    act, found = control(seed, env.action_space.shape[0]), sha256()
    observation, info = env.reset(seed=seed)
    reward = terminated = truncated = False
    for tick in range(TICKS):
        values = [*observation, reward, terminated, truncated, *(float(info[name]) for name in NAMES)]
        found.update((np.round(values, 6) + 0.0).astype(np.float32).tobytes())
        if terminated or truncated:
            break
        observation, reward, terminated, truncated, info = env.step(act(0.02 * tick))
    return found.hexdigest()[:16]
