"""Evolved weights of the behaviors beside the authors': how fast swarms assemble, in the scan and in the truth."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

import symbrion_gym as sg
from evolution._src.experiments.swarm.config import StoryConfig
from evolution._src.experiments.swarm.story import find_gathering_time
from evolution._src.experiments.swarm.weights_search import EVOLVED, WeightsConfig, evolve_weights
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights

SEEDS = 5
"""Searches."""
STORIES = 3
"""Assemblies that judge the weights of a search, in each arena; the first weights meet the same ones."""
FIRST_STORY = 1000
"""Seed of the first of them: no other assembly or search has it."""
ROBOTS = 4
"""Robots of an assembly."""
LONGEST = 1200.0
"""An assembly that takes longer counts as this long [s]."""
RESAMPLES = 10_000


def measure_weights(quick: bool) -> dict[str, Any]:
    """Evolve weights with 5 seeds, and compare the times of assemblies that neither search nor fits have met."""
    searches = 1 if quick else SEEDS
    config: dict[str, Any] = {"generations": 1, "population_size": 4, "pairs": 5} if quick else {}
    evolved = [evolve_weights(WeightsConfig(seed=seed, **config)).weights for seed in range(searches)]
    found: dict[str, Any] = {
        "weights": [{name: asdict(each)[name] for name in EVOLVED} for each in evolved],
        "robots": ROBOTS,
    }
    for name in ("gsrm", "truth"):
        arena = sg.load_arena(name)
        times: dict[str, list[float]] = {"authors": [], "evolved": []}
        for index in range(searches * (1 if quick else STORIES)):
            each = evolved[index // (1 if quick else STORIES)]
            for kind, weights in (("authors", BehaviorWeights()), ("evolved", each)):
                times[kind].append(_find_time(name, arena, FIRST_STORY + index, weights))
        found[name] = {kind: describe_times(np.array(values)) for kind, values in times.items()}
        found[name]["disjoint"] = (
            found[name]["evolved"]["interval"][1] < found[name]["authors"]["interval"][0]
        )
    return found


def _find_time(name: str, arena: sg.Arena, seed: int, weights: BehaviorWeights) -> float:
    story = StoryConfig(name, seed, ROBOTS, gather_time=LONGEST, weights=weights)
    seconds = find_gathering_time(story, arena)
    return seconds if np.isfinite(seconds) else LONGEST


def describe_times(seconds: np.ndarray) -> dict[str, Any]:
    """Return the median, its 95 % interval by resampling, and how many were too late.

    Args:
        seconds: of assemblies.
    """
    drawn = np.random.default_rng(0).choice(seconds, (RESAMPLES, len(seconds)))
    low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
    return {
        "median": float(np.median(seconds)),
        "interval": [float(low), float(high)],
        "late": int((seconds >= LONGEST).sum()),
        "seconds": seconds.round(1).tolist(),
    }
