"""How searches for bodies score on the landscape, against its known optimum, with a tenth of the exhaustive budget."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from evolution._src.body_search.config import ALGORITHMS, BodiesConfig
from evolution._src.landscape.reliability import find_goal
from evolution._src.landscape.replay import Replay, measure_area, replay, summarize
from evolution._src.landscape.table import Landscape
from reconstruction._src.base.extras import find_missing

IN_RUNGS = ("freeze_thaw", "niches", "surrogate", "halving")
"""Searches in which bodies learn in rungs; see `find_rungs`."""
RIVALS = ("random", "genetic", "map_elites")
"""Searches that the best one is compared with."""
NEED_RIBS = ("map_elites", "cma_mae")
BUDGET = 0.1
"""Share of the exhaustive search's simulated time."""
SMALL = BodiesConfig(children=3, population_size=6)
"""A tenth of the budget is about 17 bodies: generations of nine children would be two."""


def list_searches() -> list[str]:
    """Return the searches that can be replayed here: archives need an extra."""
    return [name for name in ALGORITHMS if name not in NEED_RIBS or not find_missing("ribs")]


def score_searches(
    table: Landscape, seeds: Iterable[int], budget: float = BUDGET, bodies: BodiesConfig = SMALL
) -> dict[str, dict[str, Any]]:
    """Replay every search on every task.

    Args:
        table: the landscape.
        seeds: seeds of the searches.
        budget: share of the exhaustive search's simulated time.
        bodies: parameters of all searches.

    Returns:
        For each task its optimum, median and goal (95 % of the way from the median to the optimum), the budget [s], of
        how many rivals the area under the curve is smaller than that of the default search, with an interval of its
        own, and for each search: seeds that reached the goal, mean area under the curve with its 95 % interval, and the
        mean best fitness on the scan and in the truth.
    """
    seeds = list(seeds)
    scores = {}
    for task, name in enumerate(table.tasks):
        limit = budget * float(table.seconds[task].sum())
        rows = {each: _score(table, name, each, seeds, limit, bodies) for each in list_searches()}
        scores[name] = {
            "optimum": float(table.fitness[task].max()),
            "median": float(np.median(table.fitness[task])),
            "goal": find_goal(table, task),
            "budget": limit,
            "seeds": len(seeds),
            "rivals": len(RIVALS),
            "beaten": sum(
                rows[each]["area_high"] < rows[BodiesConfig.algorithm]["area_low"]
                for each in RIVALS
                if each in rows
            ),
            "searches": rows,
        }
    return scores


def run_search(
    table: Landscape, task: str, name: str, seed: int, limit: float, bodies: BodiesConfig
) -> Replay:
    """Replay one search in its rungs."""
    return replay(table, task, name, seed, limit, bodies, find_rungs(name, table.config.generations[-1]))


def find_rungs(name: str, last: int) -> tuple[int, ...]:
    """Return the generations at which learning pauses in a search.

    The first rung of `IN_RUNGS` is the start genotype alone, one trial. In "freeze_thaw" the second one is a
    generation of CMA-ES, which says much more of what a body will know.

    Args:
        name: one of `ALGORITHMS`.
        last: generations that a body learns in all.
    """
    early = {"freeze_thaw": {1, 2}}.get(name, {1}) if name in IN_RUNGS else set()
    return tuple(sorted({each for each in early if each < last} | {last}))


def _score(
    table: Landscape, task: str, name: str, seeds: list[int], limit: float, bodies: BodiesConfig
) -> dict[str, Any]:
    place = table.find_task(task)
    goal, lowest = find_goal(table, place), float(table.fitness[place].min())
    highest = float(table.fitness[place].max())
    runs = [run_search(table, task, name, seed, limit, bodies) for seed in seeds]
    area = summarize([measure_area(run, limit, lowest, highest) for run in runs])
    best = [float(run.best[-1]) for run in runs]
    return {
        "reached": sum(value >= goal for value in best),
        "area": area[0],
        "area_low": area[1],
        "area_high": area[2],
        "best": float(np.mean([max(value, lowest) for value in best])),
        "truth": float(np.mean([max(float(run.truth[-1]), lowest) for run in runs])),
    }
