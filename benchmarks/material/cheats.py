"""Audited crossings: random and evolved controllers in many bodies, pits and arenas, in rounds."""

from collections import Counter
from typing import Any

import numpy as np

from benchmarks.material.crossings import LAWS, cross, draw_conditions, evolve
from symbrion_gym._src.environment.vector import SnakePitVectorEnv

LANES = 40
GENERATIONS = 5
_SENSORS = ("hinge_angle", "pitch", "contact", "track_odometry")
_STUCK_TIME = 4.0


def try_random(number: int) -> tuple[Counter[str], list[tuple[str, ...]]]:
    """Run one round of random controllers, reproducible by its number; return counts and faults found.

    The spread of the genotypes differs between rounds, so that stiff bodies are included.
    """
    rng = np.random.default_rng([1, number])
    options = _draw_options(rng, [0.20, 0.25, 0.30, 0.35, 0.40])
    envs = SnakePitVectorEnv(LANES, **options)
    spread = rng.uniform(0.05, 0.7)
    genotypes = np.clip(rng.normal(0.0, spread, (LANES, 12)), -1.5, 1.5)
    conditions = draw_conditions(rng, LANES) | {"friction": rng.uniform(0.3, 1.2, LANES)}
    outcomes = cross(envs, genotypes, conditions)
    envs.close()
    return _count("random", outcomes)


def try_evolved(number: int) -> tuple[Counter[str], list[tuple[str, ...]]]:
    """Run one short evolution, reproducible by its number; the generations after the first count."""
    rng = np.random.default_rng([2, number])
    envs = SnakePitVectorEnv(LANES, **_draw_options(rng, [0.25, 0.30, 0.33, 0.36, 0.40]))
    generations = evolve(envs, 1000 + number, GENERATIONS, str(rng.choice(LAWS)))
    envs.close()
    return _count("evolved", [outcome for trials in generations[1:] for _, outcome in trials])


def _count(kind: str, outcomes: list) -> tuple[Counter[str], list[tuple[str, ...]]]:
    counts = Counter({f"{kind} episodes": len(outcomes)})
    counts[f"{kind} successes"] = sum(one.success for one in outcomes)
    faults = [one.faults for one in outcomes if one.faults]
    counts[f"{kind} cheats"] = len(faults)
    return counts, faults


def _draw_options(rng: np.random.Generator, pits: list[float]) -> dict[str, Any]:
    arena = str(rng.choice(["truth", "simple", "gsrm", "gg"], p=[0.5, 0.1, 0.2, 0.2]))
    return {
        "arena": arena,
        "pit": float(rng.choice(pits)) if arena in ("truth", "simple") else None,
        "modules": int(rng.integers(4, 11)),
        "start": "pit",
        "sensors": _SENSORS,
        "stuck_time": _STUCK_TIME,
        "duration": 45.0,
        "autoreset_mode": "Disabled",
        "num_threads": 1,
    }
