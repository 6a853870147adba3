"""Runs of evolution for the benchmark, and the file to which their results are added run by run."""

import os
import time
from collections.abc import Callable, Container, Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmarks.evolution_judging import SPENT, Row, describe_champion, judge_row
from benchmarks.evolution_summary import summarize
from benchmarks.report import describe_moment, load_record, write_results
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.record import SAMPLE
from evolution._src.search.run import Run
from evolution._src.search.validation import Champion, find_candidates
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import preprocess, thin
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.loading import load_arena
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.ready_made import SPACING
from symbrion_gym._src.sensing.survey import survey


class Results:
    """The file of results; a new measurement replaces only its own part.

    Args:
        name: of the file in `benchmarks/results`.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    @property
    def content(self) -> dict[str, Any]:
        """The present content of the file; another process may have added to it."""
        return load_record(self._name)["results"]

    def put(self, part: str, figures: dict[str, Any]) -> None:
        """Write a part that is not a table of runs."""
        write_results(self._name, {part: figures})

    def add_run(self, part: str, row: Row) -> None:
        """Write a run; one of the same seed is replaced."""
        rows = [other for other in self.find_runs(part) if other["seed"] != row["seed"]]
        self.put_runs(part, sorted([*rows, row], key=lambda each: each["seed"]))

    def put_runs(self, part: str, rows: list[Row]) -> None:
        """Write a table of runs with its summary."""
        self.put(part, {**summarize(rows), "runs": rows})

    def find_runs(self, part: str) -> list[Row]:
        """Return the runs of a part."""
        return self.content.get(part, {}).get("runs", [])

    def find_judging_seeds(self) -> set[int]:
        """Return the seeds of all final tests so far."""
        rows = [row for part in self.content for row in self.find_runs(part)]
        judgements = [each for row in rows for each in (row, *row.get("judged_before", []))]
        return {each["judging_seed"] for each in judgements if "judging_seed" in each}


def measure_runs(
    results: Results,
    part: str,
    config: EvolutionConfig,
    seeds: Iterable[int],
    report: Callable[[str], None],
    course: Course | None = None,
) -> list[Row]:
    """Evolve once per seed, judge the champion in the true arena, and write each row at once."""
    for seed in seeds:
        row = measure_run(replace(config, seed=seed), course, results.find_judging_seeds())
        results.add_run(part, row)
        shown = {
            key: value for key, value in row.items() if not isinstance(value, dict) and key != "champions"
        }
        report(f"{part}: " + ", ".join(f"{key} {value}" for key, value in shown.items()))
    return results.find_runs(part)


def measure_run(
    config: EvolutionConfig, course: Course | None = None, used: Container[int] = frozenset()
) -> Row:
    """Evolve, judge the champion in the true arena with a newly drawn seed, and return the figures of both.

    Args:
        config: of the run.
        course: the true one; the default course if None.
        used: seeds of other final tests.
    """
    clock = _ChampionClock()
    load = os.getloadavg()[0]
    run = evolve(config, on_generation=clock)
    seconds, cpu_seconds = clock.read()
    champion = run.champion
    assert champion is not None
    row = {
        "seed": config.seed,
        "genotypes": int(run.history["evaluations"][-1]),
        "trials": int(run.history["trials"][-1]),
        "restarts": int(run.history["restarts"][-1]),
        "wall_seconds": round(seconds, 1),
        "cpu_seconds": round(cpu_seconds, 1),
        "load": round(load, 1),
        "modules": champion.modules,
        "validated": [champion.successes, champion.trials],
        "confirmed": config.validation.is_solved(champion.successes, champion.trials),
        **(_describe_shorter(run, champion.modules) if config.body_lengths else {}),
        "origin": describe_moment(),
        "course": asdict(course or Course()),
        "champions": clock.describe_champions(champion),
    }
    return judge_row(row, used, config.workers)


class _ChampionClock:
    """The cost of a run up to each of its champions."""

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
        spent = (int(run.history["evaluations"][-1]), round(wall_seconds, 1), round(cpu_seconds, 1))
        self._found.append((run.champion, dict(zip(SPENT, spent, strict=True))))

    def describe_champions(self, last: Champion) -> list[Row]:
        """Return the champions in order; the last one with all the fresh trials it had at the end."""
        found = [*self._found[:-1], (last, self._found[-1][1])]
        return [describe_champion(champion, spent) for champion, spent in found]


def _describe_shorter(run: Run, modules: int) -> Row:
    """Return how many genotypes of bodies shorter than the champion's were tried, and how well the best did."""
    shorter = [entry for entry in run.record.entries if entry.modules < modules]
    samples = [entry for entry in shorter if entry.kind == SAMPLE]
    counts = [(entry.outcome.successes, entry.outcome.trials) for entry in find_candidates(shorter)]
    best = max(counts, key=lambda count: (count[0] + 1) / (count[1] + 2), default=None)
    return {"shorter_genotypes": len(samples), "best_shorter": list(best) if best else None}


def make_model(method: str, size: int, folder: Path, course: Course | None = None) -> str:
    """Survey the true arena, reconstruct it, save the resulting arena, and return its folder.

    Args:
        method: "gsrm" or "gg".
        size: units of a gsrm, triangles of a gg.
        folder: where the arena is saved.
        course: the true one; the default course if None.
    """
    course = course or Course()
    path = folder / f"{method}_{size}_{round(1000 * course.pit)}mm"
    if not path.exists():
        points = thin(preprocess(survey(load_arena("truth", course), seed=0)), SPACING)
        sizes: dict[str, Any] = {"units": size} if method == "gsrm" else {"triangles": size}
        mesh = reconstruct(points, method=method, seed=0, **sizes).mesh
        make_arena(mesh, name=path.name, seed=0).save(path)
    return str(path)
