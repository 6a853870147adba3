"""A search of one's own around `Evaluator` against the loop of this package: simulated seconds per processor second."""

import argparse
import statistics
import time
from dataclasses import replace
from typing import Any

import cma

import evolution as ev

_CONFIG = ev.EvolutionConfig(
    arena="truth",
    controller="reactive",
    origin="hint",
    sigma=0.15,
    generations=5,
    population_size=12,
    trials=3,
    restart_after=None,
    stop_when_solved=False,
    validation=ev.Validation(candidates=0, mean_share=2.0),
)


def run_own_loop(seed: int) -> float:
    """Return the simulated seconds of a run of `evolve`."""
    run = ev.evolve(replace(_CONFIG, seed=seed))
    return sum(entry.outcome.seconds for entry in run.record.entries)


def run_pycma(seed: int) -> float:
    """Return the simulated seconds of the same number of generations of pycma."""
    seconds = 0.0
    with ev.Evaluator(
        arena=_CONFIG.arena, controller="reactive", trials=_CONFIG.trials, seed=seed
    ) as evaluator:
        options = {"seed": seed + 1, "verbose": -9, "popsize": _CONFIG.population_size}
        search = cma.CMAEvolutionStrategy(evaluator.controller.initial, _CONFIG.sigma, options)
        for generation in range(_CONFIG.generations):
            genotypes = search.ask()
            fitness, outcomes = evaluator(genotypes, seed=generation)
            search.tell(genotypes, list(-fitness))
            seconds += sum(outcome.seconds for outcome in outcomes)
    return seconds


def measure_ask_and_tell(repeats: int = 3) -> dict[str, Any]:
    """Compare both, alternating, on one thread, by processor time; the first of each compiles."""
    rates: dict[str, list[float]] = {"own loop": [], "pycma": []}
    for seed in range(repeats + 1):
        for name, search in (("own loop", run_own_loop), ("pycma", run_pycma)):
            began = time.process_time()
            seconds = search(seed)
            rates[name].append(seconds / (time.process_time() - began))
    own, other = (statistics.median(values[1:]) for values in rates.values())
    return {"own_loop": round(own, 1), "pycma": round(other, 1), "ratio": round(other / own, 3)}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    print(measure_ask_and_tell(parser.parse_args().repeats))
