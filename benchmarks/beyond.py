"""Beyond the map of small bodies: bodies of up to twelve modules against snakes, judged in the exact place.

    python -m benchmarks.beyond [--quick] [--places stairs pit rubble] [--seeds 0 1 2 3 4] [--again] [--longer]

For each place and seed a body is searched on the scan, and the best one goes on learning; then the controller of a row
of as many modules is evolved, in as much simulated time or more. Each row is stored at once with its commit, and is
measured again with `--again` alone. `--longer` lets the champions of the rows train on, under harder conditions.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from benchmarks.evolution_runs import Results
from benchmarks.material.beyond import (
    PLACES,
    Found,
    find_arenas,
    make_plain_snakes,
    search_body,
    search_snake,
)
from benchmarks.material.longer_training import train_longer
from benchmarks.report import describe_moment
from evolution._src.backends.scoring import Scoring, compute_fitness
from evolution._src.champions.playback import judge

SEEDS = tuple(range(5))
TRIALS = 20
PASS = 18
JUDGING_SEED = 9_000_000
"""Added to the seed of a run: conditions of the trials in the exact place."""
LONGER_SEED = 500_000
"""Added to it for champions that have trained on: they are judged by trials that nothing was known of."""
QUICK_SECONDS = 60.0
Row = dict[str, Any]


def run(
    quick: bool = False,
    places: Sequence[str] = tuple(PLACES),
    seeds: Sequence[int] = SEEDS,
    results: Results | None = None,
    again: bool = False,
) -> dict[str, Any]:
    """Measure what is missing, write and return everything.

    Args:
        quick: searches of a minute of simulated time.
        places: names of places.
        seeds: of the searches.
        results: where the figures go.
        again: whether rows that exist are replaced.
    """
    results = results or Results("beyond")
    for name in places:
        for seed in seeds:
            if again or not _has_row(results, name, seed):
                _put_row(results, name, measure(name, seed, quick), summarize)
    return results.content


def measure(name: str, seed: int, quick: bool = False) -> Row:
    """Search for a body and for the controller of the snake, and judge both in the exact place."""
    place = PLACES[name]
    if quick:
        place = replace(place, seconds=QUICK_SECONDS)
    scanned, exact = find_arenas(name)
    began = time.process_time()
    body = search_body(place, scanned, seed)
    body_cpu = time.process_time() - began
    seconds = max(place.seconds, body.seconds)
    snake = search_snake(place, scanned, seed, body.figures["modules"], seconds)
    judged = {"body": body.champion, "snake": snake.champion, **make_plain_snakes(snake.champion, seed)}
    scores = {who: _judge(champion, exact, seed) for who, champion in judged.items()}
    return {
        "seed": seed,
        **body.figures,
        **{
            f"{who}_{key}": value
            for who, found in (("body", body), ("snake", snake))
            for key, value in _tell(found)
        },
        **{f"{who}_{key}": value for who, score in scores.items() for key, value in score.items()},
        "body_cpu_seconds": round(body_cpu, 1),
        "cpu_seconds": round(time.process_time() - began, 1),
        "origin": describe_moment(),
    }


def run_longer(
    quick: bool = False,
    places: Sequence[str] = tuple(PLACES),
    seeds: Sequence[int] = SEEDS,
    results: Results | None = None,
    again: bool = False,
) -> dict[str, Any]:
    """Let the champions of the rows that are stored train on, and judge them under conditions of their own."""
    results = results or Results("beyond")
    for name in places:
        part = f"longer {name}"
        for found in results.find_runs(name):
            if found["seed"] in seeds and (again or not _has_row(results, part, found["seed"])):
                _put_row(results, part, measure_longer(name, found, quick), summarize_longer)
    return results.content


def _has_row(results: Results, part: str, seed: int) -> bool:
    return any(row["seed"] == seed for row in results.find_runs(part))


def _put_row(
    results: Results, part: str, row: Row, describe: Callable[[Sequence[Row]], dict[str, Any]]
) -> None:
    """Store a row with those of other seeds, and what describes all of them."""
    rows = [each for each in results.find_runs(part) if each["seed"] != row["seed"]]
    rows = sorted([*rows, row], key=lambda each: each["seed"])
    results.put(part, {**describe(rows), "runs": rows})
    print(part, row, flush=True)


def measure_longer(name: str, found: Row, quick: bool = False) -> Row:
    """Let the champion of a row train on, and judge it in the exact place."""
    place = PLACES[name]
    if quick:
        place = replace(place, seconds=QUICK_SECONDS)
    scanned, exact = find_arenas(name)
    began = time.process_time()
    trained = train_longer(place, str(scanned), found)
    return {
        "seed": found["seed"],
        "genome": found["genome"],
        **dict(_tell(trained)),
        **_judge(trained.champion, exact, LONGER_SEED + found["seed"]),
        "cpu_seconds": round(time.process_time() - began, 1),
        "origin": describe_moment(),
    }


def _tell(found: Found) -> list[tuple[str, Any]]:
    champion = found.champion
    return [
        ("seconds", round(found.seconds, 1)),
        ("confirmed", [champion.successes, champion.trials]),
        ("genes", dict(zip(champion.names, champion.genotype, strict=True))),
    ]


def _judge(champion: Any, exact: Any, seed: int) -> dict[str, float]:
    outcome = judge(champion, exact, TRIALS, JUDGING_SEED + seed)
    fitness = compute_fitness(Scoring(module=0.0), outcome, champion.body.find_organism())
    return {"successes": outcome.successes, "fitness": round(fitness, 3)}


def summarize(rows: Sequence[Row]) -> dict[str, Any]:
    """Return how many champions hold, and in how many seeds the evolved body is better than the best snake.

    Better: more successes of 20 in the exact place than the evolved snake and the snake without control have; with
    equal successes a higher fitness. An evolved body that is a row itself does not count as better.
    """
    return {
        "of": len(rows),
        "hold": sum(row["body_successes"] >= PASS for row in rows),
        "snakes_hold": sum(_find_best_snake(row)[0] >= PASS for row in rows),
        "better": sum(
            not row["is_row"] and (row["body_successes"], row["body_fitness"]) > _find_best_snake(row)
            for row in rows
        ),
        "rows": sum(row["is_row"] for row in rows),
    }


def summarize_longer(rows: Sequence[Row]) -> dict[str, Any]:
    """Return how many champions hold that have trained on."""
    return {"of": len(rows), "hold": sum(row["successes"] >= PASS for row in rows)}


def _find_best_snake(row: Row) -> tuple[int, float]:
    return max((row[f"{who}_successes"], row[f"{who}_fitness"]) for who in ("snake", "zero", "random"))


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.beyond",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="searches of a minute of simulated time")
    parser.add_argument("--places", nargs="+", default=list(PLACES), choices=PLACES)
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--again", action="store_true", help="replace rows that exist")
    parser.add_argument("--longer", action="store_true", help="let the champions of the rows train on")
    options = parser.parse_args()
    measure_them = run_longer if options.longer else run
    measure_them(options.quick, options.places, options.seeds, again=options.again)


if __name__ == "__main__":
    main()
