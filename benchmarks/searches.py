"""Searches of one controller at an equal budget: CMA-ES, islands of it, MAP-Elites, random genotypes.

    python -m benchmarks.searches [--quick] [--seeds 0 1 ...]

Each searches on a scanned arena with as many genotypes. Its fittest genotype is tried again in the true course, and all
it has tried is sorted into one grid of efforts and times. Rows are written one by one; one that exists is not measured
again.
"""

import argparse
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

import evolution as ev
from benchmarks.evolution_runs import Results
from evolution._src.search.archive import make_archive

GENERATIONS, GENOTYPES, TRIALS = 6, 16, 1
SEEDS = (0, 1, 2)
SIGMA = 0.5
JUDGING = 10
"""Fresh trials of the fittest genotype in the true course."""
GRID = ev.ArchiveConfig(("effort", "seconds"), (8, 8), (0.0, 0.0), (1.0, 20.0))
"""Mean effort and mean time [s] of a trial."""
COMMON: dict[str, Any] = {"controller": "travelling", "modules": 8}
SEARCHES: dict[str, dict[str, Any]] = {
    "cmaes": {},
    "islands": {"population_size": GENOTYPES // 4, "islands": ev.IslandsConfig(4, interval=2)},
    "islands_apart": {"population_size": GENOTYPES // 4, "islands": ev.IslandsConfig(4, interval=0)},
    "elites": {"archive": GRID},
    "random": {},
}
"""One population, four small ones that exchange every second generation, four that never do, MAP-Elites, and normal
genotypes around the start."""


def search(name: str, seed: int) -> list[tuple[np.ndarray, float, ev.Outcome]]:
    """Return the genotypes that a search tried, their fitness and outcomes."""
    if name == "random":
        return _sample(seed)
    defaults = {"population_size": GENOTYPES, "generations": GENERATIONS}
    config = ev.EvolutionConfig(
        arena="gsrm",
        seed=seed,
        sigma=SIGMA,
        trials=TRIALS,
        restart_after=None,
        stop_when_solved=False,
        validation=ev.Validation(candidates=0, mean_share=2.0),
        **COMMON,
        **(defaults | SEARCHES[name]),
    )
    entries = ev.evolve(config).record.entries
    return [(entry.genotype, entry.fitness, entry.outcome) for entry in entries]


def _sample(seed: int) -> list[tuple[np.ndarray, float, ev.Outcome]]:
    rng, tried = np.random.default_rng(seed), []
    with ev.Evaluator("gsrm", trials=TRIALS, seed=seed, scoring=ev.Scoring(), **COMMON) as evaluator:
        controller = evaluator.controller
        for generation in range(GENERATIONS):
            genotypes = SIGMA * rng.normal(size=(GENOTYPES, len(controller.parameters)))
            genotypes = np.clip(genotypes, controller.lower, controller.upper)
            fitness, outcomes = evaluator(genotypes, seed=generation)
            tried += list(zip(genotypes, fitness, outcomes, strict=True))
    return tried


def measure(name: str, seed: int) -> dict[str, Any]:
    """Return what a search found, and its processor time [s]."""
    began = time.process_time()
    tried = search(name, seed)
    seconds = time.process_time() - began
    archive = make_archive(GRID, len(tried[0][0]))
    for genotype, fitness, outcome in tried:
        archive.add_single(genotype, fitness, GRID.measure(outcome))
    genotype, fitness, _ = max(tried, key=lambda each: each[1])
    again = ev.evaluate(genotype, "truth", seed=1000 + seed, trials=JUDGING, **COMMON)
    return {
        "search": name,
        "seed": seed,
        "genotypes": len(tried),
        "best": float(fitness),
        "successes_in_truth": again.outcomes[0].successes,
        "fitness_in_truth": float(again.fitness[0]),
        "cells": int(archive.stats.num_elites),
        "processor_seconds": round(seconds, 1),
    }


def run(quick: bool = False, seeds: Sequence[int] = SEEDS) -> None:
    """Measure what is missing; write results/searches.json row by row."""
    results = Results("searches")
    for seed in seeds[: 1 if quick else None]:
        for name in SEARCHES:
            if not any(row["search"] == name and row["seed"] == seed for row in _read_rows(results)):
                row = measure(name, seed)
                rows = [*_read_rows(results), row]  # another process may have added some
                results.put("searches", {"summary": summarize(rows), "runs": rows})
                print(row, flush=True)


def _read_rows(results: Results) -> list[dict[str, Any]]:
    return results.content.get("searches", {}).get("runs", [])


def summarize(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the sums and the means of each search over its seeds."""
    summary = {}
    for name in SEARCHES:
        own = [row for row in rows if row["search"] == name]
        if own:
            summary[name] = {
                "runs": len(own),
                "successes": sum(row["successes_in_truth"] for row in own),
                "trials": JUDGING * len(own),
                "fitness": float(np.mean([row["fitness_in_truth"] for row in own])),
                "cells": float(np.mean([row["cells"] for row in own])),
            }
    return summary


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--seeds", type=int, nargs="*", default=SEEDS)
    options = parser.parse_args()
    run(options.quick, options.seeds)
