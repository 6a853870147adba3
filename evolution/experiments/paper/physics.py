"""Table II: what a physics step and its collision detection cost while the snake crosses."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import reconstruction as rc
import symbrion_gym as sg
from evolution.champions.policy import ChampionPolicy
from evolution.controllers.controller import make_controller
from evolution.experiments.paper.arenas import RECIPES, load_arena
from evolution.experiments.paper.config import PaperConfig
from evolution.experiments.paper.statistics import find_ratio, summarise
from evolution.search.validation import Champion

CONDITIONS = {"friction": (0.55, 0.9), "yaw": (-0.05, 0.05), "start_offset": (-0.05, 0.05)}
"""What differs from run to run."""
COSTS = ("physics_us", "collision_us")
EDGE = -0.2
"""Where the pit begins, along the course [m]."""
WAIT = 50e-6
"""A tick that lasts so much longer than the processor worked for it [s] was interrupted, and is left out."""
LEAD, REST = 400, 1000
"""Ticks in which the head reaches the pit, and after the timed ones: in 17.5 s the body comes 1.75 m far at
most, and needs some more to be wholly across."""


def measure_physics(
    folder: Path, champion: Champion, config: PaperConfig, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Time the champion's crossings in every arena, by MuJoCo's own timers.

    The arenas take turns run by run, so that a machine that slows down slows all of them down; run i has the
    same conditions in all of them.

    Args:
        folder: holds the arenas.
        champion: drives the body.
        config: runs, steps and seed.
        progress: told how far it is.

    Returns:
        `rows`, one an arena: `physics_us` of a whole step and `collision_us` in it (mean, deviation and median
        over the runs), `contacts` a step, `crossed` runs, `pieces`; `interrupted`, the share of ticks left out since
        something else had the processor; `ratios` of arenas to the hand-made model, with 95 % intervals.
    """
    arenas = {name: load_arena(folder, name) for name in RECIPES}
    samples = time_crossings(champion, arenas, config, progress)
    rows = [
        {
            "arena": name,
            "text": RECIPES[name].text,
            "pieces": len(arena.pieces),
            "triangles": len(arena.surface.faces),
            **{cost: summarise(samples[name][cost]) for cost in COSTS},
            "contacts": float(np.mean(samples[name]["contacts"])),
            "crossed": int(np.sum(samples[name]["crossed"])),
        }
        for name, arena in arenas.items()
    ]
    ratios = {
        name: {cost: find_ratio(samples[name][cost], samples["simple"][cost], config.seed) for cost in COSTS}
        for name in RECIPES
        if name != "simple"
    }
    interrupted = float(np.mean([sample["interrupted"] for sample in samples.values()]))
    return {
        "runs": config.runs,
        "steps": config.steps,
        "interrupted": interrupted,
        "rows": rows,
        "ratios": ratios,
        "samples": samples,
    }


def time_crossings(
    champion: Champion,
    arenas: Mapping[str, sg.Arena],
    config: PaperConfig,
    progress: rc.Progress = rc.silent,
) -> dict[str, dict[str, list[float]]]:
    """Return arena -> cost -> one value a run: `physics_us`, `collision_us`, `contacts`, `crossed`, `interrupted`."""
    sensors = make_controller(champion.controller, champion.modules).sensors
    environments = {
        name: sg.SnakePitEnv(
            arena=arena, modules=champion.modules, sensors=sensors, start="pit", timers=True, stuck_time=1e3
        )
        for name, arena in arenas.items()
    }
    samples = {name: {cost: [] for cost in (*COSTS, "contacts", "crossed", "interrupted")} for name in arenas}
    for run in range(config.runs):
        progress(f"run {run + 1} of {config.runs}", run / config.runs)
        for name, environment in environments.items():
            measured = _time_crossing(environment, champion, config.steps, config.seed + run)
            for cost, value in measured.items():
                samples[name][cost].append(value)
    for environment in environments.values():
        environment.close()
    return samples


def _time_crossing(
    environment: sg.SnakePitEnv, champion: Champion, steps: int, seed: int
) -> dict[str, float]:
    """Time `steps` physics steps from the moment the head is above the pit; then go on to see whether it crosses."""
    policy = ChampionPolicy(champion, environment.observation_structure)
    observation, info = environment.reset(seed=seed, options=CONDITIONS)
    state, crossed = None, False
    timed: list[tuple[float, float, int]] = []
    waits: list[float] = []
    ticks = max(1, steps // environment.config.frame_skip)
    for tick in range(LEAD + ticks + REST):
        action, state = policy.predict(observation, state)
        began = time.perf_counter() - time.thread_time()
        observation, _, _, _, info = environment.step(action)
        wait = time.perf_counter() - time.thread_time() - began
        crossed = crossed or info["success"]
        if len(timed) < ticks and (tick >= LEAD or info["x_position"] > EDGE):
            timed.append((info["physics_us"], info["collision_us"], environment.data.ncon))
            waits.append(wait)
        if crossed and len(timed) == ticks:
            break
    is_own = np.array(waits) < WAIT
    physics, collision, contacts = np.mean(np.array(timed)[is_own if is_own.any() else slice(None)], axis=0)
    return {
        "physics_us": float(physics),
        "collision_us": float(collision),
        "contacts": float(contacts),
        "crossed": bool(crossed),
        "interrupted": float(1 - is_own.mean()),
    }
