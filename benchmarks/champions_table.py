"""The table of runs of evolution, with confirmed and unconfirmed champions in separate columns."""

from typing import Any

from benchmarks.ages import Ages
from benchmarks.origins import Records, describe_measuring

COLUMNS = (
    "experiment", "runs", "confirmed", "robust", "unconfirmed", "of these pass", "genotypes", "CPU s", "measured",
)  # fmt: skip
CAPTION = (
    "All runs of evolution. *Confirmed*: fresh trials in the arena of the run confirmed the champion; otherwise the "
    "run ended at its last generation. *Robust*: confirmed, and successful in at least 18 of 20 trials in the true "
    "arena. *Of these pass*: unconfirmed champions that succeed in at least 18 of 20 trials there. Genotypes and "
    "processor time are medians over all runs."
)


def make_champions_table(records: Records, ages: Ages | None) -> str:
    """Return the table as Markdown; empty if there are no runs."""
    record = records.get("evolution", {"results": {}})
    rows = [
        _make_row(part, figures, describe_measuring([("evolution", part)], records, ages))
        for part, figures in record["results"].items()
        if isinstance(figures, dict) and figures.get("runs")
    ]
    head = [f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|"]
    return "\n".join([CAPTION, "", *head, *rows]) if rows else ""


def _make_row(part: str, figures: dict[str, Any], measured: str) -> str:
    names = ("of", "confirmed", "champions_that_hold", "unconfirmed", "unconfirmed_that_hold")
    costs = (f"{figures[name]:.0f}" for name in ("median_genotypes", "median_cpu_seconds"))
    cells = [
        part.replace("_", " ").replace("/", ": "),
        *(str(figures[name]) for name in names),
        *costs,
        measured,
    ]
    return f"| {' | '.join(cells)} |"
