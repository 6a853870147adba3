"""The table of learning: what CMA-ES, PPO and SAC spend until a policy of each default id succeeds."""

import statistics
from typing import Any

from benchmarks.ages import Ages
from benchmarks.baselines import DEFAULT_IDS
from benchmarks.material.learning import ALGORITHMS
from benchmarks.material.learning_run import NEEDED, STARTS
from benchmarks.origins import Records, describe_measuring

COLUMNS = ("id", "algorithm", "solved", "decisions", "robot-seconds", "processor minutes", "measured")
NAMES = {"cmaes": "CMA-ES", "ppo": "PPO", "sac": "SAC"}
NOT_RUN = "not run"
CAPTION = (
    f"Learning until a policy has a strict success from {NEEDED} of {STARTS} fresh starts (`python -m "
    "benchmarks.baselines --only learning`). *Solved*: of how many runs, each with a seed of its own. The others are "
    "medians over the solved runs; in brackets, what the runs that were not solved had spent at most when their budget "
    "ended. The judging from fresh starts is not counted. CMA-ES decides 50 times a second, PPO and SAC 10 times."
)


def make_learning_table(records: Records, ages: Ages | None) -> str:
    """Return the table as Markdown; empty if nothing was run."""
    results = records.get("baselines", {"results": {}})["results"]
    runs = {part: figures for part, figures in results.items() if part.startswith("learning/")}
    names = [*DEFAULT_IDS, *dict.fromkeys(part.split("/")[1] for part in runs)]
    rows = [
        _make_row(name, algorithm, runs, records, ages)
        for name in dict.fromkeys(names)
        for algorithm in ALGORITHMS
        if name in DEFAULT_IDS or find_runs(runs, name, algorithm)
    ]
    head = [f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|"]
    return "\n".join([CAPTION, "", *head, *rows]) if runs else ""


def find_runs(runs: dict[str, Any], name: str, algorithm: str) -> dict[str, dict[str, Any]]:
    """Return the runs of an algorithm in an id, by part of the results."""
    return {part: run for part, run in runs.items() if part.startswith(f"learning/{name}/{algorithm}/")}


def _make_row(name: str, algorithm: str, runs: dict[str, Any], records: Records, ages: Ages | None) -> str:
    found = find_runs(runs, name, algorithm)
    cells = [f"`{name}`", NAMES[algorithm]]
    if not found:
        return f"| {' | '.join([*cells, NOT_RUN, '', '', '', ''])} |"
    solved = [run for run in found.values() if run["solved"]]
    cells.append(f"{len(solved)} of {len(found)}")
    for quantity, form in (("decisions", ",.0f"), ("robot_seconds", ",.0f"), ("processor_minutes", ".1f")):
        spent = [run[quantity] for run in solved or found.values()]
        cells.append(format(statistics.median(spent), form) if solved else f"({format(max(spent), form)})")
    cells.append(describe_measuring([("baselines", part) for part in found], records, ages))
    return f"| {' | '.join(cells)} |"
