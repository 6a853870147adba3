"""Whether a snake and a sled fare in an arena as they do in the truth; parts of `benchmarks.arena`."""

from __future__ import annotations

import time

import mujoco
import numpy as np
from scipy.stats import spearmanr

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.environment.vector import SnakePitVectorEnv

MODULES = 8


def drive(arena: Arena, num_controllers: int, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Let seeded random hinge controllers (sines of random size, pace and phase) drive; who crossed, how far."""
    generator = np.random.default_rng(7)
    shape = (num_controllers, MODULES - 1)
    size = generator.uniform(0.0, 0.45, (num_controllers, 1)) * generator.uniform(0.3, 1.0, shape)
    pace = generator.uniform(0.3, 1.5, (num_controllers, 1))
    phase = generator.uniform(0, 2 * np.pi, (num_controllers, 1)) + np.arange(
        MODULES - 1
    ) * generator.uniform(-1.5, 1.5, (num_controllers, 1))
    bias = generator.uniform(-0.1, 0.1, shape)
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


def compare(truth: Arena, arenas: dict[str, Arena], num_controllers: int, duration: float) -> dict:
    """Crossing and distance of the same controllers in each arena against those in the truth."""
    crossed, reached = drive(truth, num_controllers, duration)
    rows = {"truth": {"crossed": int(crossed.sum()), "controllers": num_controllers}}
    for name, arena in arenas.items():
        also, there = drive(arena, num_controllers, duration)
        rows[name] = {
            "agree": int((also == crossed).sum()),
            "crossed": int(also.sum()),
            "rank_correlation": float(spearmanr(reached, there).statistic),
        }
    return rows


def compare_sleds(truth: Arena, arenas: dict[str, Arena]) -> dict[str, dict]:
    """How much higher and slower a sled slides over each arena than over the truth, the pit left out."""
    x, height, speed = draw_sled(truth)
    rows = {}
    for name, arena in arenas.items():
        _, there, also = draw_sled(arena)
        is_open = np.abs(x) > 0.4
        rows[name] = {
            "kick_mm": 1e3 * float((there - height)[is_open].max()),
            "speed_loss": float((speed - also)[is_open].max()),
        }
    return rows


def draw_sled(arena: Arena, y: float = 0.3, speed: float = 0.3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw a small sled along an arena by a spring; its x [m], height [m] and share of the speed there."""
    spec = arena.spec()
    low, high = -3.0, 3.0
    z = float(arena.height(low, y)) + 0.02
    body = spec.worldbody.add_body(name="sled", pos=[low, y, z])
    for axis in np.eye(3)[[0, 2]]:
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.04, 0.04, 0.01], mass=0.5, friction=[0.2, 0.005, 0.0001]
    )
    spec.option.timestep = 0.002
    model = spec.compile()
    data = mujoco.MjData(model)
    trace = []
    for step in range(int((high - low) / speed / model.opt.timestep)):
        wanted = speed * step * model.opt.timestep
        data.qfrc_applied[0] = 300.0 * (wanted - data.qpos[0]) + 30.0 * (speed - data.qvel[0])
        mujoco.mj_step(model, data)
        trace.append((low + data.qpos[0], z + data.qpos[1], data.qvel[0] / speed))
    x, height, pace = np.array(trace).T
    order = np.argsort(x, kind="stable")
    smooth = np.convolve(pace, np.ones(25) / 25, mode="same")  # the mean over 50 ms, 15 mm of way
    grid = np.linspace(low + 0.3, high - 0.3, 2000)
    return grid, *(np.interp(grid, x[order], values[order]) for values in (height, smooth))


def time_steps(arenas: dict[str, Arena], num_steps: int) -> dict[str, float]:
    """Median time of a physics step [µs] of the same snake under the same controls, side by side."""
    worlds = {}
    for name, arena in arenas.items():
        env = SnakePitVectorEnv(num_envs=1, arena=arena, modules=MODULES, start="pit", num_threads=1)
        env.reset(seed=0)
        worlds[name] = env
    laps: dict[str, list[float]] = {name: [] for name in worlds}
    for tick in range(num_steps):
        action = 0.2 * np.sin(0.01 * tick + np.arange(MODULES - 1))[None]
        for name, env in worlds.items():
            begin = time.perf_counter()
            env.step(action)
            laps[name].append(time.perf_counter() - begin)
    return {name: 1e6 * float(np.median(lap)) / 4 for name, lap in laps.items()}
