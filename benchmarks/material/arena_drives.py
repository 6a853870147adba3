"""Whether controllers have the same outcome in an arena as in the true one, and the time of physics steps."""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
import numpy as np
from scipy.stats import spearmanr

from benchmarks.material.crossings import KNOTS, cross, draw_conditions
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.environment.snake_pit import SnakePitEnv
from symbrion_gym._src.environment.vector import SnakePitVectorEnv

MODULES = 8
Drive = Callable[[Arena, int], tuple[np.ndarray, np.ndarray]]
"""From an arena and a number of controllers to which ones crossed and how far each came [m]."""


def drive_postures(arena: Arena, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Run controllers with twelve random angles along the course; return which ones crossed, and their progress [m].

    About half of them cross the pit of 0.30 m, under random friction, torque, start and heading.
    """
    genotypes = np.clip(np.random.default_rng(2).normal(0.0, 0.2, (count, len(KNOTS))), -1.5, 1.5)
    envs = SnakePitVectorEnv(
        count, arena=arena, modules=MODULES, start="pit", stuck_time=6.0, autoreset_mode="Disabled"
    )
    outcomes = cross(envs, genotypes, draw_conditions(np.random.default_rng(1), count))
    envs.close()
    return np.array([one.success for one in outcomes]), np.array([one.progress for one in outcomes])


def drive_waves(arena: Arena, num_controllers: int, duration: float = 40.0) -> tuple[np.ndarray, np.ndarray]:
    """Run oscillating controllers of random size, frequency and phase; return which ones crossed, and x reached [m].

    They are sensitive: shifting the true arena by 1 mm changes the outcome of two to four of thirty.
    """
    rng = np.random.default_rng(7)
    shape = (num_controllers, MODULES - 1)
    size = rng.uniform(0.0, 0.45, (num_controllers, 1)) * rng.uniform(0.3, 1.0, shape)
    pace = rng.uniform(0.3, 1.5, (num_controllers, 1))
    phase = rng.uniform(0, 2 * np.pi, (num_controllers, 1)) + np.arange(MODULES - 1) * rng.uniform(
        -1.5, 1.5, (num_controllers, 1)
    )
    bias = rng.uniform(-0.1, 0.1, shape)
    envs = SnakePitVectorEnv(
        num_envs=num_controllers,
        arena=arena,
        modules=MODULES,
        start="pit",
        duration=duration,
        autoreset_mode="Disabled",
    )
    envs.reset(seed=[0] * num_controllers)
    has_crossed, reached = np.zeros(num_controllers, dtype=bool), np.zeros(num_controllers)
    is_done = np.zeros(num_controllers, dtype=bool)
    for tick in range(round(duration / 0.02) + 1):
        actions = np.clip(bias + size * np.sin(pace * 0.02 * tick + phase), -1, 1)
        _, _, terminated, truncated, info = envs.step(actions)
        now = ~is_done
        reached[now] = np.asarray(info["x_position"])[now]
        has_crossed[now] |= np.asarray(info["success"])[now]
        is_done |= terminated | truncated
        if is_done.all():
            break
    envs.close()
    return has_crossed, reached


class OutcomeComparison:
    """Compares the outcomes of the same controllers in several arenas with those in the true one."""

    def __init__(self, truth: Arena, num_controllers: int, drive: Drive = drive_postures) -> None:
        """Run them in the true arena."""
        self._count, self._drive = num_controllers, drive
        self._crossed, self._reached = drive(truth, num_controllers)

    @property
    def reference(self) -> dict[str, float]:
        """The outcome in the true arena."""
        return {"crossed": int(self._crossed.sum()), "controllers": self._count}

    def compare(self, arena: Arena) -> dict[str, float]:
        """Return how many outcomes are equal, and the rank correlation of the distance."""
        begin = time.process_time()
        also, there = self._drive(arena, self._count)
        return {
            "agree": int((also == self._crossed).sum()),
            "crossed": int(also.sum()),
            "rank_correlation": float(spearmanr(self._reached, there).statistic),
            "cpu_seconds": time.process_time() - begin,
        }


def time_steps(arenas: dict[str, Arena], num_ticks: int) -> dict[str, float]:
    """Find the processor time of a bare physics step [µs] of the same snake under the same controls, side by side."""
    worlds = {}
    for name, arena in arenas.items():
        env = SnakePitEnv(arena=arena, modules=MODULES, start="pit")
        env.reset(seed=0)
        worlds[name] = env
    spent = dict.fromkeys(worlds, np.inf)
    for _ in range(5):
        for name, env in worlds.items():
            env.reset(seed=0)
            begin = time.thread_time()
            for tick in range(num_ticks):
                env.data.ctrl[: MODULES - 1] = 0.2 * np.sin(0.04 * tick + np.arange(MODULES - 1))
                mujoco.mj_step(env.model, env.data, nstep=4)
            spent[name] = min(spent[name], time.thread_time() - begin)
    return {name: 1e6 * seconds / num_ticks / 4 for name, seconds in spent.items()}
