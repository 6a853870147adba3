"""How far the landscape can be trusted: the noise of the exam, and the scan against the truth."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from evolution._src.landscape.table import Landscape


def correlate_ranks(first: Float[np.ndarray, " B"], second: Float[np.ndarray, " B"]) -> float:
    """Return Spearman's rank correlation; 0 where one of them does not vary, NaN where one is unknown."""
    from scipy import stats

    if np.isnan([*first, *second]).any():
        return float("nan")
    if np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return 0.0
    return float(stats.spearmanr(first, second).statistic)


def describe_reliability(table: Landscape) -> dict[str, Any]:
    """Return a row for each task.

    Returns:
        For each task: number of bodies, fitness of the best and of the median body, its plan and successes, the
        share of bodies that succeed in all trials of the exam, rank correlation of scan and truth ("truth_rank"), of
        two exams on the scan ("again_rank"), and the mean loss of the exam's best against its second exam.
    """
    rows = {}
    for task, name in enumerate(table.tasks):
        fitness = table.fitness[task]
        best = int(np.argmax(fitness))
        row = {
            "bodies": len(fitness),
            "best": float(fitness[best]),
            "best_body": table.bodies[best].text,
            "best_again": float(table.again_fitness[task, best]),
            "best_truth": float(table.truth_fitness[task, best]),
            "median": float(np.median(fitness)),
            "lowest": float(fitness.min()),
            "solved": float(np.mean(table.successes[task] == table.config.exam_trials)),
            "truth_rank": correlate_ranks(fitness, table.truth_fitness[task]),
            "again_rank": correlate_ranks(fitness, table.again_fitness[task]),
            "truth_difference": float(np.mean(np.abs(fitness - table.truth_fitness[task]))),
            "again_difference": float(np.mean(np.abs(fitness - table.again_fitness[task]))),
            "within_95_percent": int(np.sum(fitness >= find_goal(table, task))),
            "seconds": float(table.seconds[task].sum()),
        }
        unknown = {key for key, value in row.items() if isinstance(value, float) and np.isnan(value)}
        rows[name] = {key: None if key in unknown else value for key, value in row.items()}
    return rows


def find_goal(table: Landscape, task: int, share: float = 0.95) -> float:
    """Return the fitness that is a share of the optimum, counted from the median body.

    Fitness has no zero of its own: 95 % of 1.6 is less than what most bodies have. From the median, a random body is
    at 0 in the middle of its distribution.
    """
    middle, highest = float(np.median(table.fitness[task])), float(table.fitness[task].max())
    return middle + share * (highest - middle)
