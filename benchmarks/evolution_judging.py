"""The final test: champions judged in the true arena with seeds that were never used before.

A rule that was tuned on the trials of a final test is tuned to their seeds. Therefore the seed of a final test is drawn
when the row is made, or judged again, and stored with it. A row stores its champions, so that it can be judged again
without evolving.
"""

import json
import secrets
from collections.abc import Callable, Container
from pathlib import Path
from typing import Any, Protocol

from benchmarks.report import describe_moment
from evolution._src.champions.playback import judge
from evolution._src.search.validation import Champion
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.loading import load_arena

TRIALS = 20
"""Trials in the true arena, which the search never saw."""
PASS = 18
"""Number of these that must succeed for a champion to be robust."""
SPENT = ("genotypes", "wall_seconds", "cpu_seconds")
"""Fields of the cost up to the moment when a champion was found."""

Row = dict[str, Any]


class RowStore(Protocol):
    """Storage of rows."""

    @property
    def content(self) -> dict[str, Any]: ...
    def find_runs(self, part: str) -> list[Row]: ...
    def find_judging_seeds(self) -> set[int]: ...
    def put_runs(self, part: str, rows: list[Row]) -> None: ...


def describe_champion(champion: Champion, spent: Row) -> Row:
    """Return what a row stores of a champion and its cost."""
    return {"champion": champion.as_dict() | {"arena": Path(champion.arena).name}, **spent}


def judge_row(row: Row, used: Container[int], workers: int) -> Row:
    """Return a row with the final test of its `champions` in its true `course`, with a newly drawn seed.

    Args:
        row: with `champions` in the order found, the run's own last; `course`; `validated`.
        used: seeds of earlier final tests.
        workers: threads.

    Returns:
        The row and `judging_seed`, `judged` (day and commit), `held_in_truth`, `gap_of_20` (how much better
        validation was, in trials of 20; None without any) and `holds_from_*` (the cost up to the champion from which on
        all champions are robust, which the run itself cannot know).
    """
    seed = _draw_seed(used)
    truth = load_arena("truth", Course(**row["course"]))
    held, first = None, dict.fromkeys(f"holds_from_{name}" for name in SPENT)
    for found in reversed(row["champions"]):
        champion = Champion.from_dict(found["champion"])
        successes = judge(champion, truth, TRIALS, seed, workers=workers).successes
        held = successes if held is None else held
        if successes < PASS:
            break
        first = {f"holds_from_{name}": found[name] for name in SPENT}
    successes, trials = row["validated"]
    gap = round(TRIALS * successes / trials - held, 2) if trials and held is not None else None
    judgement = {"judging_seed": seed, "judged": describe_moment(), "held_in_truth": held, "gap_of_20": gap}
    return row | judgement | first


def judge_again(
    results: RowStore, only: Container[str], report: Callable[[str], None], workers: int = 2
) -> None:
    """Judge every stored champion again; earlier results remain in the row as `judged_before`.

    Args:
        results: the storage of the rows.
        only: names of parts, "models" for all "models/..."; empty means all.
        report: called with each result as text.
        workers: threads.
    """
    judged: dict[str, Row] = {}  # the same run may be in two parts
    for part in results.content:
        rows = results.find_runs(part)
        if not rows or (only and part.split("/")[0] not in only):
            continue
        for row in rows:
            key = json.dumps(row, sort_keys=True)
            if "champions" not in row:
                report(f"{part}, seed {row['seed']}: its champion was not stored; evolve again to judge it")
            elif key not in judged:
                used = results.find_judging_seeds() | {other["judging_seed"] for other in judged.values()}
                judged[key] = judge_row(_keep_judgement(row), used, workers)
                report(
                    f"{part}, seed {row['seed']}: {judged[key]['held_in_truth']}, was {row['held_in_truth']}"
                )
        results.put_runs(part, [judged.get(json.dumps(row, sort_keys=True), row) for row in rows])


def _keep_judgement(row: Row) -> Row:
    last = {name: row[name] for name in ("judging_seed", "held_in_truth", "judged")}
    return row | {"judged_before": [*row.get("judged_before", []), last]}


def _draw_seed(used: Container[int]) -> int:
    seed = secrets.randbits(63)
    while seed in used:
        seed = secrets.randbits(63)
    return seed
