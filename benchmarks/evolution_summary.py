"""Summary of a table of runs. Only a confirmed champion can be robust."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.evolution_judging import PASS, Row

NONE = "-"
"""Placeholder for the mean of no values."""


def is_robust(row: Row) -> bool:
    """Return whether a champion is robust: confirmed by its run, and successful in the true arena."""
    return row["confirmed"] and row["held_in_truth"] >= PASS


def summarize(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the summary of a table of runs, with confirmed and unconfirmed champions separate.

    Costs are medians over all runs; figures of validation and the true arena are those of confirmed champions.
    """
    confirmed, others = _part(rows)
    medians = {
        f"median_{name}": float(np.median([row[name] for row in rows]))
        for name in ("genotypes", "wall_seconds", "cpu_seconds")
    }
    holding = [row for row in rows if is_robust(row) and row.get("holds_from_genotypes") is not None]
    for name in ("genotypes", "cpu_seconds") if holding else ():
        medians[f"median_holds_from_{name}"] = float(
            np.median([row[f"holds_from_{name}"] for row in holding])
        )
    held = [row["held_in_truth"] for row in confirmed]
    return {
        "champions_that_hold": sum(map(is_robust, rows)),
        "of": len(rows),
        "confirmed": len(confirmed),
        "unconfirmed": len(others),
        "unconfirmed_that_hold": sum(row["held_in_truth"] >= PASS for row in others),
        **medians,
        "median_held_in_truth": float(np.median(held)) if held else NONE,
        "mean_gap_of_20": describe_gaps(confirmed)["mean_of_20"],
        "judged_by_drawn_seeds": sum("judging_seed" in row for row in rows),
    }


def find_gaps(rows: Sequence[Row]) -> dict[str, Any]:
    """Return how much better validation was than the final test, with confirmed and unconfirmed champions separate.

    Unconfirmed ones often do worse in validation than in the final test and would cancel the others.
    """
    confirmed, others = _part(rows)
    return {**describe_gaps(confirmed), "unconfirmed": describe_gaps(others)}


def describe_gaps(rows: Sequence[Row]) -> dict[str, Any]:
    """Return number, mean and largest of the gaps in trials of 20."""
    gaps = [row["gap_of_20"] for row in rows if row["gap_of_20"] is not None]
    mean, largest = (round(float(np.mean(gaps)), 2), max(gaps)) if gaps else (NONE, NONE)
    return {"of": len(gaps), "mean_of_20": mean, "largest_of_20": largest}


def _part(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    return [row for row in rows if row["confirmed"]], [row for row in rows if not row["confirmed"]]
