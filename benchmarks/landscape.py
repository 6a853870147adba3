"""The landscape of bodies: all bodies of up to five modules learn three tasks; searches are replayed on the table.

    python -m benchmarks.landscape [--quick] [--only map longer again replays held_out second_held_out real]
        [--folder FOLDER] [--out FOLDER] [--workers N]

`map` makes the table, `assets/landscape`: scanned arenas, learning, the judgment in the truth. It is stored in the
folder after every twelve bodies and goes on there when it is called again. `longer` lets the fittest 20 bodies of each
task try ten times as many genotypes. `again` makes the places and some random bodies of the published table from
nothing, and counts those whose bits are all equal. `replays` measures the searches on the table.
`held_out` makes tables of three other places, and measures the searches there; the default search was developed on
these, too, and `second_held_out` is the same for three places on which nothing was developed.
`real` searches by physics instead of a look-up, in a tenth of the exhaustive time, with learning of its own.
"""

import argparse
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.evolution_runs import Results
from benchmarks.report import describe_versions
from evolution._src.body_search.loop import evolve_bodies
from evolution._src.landscape.assembly import assemble
from evolution._src.landscape.config import (
    HELD_OUT_TASKS,
    SECOND_HELD_OUT_TASKS,
    TASKS,
    LandscapeConfig,
    make_search,
)
from evolution._src.landscape.judging import KINDS, judge_bodies
from evolution._src.landscape.longer import COUNT, TIMES, describe_longer, learn_longer, save_longer
from evolution._src.landscape.making import let_bodies_learn
from evolution._src.landscape.places import find_published_arena, save_places
from evolution._src.landscape.reliability import describe_reliability, find_goal
from evolution._src.landscape.remaking import draw_places, find_differences
from evolution._src.landscape.scores import BUDGET, SMALL, find_rungs, score_searches
from evolution._src.landscape.table import Landscape, load_landscape
from evolution._src.search.provenance import find_revision

PARTS = ("map", "longer", "again", "replays", "held_out", "second_held_out", "real")
HELD_OUT = {"held_out": HELD_OUT_TASKS, "second_held_out": SECOND_HELD_OUT_TASKS}
FOLDER = Path("runs/landscape")
OUT = Path(__file__).parents[1] / "assets" / "landscape"
COMMAND = "python -m benchmarks.landscape --only map"
SEEDS = 10
MAX_ITERATIONS = 1000
"""More than the time allows."""
REAL_SEEDS = 5
REAL_SEARCHES = ("freeze_thaw", "niches")
AGAIN = 12
"""Random bodies that are made again."""


def run(
    quick: bool = False,
    only: tuple[str, ...] = (),
    folder: Path | None = None,
    out: Path | None = None,
    workers: int = 1,
    largest: int | None = None,
    tasks: tuple[str, ...] = tuple(TASKS),
    kinds: tuple[str, ...] = KINDS,
) -> dict[str, Any]:
    """Make the table and measure searches on it.

    Args:
        quick: bodies of up to two modules, into the folder of runs.
        only: names of the parts; empty for all.
        folder: where what was learned is kept.
        out: where the table goes; None for `assets/landscape`.
        workers: number of threads; they change nothing but the time.
        largest: largest number of modules; None: five.
        tasks: names of the tasks.
        kinds: how learned genotypes are tried again, see `judge_bodies`.
    """
    results = Results("landscape")
    folder = folder or FOLDER / ("quick" if quick else "whole")
    out = out or (folder / "table" if quick else OUT)
    default = 2 if quick else LandscapeConfig().largest
    if not only or "map" in only:
        table = make_map(LandscapeConfig(largest=largest or default), folder, workers, tasks, kinds)
        table.save(out)
        results.put("map", describe_reliability(table))
    if not only or "longer" in only:
        make_longer(load_landscape(out), folder, out, workers, results, count=2 if quick else COUNT)
    if not only or "again" in only:
        published = load_landscape(OUT if quick else out)
        with TemporaryDirectory() as temporary:
            results.put("again", make_again(published, Path(temporary), workers, 2 if quick else AGAIN))
    if not only or "replays" in only:
        table = load_landscape(out)
        results.put("map", describe_reliability(table))
        _score(table, "replays of", results, quick)
    for part, others in HELD_OUT.items():
        if not only or part in only:
            config = LandscapeConfig(largest=largest or default)
            table = make_held_out(config, folder / part, tuple(others), workers)
            _score(table, "held out:", results, quick)
    if not only or "real" in only:
        table = load_landscape(out)
        for task, name in product(table.tasks, REAL_SEARCHES):
            found = search_really(table, task, name, range(1 if quick else REAL_SEEDS), workers)
            results.put(f"real {name} of {task}", found)
            print(task, name, found, flush=True)
    return results.content


def _score(table: Landscape, title: str, results: Results, quick: bool) -> None:
    for task, rows in score_searches(table, range(2 if quick else SEEDS)).items():
        results.put(f"{title} {task}", rows)
        for name, row in rows["searches"].items():
            print(task, name, row, flush=True)


def make_held_out(config: LandscapeConfig, folder: Path, tasks: tuple[str, ...], workers: int) -> Landscape:
    """Let all bodies learn in places on which no search was developed; nothing is judged in the truth."""
    arenas, _ = save_places(folder / "arenas", tasks)
    runs = let_bodies_learn(config, arenas, folder / "runs", workers)
    return assemble(config, runs, {name: {} for name in tasks}, {})


def make_map(
    config: LandscapeConfig,
    folder: Path,
    workers: int = 1,
    tasks: tuple[str, ...] = tuple(TASKS),
    kinds: tuple[str, ...] = KINDS,
) -> Landscape:
    """Let all bodies learn, judge them, and return the table; what the folder contains is not computed again."""

    def show(text: str, share: float) -> None:
        print(f"{text} ({share:.0%})", flush=True)

    arenas, truths = save_places(folder / "arenas", tasks, show)
    runs = let_bodies_learn(config, arenas, folder / "runs", workers, progress=show)
    judged = judge_bodies(config, runs, truths, folder, workers, progress=show, kinds=kinds)
    revision = find_revision()
    provenance = {
        "command": f"{COMMAND} --largest {config.largest} --tasks {' '.join(tasks)} --judge {' '.join(kinds)}",
        "commit": revision.commit if revision else None,
        "versions": describe_versions(),
        "tasks": {name: dict(TASKS[name]) for name in tasks},
    }
    return assemble(config, runs, judged, provenance)


def make_longer(
    table: Landscape, folder: Path, out: Path, workers: int, results: Results, count: int = COUNT
) -> None:
    """Let the fittest bodies of the table learn longer, and store what they learned beside it."""

    def show(text: str, share: float) -> None:
        print(f"{text} ({share:.0%})", flush=True)

    times = 2 if count < COUNT else TIMES
    arenas, truths = save_places(folder / "arenas", table.tasks, show)
    found = learn_longer(table, arenas, truths, folder / "longer", times, count, workers, progress=show)
    save_longer(found, table, times, out)
    for name, row in describe_longer(found, table).items():
        results.put(f"longer of {name}", {"times": times} | row)
        print(name, row, flush=True)


def make_again(table: Landscape, folder: Path, workers: int, count: int) -> dict[str, Any]:
    """Make the places and some bodies of a table from nothing, and return how many are equal to the bit."""

    def show(text: str, share: float) -> None:
        print(f"{text} ({share:.0%})", flush=True)

    arenas, truths = save_places(folder, table.tasks, show)
    places = draw_places(table, count)
    found = {
        name: find_differences(table, name, arenas[name], truths[name], places, workers)
        for name in table.tasks
    }
    return {
        "of": len(table.tasks) * count,
        "same": sum(not each for row in found.values() for each in row.values()),
        "differ": {
            f"{name} {table.bodies[place].text}": list(names)
            for name, row in found.items()
            for place, names in row.items()
            if names
        },
        "places": len(arenas),
        "same_places": sum(_is_same(path, find_published_arena(name)) for name, path in arenas.items()),
    }


def search_really(
    table: Landscape, task: str, name: str, seeds: Iterable[int], workers: int
) -> dict[str, Any]:
    """Search for a body by physics, and return what each seed found.

    Args:
        table: says how much time is a tenth, and which body is the best one.
        task: of the table.
        name: of the search.
        seeds: of the search and of what bodies learn.
        workers: number of threads; they change nothing but the time.
    """
    place = table.find_task(task)
    goal, limit = find_goal(table, place), BUDGET * float(table.seconds[place].sum())
    base = make_search(table.config, task, find_published_arena(task), workers=workers)
    rungs = find_rungs(name, table.config.generations[-1])
    rows = []
    for seed in seeds:
        run = evolve_bodies(
            replace(
                base,
                seed=seed,
                bodies=replace(SMALL, algorithm=name, largest=table.config.largest, max_seconds=limit),
                learning=replace(base.learning, rungs=rungs, is_examined_early=False),
                iterations=MAX_ITERATIONS,
            )
        )
        last = [lesson for lesson in run.record.lessons if lesson.rung == len(rungs) - 1]
        best = max(last, key=lambda each: each.fitness)
        rows.append(
            {
                "seed": seed,
                "body": best.pupil.body.text,
                "is_optimum": best.pupil.body == table.bodies[int(table.fitness[place].argmax())],
                "fitness": best.fitness,
                "learned": len(last),
                "share": run.record.seconds / limit * BUDGET,
            }
        )
    reached = sum(row["fitness"] >= goal for row in rows)
    optima = sum(row["is_optimum"] for row in rows)
    return {"reached": reached, "optima": optima, "of": len(rows), "goal": goal, "runs": rows}


def _is_same(first: Path, second: Path) -> bool:
    """Return whether two folders contain the same files."""
    contents = [
        {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (first, second)
    ]
    return contents[0] == contents[1]


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.landscape",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="bodies of up to two modules")
    parser.add_argument("--only", nargs="*", default=[], choices=PARTS, help="parts to run")
    parser.add_argument("--folder", type=Path, help="where what was learned is kept")
    parser.add_argument("--out", type=Path, help="where the table goes (default: assets/landscape)")
    parser.add_argument("--workers", type=int, default=1, help="threads; they change nothing but the time")
    parser.add_argument("--largest", type=int, help="largest number of modules (default: 5)")
    parser.add_argument("--tasks", nargs="*", default=list(TASKS), choices=TASKS, help="tasks of the map")
    parser.add_argument("--judge", nargs="*", default=list(KINDS), choices=KINDS, help="kinds of judgments")
    options = parser.parse_args()
    run(
        options.quick,
        tuple(options.only),
        options.folder,
        options.out,
        options.workers,
        options.largest,
        tuple(options.tasks),
        tuple(options.judge),
    )


if __name__ == "__main__":
    main()
