"""Does evolution find champions that hold in the true arena, at what price, and is its bookkeeping honest?

    python -m benchmarks.evolution [--quick] [--only champions stages ...]

Every champion is judged by 20 fresh randomised trials from the floor in the true arena, which the search
never saw. Wall seconds mean something on an idle machine only; genotypes and trials always do.
"""

import argparse
import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.report import write_results
from evolution.cmaes import evolve
from evolution.config import EvolutionConfig
from evolution.controller import REFLEX
from evolution.evaluation import Job, Trials, evaluate, make_backend
from evolution.playback import judge
from evolution.rollout import simulate
from evolution.run import Run
from evolution.stages import Stage
from symbrion_gym.environment import vector

TRIALS = 20
PASS = 18
BASE = EvolutionConfig(arena="gsrm", modules=8, generations=50, workers=2)
MODELS = ("simple", "gsrm", "gg", "truth")


def measure_run(config: EvolutionConfig) -> dict[str, Any]:
    """Evolve, judge in truth, and return figures of both."""
    began = time.perf_counter()
    run = evolve(config)
    seconds = time.perf_counter() - began
    assert run.champion is not None
    environment = tuple(pair for pair in run.champion.environment if pair[0] in ("abyss", "pit"))
    champion, seed = replace(run.champion, environment=environment), 10_000 + config.seed
    held = judge(champion, "truth", TRIALS, seed, workers=config.workers).successes
    return {
        "seed": config.seed,
        "genotypes": int(run.history["evaluations"][-1]),
        "trials": int(run.history["trials"][-1]),
        "wall_seconds": round(seconds, 1),
        "modules": run.champion.modules,
        "validated": [run.champion.successes, run.champion.trials],
        "held_in_truth": held,
        "gap_of_20": _find_gap(run, held),
    }


def _find_gap(run: Run, held: int) -> float | None:
    champion = run.champion
    return (
        round(20 * champion.successes / champion.trials - held, 2) if champion and champion.trials else None
    )


def measure_champions(seeds: int, **changes: Any) -> dict[str, Any]:
    """Evolve once for each seed and count the champions that hold."""
    rows = [measure_run(replace(BASE, seed=seed, **changes)) for seed in range(seeds)]
    gaps = [row["gap_of_20"] for row in rows if row["gap_of_20"] is not None]
    return {
        "runs": rows,
        "champions_that_hold": sum(row["held_in_truth"] >= PASS for row in rows),
        "of": seeds,
        "median_genotypes": float(np.median([row["genotypes"] for row in rows])),
        "median_wall_seconds": float(np.median([row["wall_seconds"] for row in rows])),
        "mean_gap_of_20": float(np.mean(gaps)) if gaps else None,
    }


def measure_start(trials: int) -> dict[str, Any]:
    """Return how often a body without control, and the point where the search begins, cross in truth."""
    results = {}
    for name, genotype in (("zero", np.zeros(len(REFLEX))), ("start of the search", np.array(REFLEX))):
        _, outcomes = evaluate(genotype, arena="truth", trials=trials, start="floor", seed=99, workers=2)
        results[name] = {"successes": outcomes[0].successes, "trials": trials}
    return results


def measure_stages(seeds: int) -> dict[str, Any]:
    """Compare coarse to fine with fine only, by the time to a champion that holds in truth."""
    fine = measure_champions(seeds, arena="gg")
    staged = measure_champions(seeds, stages=(Stage("gsrm", 15, "success"), Stage("gg")))
    ratio = fine["median_wall_seconds"] / staged["median_wall_seconds"]
    return {"fine_only": fine, "coarse_to_fine": staged, "times_faster": round(ratio, 2)}


class _TimedBatch(vector.Batch):
    """The batch of simulations, with a clock at its steps."""

    seconds = 0.0

    def step(self, *arguments: Any, **options: Any) -> Any:
        began = time.perf_counter()
        try:
            return super().step(*arguments, **options)
        finally:
            _TimedBatch.seconds += time.perf_counter() - began


def measure_overhead(repeats: int) -> dict[str, Any]:
    """Return what everything around the steps of `mujoco.batch` adds to their time, median over repeats."""
    trials = Trials(arena="gsrm", count=2, environment=(("duration", 10.0), ("stuck_time", 20.0)))
    jobs = [Job(np.array(REFLEX) + 0.01 * index, trials) for index in range(12)]
    original, vector.Batch = vector.Batch, _TimedBatch
    shares = []
    try:
        for _ in range(repeats + 1):  # the first one compiles
            began, _TimedBatch.seconds = time.perf_counter(), 0.0
            simulate(jobs, 1)
            shares.append((time.perf_counter() - began) / _TimedBatch.seconds - 1)
    finally:
        vector.Batch = original
    return {"overhead_over_bare_stepping": round(float(np.median(shares[1:])), 3)}


def measure_workers(repeats: int) -> dict[str, Any]:
    """Compare two threads with one on the same jobs, in turns."""
    jobs = [Job(np.array(REFLEX) + 0.01 * index, Trials(arena="gsrm", count=2)) for index in range(12)]
    seconds: dict[int, list[float]] = {1: [], 2: []}
    outcomes = {}
    for _ in range(repeats + 1):
        for workers in seconds:
            began = time.perf_counter()
            outcomes[workers] = make_backend("batch", workers).run(jobs)
            seconds[workers].append(time.perf_counter() - began)
    speedup = np.median(seconds[1][1:]) / np.median(seconds[2][1:])
    return {"speedup_of_two": round(float(speedup), 2), "equal_results": outcomes[1] == outcomes[2]}


def measure_body_length(seeds: int) -> dict[str, Any]:
    """Let evolution choose the length of the body."""
    return measure_champions(seeds, body_lengths=(4, 9), generations=80, stop_when_solved=False)


def run(quick: bool = False, only: tuple[str, ...] = (), seeds: int = 5) -> dict[str, Any]:
    """Measure, print, keep and return the figures.

    Args:
        quick: two seeds, and the small parts only.
        only: names of the parts to measure; empty means all (all small ones if quick).
        seeds: number of runs of each kind.
    """
    seeds = 2 if quick else seeds
    parts = {
        "start": lambda: measure_start(20),
        "overhead": lambda: measure_overhead(2 if quick else 5),
        "workers": lambda: measure_workers(2 if quick else 5),
        "champions": lambda: measure_champions(seeds),
        "six_modules": lambda: measure_champions(seeds, modules=6),
        "abyss": lambda: measure_champions(
            seeds, arena="truth", environment=(("abyss", True), ("pit", 0.35))
        ),
        "models": lambda: {model: measure_champions(seeds, arena=model) for model in MODELS},
        "stages": lambda: measure_stages(seeds),
        "body_length": lambda: measure_body_length(min(seeds, 3)),
    }
    small = ("start", "overhead", "workers", "champions")
    names = only or (small if quick else tuple(parts))
    results = {}
    for name in names:
        results[name] = parts[name]()
        _print(name, results[name])
    write_results("_".join(["evolution_quick" if quick else "evolution", *only]), results)
    return results


def _print(name: str, result: Any) -> None:
    if isinstance(result, dict) and "runs" in result:
        print(f"{name}: {result['champions_that_hold']} of {result['of']} champions hold in truth", end="; ")
        print(
            f"median {result['median_genotypes']:.0f} genotypes, {result['median_wall_seconds']:.0f} s",
            end="; ",
        )
        print(f"mean gap {result['mean_gap_of_20']} of 20")
        for row in result["runs"]:
            print("   ", ", ".join(f"{key} {value}" for key, value in row.items()))
    elif isinstance(result, dict) and any(isinstance(value, dict) for value in result.values()):
        for key, value in result.items():
            _print(f"{name}, {key}", value)
    else:
        print(f"{name}: {result}")


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two seeds, and the small parts only")
    parser.add_argument("--only", nargs="*", default=[], help="parts to measure")
    parser.add_argument("--seeds", type=int, default=5, help="runs of each kind")
    options = parser.parse_args()
    run(options.quick, tuple(options.only), options.seeds)


if __name__ == "__main__":
    main()
