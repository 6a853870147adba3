"""Runs of evolution for the benchmark: what is measured of each, and a file of results that grows run by run."""

import json
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import RESULTS, write_results
from evolution.cmaes import evolve
from evolution.config import EvolutionConfig
from evolution.playback import judge
from evolution.record import SAMPLE
from evolution.run import Run
from evolution.validation import Champion, find_candidates
from reconstruction.reconstruct import reconstruct
from reconstruction.scans.preprocess import preprocess, thin
from symbrion_gym.arenas.arena import Arena, load_arena, make_arena
from symbrion_gym.arenas.course import Course
from symbrion_gym.arenas.ready_made import SPACING
from symbrion_gym.sensing.survey import survey

TRIALS = 20
"""Trials in the true arena, which the search never saw."""
PASS = 18
"""So many of them must hold."""

Row = dict[str, Any]


class Results:
    """The file of results; what is measured again replaces its own part only.

    Args:
        name: of the file in `benchmarks/results`.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    @property
    def content(self) -> dict[str, Any]:
        """What the file holds now; another process may have added to it."""
        path = RESULTS / f"{self._name}.json"
        return json.loads(path.read_text())["results"] if path.exists() else {}

    def put(self, part: str, figures: dict[str, Any]) -> None:
        """Write a part that is no table of runs."""
        write_results(self._name, self.content | {part: figures})

    def add_run(self, part: str, row: Row) -> None:
        """Write a run; one of the same seed is replaced."""
        rows = [other for other in self.find_runs(part) if other["seed"] != row["seed"]]
        rows = sorted([*rows, row], key=lambda each: each["seed"])
        self.put(part, {**summarise(rows), "runs": rows})

    def find_runs(self, part: str) -> list[Row]:
        """Return the runs of a part."""
        return self.content.get(part, {}).get("runs", [])


def measure_runs(
    results: Results,
    part: str,
    config: EvolutionConfig,
    seeds: Iterable[int],
    say: Callable[[str], None],
    course: Course | None = None,
) -> list[Row]:
    """Evolve once for each seed, judge in truth, and keep each row as soon as it is known."""
    for seed in seeds:
        row = measure_run(replace(config, seed=seed), course)
        results.add_run(part, row)
        say(f"{part}: " + ", ".join(f"{key} {value}" for key, value in row.items()))
    return results.find_runs(part)


def measure_run(config: EvolutionConfig, course: Course | None = None) -> Row:
    """Evolve, judge in truth, and return figures of both.

    Args:
        config: of the run.
        course: the true one, where it is not the usual one.
    """
    clock = _ChampionClock()
    load = os.getloadavg()[0]
    run = evolve(config, on_generation=clock)
    seconds, cpu_seconds = clock.read()
    assert run.champion is not None
    truth = load_arena("truth", course)
    held = judge(run.champion, truth, TRIALS, 10_000 + config.seed, workers=config.workers).successes
    return {
        "seed": config.seed,
        "held_in_truth": held,
        "genotypes": int(run.history["evaluations"][-1]),
        "trials": int(run.history["trials"][-1]),
        "restarts": int(run.history["restarts"][-1]),
        "wall_seconds": round(seconds, 1),
        "cpu_seconds": round(cpu_seconds, 1),
        "load": round(load, 1),
        "modules": run.champion.modules,
        "validated": [run.champion.successes, run.champion.trials],
        "gap_of_20": _find_gap(run, held),
        **clock.find_first_to_hold(truth, 10_000 + config.seed, config.workers),
        **(_describe_shorter(run, run.champion.modules) if config.body_lengths else {}),
    }


class _ChampionClock:
    """What had been spent when a run found each of its champions."""

    def __init__(self) -> None:
        self._began, self._cpu_began = time.perf_counter(), time.process_time()
        self._found: list[tuple[Champion, Row]] = []

    def read(self) -> tuple[float, float]:
        """Return wall and processor seconds so far."""
        return time.perf_counter() - self._began, time.process_time() - self._cpu_began

    def __call__(self, run: Run) -> None:
        """Note the champion after a generation, if it is a new one."""
        if run.champion is None or (self._found and self._found[-1][0].genotype == run.champion.genotype):
            return
        wall_seconds, cpu_seconds = self.read()
        spent = {
            "holds_from_genotypes": int(run.history["evaluations"][-1]),
            "holds_from_wall_seconds": round(wall_seconds, 1),
            "holds_from_cpu_seconds": round(cpu_seconds, 1),
        }
        self._found.append((run.champion, spent))

    def find_first_to_hold(self, truth: Arena, seed: int, workers: int) -> Row:
        """Return what had been spent when the champion was found from which on every one holds in truth.

        The run itself cannot know: it goes on until fresh trials in its own arena confirm a champion.
        """
        first: Row = dict.fromkeys(
            ("holds_from_genotypes", "holds_from_wall_seconds", "holds_from_cpu_seconds")
        )
        for champion, spent in reversed(self._found):
            if judge(champion, truth, TRIALS, seed, workers=workers).successes < PASS:
                break
            first = spent
        return first


def _describe_shorter(run: Run, modules: int) -> Row:
    """Return how many genotypes of bodies shorter than the champion's were tried, and how well the best did."""
    shorter = [entry for entry in run.record.entries if entry.modules < modules]
    samples = [entry for entry in shorter if entry.kind == SAMPLE]
    counts = [(entry.outcome.successes, entry.outcome.trials) for entry in find_candidates(shorter)]
    best = max(counts, key=lambda count: (count[0] + 1) / (count[1] + 2), default=None)
    return {"shorter_genotypes": len(samples), "best_shorter": list(best) if best else None}


def _find_gap(run: Run, held: int) -> float | None:
    """Return how much better the validation was than the final test, in trials of 20."""
    champion = run.champion
    if champion is None or not champion.trials:
        return None
    return round(TRIALS * champion.successes / champion.trials - held, 2)


def summarise(rows: list[Row]) -> dict[str, Any]:
    """Return what a table of runs comes to."""
    gaps = [row["gap_of_20"] for row in rows if row["gap_of_20"] is not None]
    medians = {
        f"median_{name}": float(np.median([row[name] for row in rows]))
        for name in ("genotypes", "wall_seconds", "cpu_seconds", "held_in_truth")
    }
    holding = [row for row in rows if row.get("holds_from_genotypes") is not None]
    for name in ("genotypes", "cpu_seconds") if holding else ():
        medians[f"median_holds_from_{name}"] = float(
            np.median([row[f"holds_from_{name}"] for row in holding])
        )
    return {
        "champions_that_hold": sum(row["held_in_truth"] >= PASS for row in rows),
        "of": len(rows),
        **medians,
        "mean_gap_of_20": round(float(np.mean(gaps)), 2) if gaps else None,
    }


def make_model(method: str, size: int, folder: Path, course: Course | None = None) -> str:
    """Survey the true arena, grow a network, save the arena made of it; return its folder.

    Args:
        method: "gsrm" or "gg".
        size: units of a gsrm, triangles of a gg.
        folder: where it goes.
        course: the true one; default: the usual one.
    """
    course = course or Course()
    path = folder / f"{method}_{size}_{round(1000 * course.pit)}mm"
    if not path.exists():
        points = thin(preprocess(survey(load_arena("truth", course), seed=0)), SPACING)
        sizes: dict[str, Any] = {"units": size} if method == "gsrm" else {"triangles": size}
        mesh = reconstruct(points, method=method, seed=0, **sizes).mesh
        make_arena(mesh, name=path.name, course=course, seed=0).save(path)
    return str(path)
