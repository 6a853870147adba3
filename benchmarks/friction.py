"""Friction of the ground: how well robots estimate it from their slip, and what champions gain by it.

Run as `python -m benchmarks.friction [--quick] [--only patches|champions]`.

"patches": courses of random sizes with patches of 0.3 to 0.9, other courses than those that the estimator was made
with. Docked Scouts drive lanes over each; every true patch, and the ground outside of all, on which they drove 1 m or
more is judged: error of the map, and whether the 95 % interval holds the truth.

"champions": a course with ice on three fifths of a ramp. It is surveyed, reconstructed and made an arena twice, with
the friction that the robots felt and with one friction for all; champions of either are tried in the true course.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.material.friction_champions import evolve_champion, find_interval, make_models
from benchmarks.material.friction_courses import (
    PatchRow,
    draw_course,
    feel_course,
    judge_patches,
    judge_places,
)
from benchmarks.report import load_record, write_results

COURSES = 12
SEEDS = 5
TRIALS = 40
BAR = 0.05


def run(quick: bool = False, only: str | None = None) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: two courses and one seed.
        only: the one part to measure.
    """
    if only in (None, "patches"):
        write_results("friction", {"patches": measure_patches(range(2 if quick else COURSES))})
    if only in (None, "champions"):
        measure_champions(range(1 if quick else SEEDS), 10 if quick else TRIALS)
    return load_record("friction")["results"]


def measure_patches(seeds: range) -> dict[str, Any]:
    """Return errors and coverage over all patches of some courses."""
    rows: list[PatchRow] = []
    places = []
    for seed in seeds:
        course = draw_course(seed)
        readings, felt = feel_course(course, seed)
        rows += judge_patches(course, seed, readings, felt)
        places.append(judge_places(course, readings, felt))
        print(
            seed,
            *(f"{row.truth:.3f}:{row.error:+.3f}±{row.half_width:.3f}" for row in rows if row.course == seed),
            flush=True,
        )
    errors = np.abs([row.error for row in rows])
    return {
        "courses": len(seeds),
        "patches": len(rows),
        "within_bar": int((errors <= BAR).sum()),
        "rms": float(np.sqrt((errors**2).mean())),
        "worst": float(errors.max()),
        "covered": int(sum(row.is_covered for row in rows)),
        "covered_share": float(np.mean([row.is_covered for row in rows])),
        "half_width": float(np.mean([row.half_width for row in rows])),
        "places_within": float(np.mean([place["within"] for place in places])),
        "rows": [row._asdict() | {"error": row.error} for row in rows],
    }


def measure_champions(seeds: range, trials: int) -> None:
    """Evolve on either arena, try the champions in the true course, and write each run at once."""
    with tempfile.TemporaryDirectory() as folder:
        models = make_models(Path(folder))
        runs: dict[str, list[dict[str, Any]]] = {"felt": [], "one": []}
        for seed in seeds:
            for name, rows in runs.items():
                rows.append(evolve_champion(models, name, seed, trials))
                print(name, rows[-1], flush=True)
            write_results("friction", {"champions": summarize(runs) | {"map": models.map}})


def summarize(runs: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    """Return successes in the truth with their 95 % intervals (Wilson)."""
    summary: dict[str, Any] = {}
    for name, rows in runs.items():
        successes, trials = (sum(row["truth"][k] for row in rows) for k in (0, 1))
        low, high = find_interval(successes, trials)
        summary[name] = {"successes": successes, "trials": trials, "low": low, "high": high, "runs": rows}
    return summary | {"is_disjoint": summary["felt"]["low"] > summary["one"]["high"]}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="two courses and one seed")
    parser.add_argument("--only", choices=("patches", "champions"), help="one part")
    options = parser.parse_args()
    run(options.quick, options.only)
