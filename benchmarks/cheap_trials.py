"""Cheaper trials: the time to a confirmed champion, and whether it holds in the true arena.

Run as `python -m benchmarks.cheap_trials [--quick] [--seeds 0 1 ...] [--ways NAME ...]`. A run of each way is made for
one seed after the other, so that all meet the same load; times are processor times. Samples of the search are tried in
the cheaper way, candidates for the champion in full: 48 trials, of which 47 must succeed. "full" is the search
as it is.
"""

import argparse
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

import evolution as ev
from benchmarks.material.cheap_trials import WAYS
from benchmarks.report import describe_moment, load_record, write_results

BASE = ev.EvolutionConfig(arena="gsrm", population_size=24, generations=40)
SEEDS = tuple(range(900, 910))
TRIALS = 20
PASS = 18
JUDGING_SEED = 7_000_000
FULL = "full"


def run(
    quick: bool = False, seeds: Sequence[int] = SEEDS, ways: Sequence[str] = tuple(WAYS)
) -> dict[str, Any]:
    """Measure, write and return everything; runs of this commit that exist stay.

    Args:
        quick: the first seed alone.
        seeds: of the runs.
        ways: of `WAYS`.
    """
    rows = _find_rows()
    _measure("full", -1, generations=1)  # compiles environments and imports what is needed
    for seed in seeds[:1] if quick else seeds:
        for way in ways:
            if any(row["seed"] == seed and row["way"] == way for row in rows):
                continue
            rows.append(_measure(way, seed))
            print(rows[-1], flush=True)
            write_results("cheap_trials", {"runs": rows, "summary": summarize(rows)})
    return load_record("cheap_trials")["results"]


def _find_rows() -> list[dict[str, Any]]:
    record, now = load_record("cheap_trials"), describe_moment()
    then = record["origins"].get("runs", {})
    is_same = not now["dirty"] and all(then.get(key) == now[key] for key in ("commit", "dirty"))
    return list(record["results"]["runs"]) if is_same else []


def _measure(way: str, seed: int, generations: int = BASE.generations) -> dict[str, Any]:
    simulate = WAYS[way]()
    began = time.process_time()
    found = ev.evolve(
        ev.EvolutionConfig(
            arena=BASE.arena,
            seed=max(seed, 0),
            population_size=BASE.population_size,
            generations=generations,
        ),
        simulate=simulate,
    )
    seconds = time.process_time() - began
    champion = found.champion
    held = 0
    if champion is not None and seed >= 0:
        held = ev.judge(champion, "truth", TRIALS, JUDGING_SEED + seed).successes
    return {
        "way": way,
        "seed": seed,
        "cpu_seconds": round(seconds, 2),
        "genotypes": int(found.history["evaluations"][-1]),
        "sampled_seconds": round(simulate.tried.seconds, 1),
        "spared": simulate.tried.spared,
        "confirmed": bool(found.is_solved),
        "held_in_truth": held,
    }


def summarize(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return, for each way, how many times faster it is than full trials in the median of the seeds, and what holds."""
    full = {row["seed"]: row for row in rows if row["way"] == FULL}
    summary = {}
    for way in {row["way"]: None for row in rows}:
        mine = [row for row in rows if row["way"] == way and row["seed"] in full]
        if not mine:
            continue
        ratios = [full[row["seed"]]["cpu_seconds"] / row["cpu_seconds"] for row in mine]
        summary[way] = {
            "seeds": len(mine),
            "cpu_seconds": float(np.median([row["cpu_seconds"] for row in mine])),
            "times_faster": float(np.median(ratios)),
            "quartiles": [float(q) for q in np.percentile(ratios, (25, 75))],
            "confirmed": sum(row["confirmed"] for row in mine),
            "held": sum(row["confirmed"] and row["held_in_truth"] >= PASS for row in mine),
        }
    return summary


def main() -> None:
    """Parse the command line and measure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="the first seed alone")
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--ways", nargs="+", choices=tuple(WAYS), default=list(WAYS))
    options = parser.parse_args()
    run(options.quick, options.seeds, options.ways)


if __name__ == "__main__":
    main()
