"""Steps with random options and with invalid actions, many simulations at once."""

from collections import Counter
from typing import Any

import numpy as np

from symbrion_gym._src.environment.config import SENSORS
from symbrion_gym._src.environment.vector import SnakePitVectorEnv

_LANES = 64
_TICKS = 1000
_WORSE = {"friction": (0.05, 4.0), "yaw": (-1.0, 1.0), "torque_scale": (0.1, 5.0), "track_speed": (0.0, 2.0)}
_RAYS = ("ir", "laser")
_CHEAP = tuple(name for name in SENSORS if name not in _RAYS)


def step_at_random(number: int) -> Counter[str]:
    """Run one round, reproducible by its number; return the counts.

    Counts: "steps", "episodes", "diverged", "wrong shapes refused", "wrong shapes taken", "not finite"
    (observations, rewards and numbers of `info`), "out of bounds" (observations).
    """
    rng, counts = np.random.default_rng([0, number]), Counter[str]()
    envs = SnakePitVectorEnv(_LANES, num_threads=1, **_draw_options(rng))
    low, high = envs.observation_space.low, envs.observation_space.high
    shape = (_LANES, len(envs.single_action_space.low))
    envs.reset(seed=number)
    was_done = np.zeros(_LANES, dtype=bool)
    for tick in range(_TICKS):
        actions = _draw_actions(rng, shape)
        if actions.shape != shape:
            try:
                envs.step(actions)
                counts["wrong shapes taken"] += 1
            except ValueError:
                counts["wrong shapes refused"] += 1
            continue
        observation, reward, terminated, truncated, info = envs.step(actions)
        counts["steps"] += int(_LANES - was_done.sum())
        was_done = terminated | truncated
        counts["episodes"] += int(was_done.sum())
        counts["diverged"] += int(info["diverged"][was_done].sum())
        numbers = np.array([info["x_position"], info["progress"], info["reward_effort"]])
        is_finite = (
            np.isfinite(observation).all(axis=1) & np.isfinite(reward) & np.isfinite(numbers).all(axis=0)
        )
        counts["not finite"] += int((~is_finite).sum())
        counts["out of bounds"] += int(((observation < low) | (observation > high)).any(axis=1).sum())
        if tick % 250 == 249:
            envs.reset(options={**_WORSE, "reset_mask": rng.random(_LANES) < 0.5})
            was_done[:] = False
    envs.close()
    return counts


def _draw_options(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "arena": str(rng.choice(["truth", "truth", "simple", "gsrm", "gg"])),
        "modules": int(rng.choice([1, 2, 2, 2, 2, 3])),
        "friction": float(rng.uniform(0.05, 4.0)),
        "track_speed": float(rng.uniform(0.0, 2.0)),
        "hinge_torque": float(rng.uniform(0.1, 40.0)),
        "timestep": float(rng.choice([0.002, 0.005, 0.005, 0.01, 0.02])),
        "frame_skip": int(rng.choice([1, 1, 1, 1, 1, 1, 1, 3])),
        "start": str(rng.choice(["floor", "pit"])),
        "noise": float(rng.choice([0.0, 1.0, 10.0])),
        "bottomless": bool(rng.integers(2)),
        "track_control": str(rng.choice(["constant", "body", "modules"])),
        "stuck_time": float(rng.uniform(0.5, 10.0)),
        "sensors": tuple(rng.permutation([*_CHEAP, *(_RAYS if rng.random() < 0.2 else ())]).tolist()),
    }


def _draw_actions(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    kind = rng.integers(12)
    if kind == 0:
        return np.full(shape, rng.choice([np.nan, np.inf, -np.inf, 1e300]))
    if kind == 1 and rng.random() < 0.2:
        return np.zeros((shape[0], shape[1] + 1))
    if kind == 2:
        return rng.uniform(-100, 100, shape).astype(np.float32)
    if kind == 3:
        return np.where(rng.random(shape) < 0.5, rng.choice([np.nan, np.inf, -np.inf]), 1.0)
    if kind == 4:
        return np.sign(rng.normal(size=shape))
    return rng.uniform(-1, 1, shape)
