"""Behaviors of a swarm: docking trials beside those of real robots, and the whole story."""

from __future__ import annotations

import csv
from typing import Any

import numpy as np

import evolution as ev
import symbrion_gym as sg
from benchmarks.material.clouds import DATA
from evolution._src.experiments.swarm.config import StoryConfig
from evolution._src.experiments.swarm.docking_trials import DockingTimes, run_docking_trials
from evolution._src.experiments.swarm.story import tell_story

HARDWARE = DATA / "docking_trials.csv"
PAIR = "Scout->Scout"
QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)
JUDGE_SEED = 100
"""First seed of the trials that judge; parameters were fitted with seed 0."""
PARTS = 4
"""The trials that judge run in so many parts."""


def read_hardware(half: int | None = None) -> DockingTimes:
    """Return the real robots' trials of two Scouts.

    Args:
        half: 0 for the half that parameters were fitted on, every other row; 1 for the rest; None for all.
    """
    with HARDWARE.open() as file:
        rows = [row for row in csv.DictReader(file) if row["pair"] == PAIR]
    rows = rows if half is None else rows[half::2]
    return DockingTimes(
        np.array([int(row["position"]) for row in rows]),
        np.array([row["locked"] == "1" for row in rows]),
        np.array([float(row["locate_beacon_to_locking_s"] or "nan") for row in rows]),
        np.array([int(row["recoveries"]) for row in rows]),
    )


def describe(times: DockingTimes) -> dict[str, Any]:
    """Return rate, quantiles, recoveries and all times."""
    seconds = np.sort(times.seconds[times.locked])
    return {
        "locked": int(times.locked.sum()),
        "trials": len(times.locked),
        "quantiles_s": dict(zip(map(str, QUANTILES), np.quantile(seconds, QUANTILES).tolist(), strict=True)),
        "recoveries": float(times.recoveries.mean()),
        "without_recovery": float((times.recoveries == 0).mean()),
        "seconds": seconds.round(1).tolist(),
    }


def measure_docking(quick: bool) -> dict[str, Any]:
    """Repeat the half of the real trials that nothing was fitted on; skipped where their table is absent."""
    if not HARDWARE.is_file():
        return {"skipped": f"{HARDWARE.name} is not there"}
    fitted, judged = read_hardware(0), read_hardware(1)
    found: dict[str, Any] = {"hardware_fitted": describe(fitted), "hardware_judged": describe(judged)}
    parts = [run_part(judged, part) for part in range(1 if quick else PARTS)]
    joined = DockingTimes(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    found["simulated_judged"] = describe(joined)
    low, high = find_wilson(111, 114)
    ours = found["simulated_judged"]
    found["rate_interval"] = [low, high]
    found["rate_within"] = bool(low <= ours["locked"] / ours["trials"] <= high)
    found["median_within"] = bool(25.0 <= ours["quantiles_s"]["0.5"] <= 45.0)
    return found


def run_part(judged: DockingTimes, part: int) -> DockingTimes:
    """Repeat every fourth of some real trials, with a seed of its own."""
    return run_docking_trials(judged.position[part::PARTS], seed=JUDGE_SEED + part)


def find_wilson(successes: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson 1927)."""
    share, square = successes / trials, z**2 / trials
    middle = (share + square / 2) / (1 + square)
    half = z * np.sqrt(share * (1 - share) / trials + square / (4 * trials)) / (1 + square)
    return float(middle - half), float(middle + half)


def measure_story(quick: bool) -> dict[str, Any]:
    """Evolve a champion in the scan, then tell the story with 20 seeds in scan and truth, and without docking."""
    run = ev.evolve(ev.EvolutionConfig(arena="gsrm", seed=0, generations=30))
    seeds = range(1 if quick else 20)
    found: dict[str, Any] = {}
    for name in ("gsrm", "truth"):
        arena = sg.load_arena(name)
        stories = [tell_story(StoryConfig(arena=name, seed=s), arena, run.champion).as_dict() for s in seeds]
        found[name] = {"successes": sum(story["success"] for story in stories), "stories": stories}
    alone = [
        tell_story(
            StoryConfig(seed=s, docks=False, gather_time=300.0), sg.load_arena("gsrm"), run.champion
        ).as_dict()
        for s in seeds
    ]
    found["without_docking"] = {"successes": sum(story["success"] for story in alone), "trials": len(alone)}
    return found
