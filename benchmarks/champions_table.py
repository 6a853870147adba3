"""The table of runs of evolution: confirmed and unconfirmed champions in columns of their own."""

from typing import Any

from benchmarks.ages import Ages
from benchmarks.origins import Records, describe_measuring

COLUMNS = (
    "evolved", "runs", "confirmed", "of them hold", "not confirmed", "of them hold", "genotypes", "CPU s", "measured",
)  # fmt: skip
CAPTION = (
    "Runs of evolution. *Confirmed*: fresh trials in the arena of the run have confirmed its champion; where they have "
    "not, the run ended at its last generation. *Hold*: at least 18 of 20 trials in the true arena succeed; only a "
    "confirmed champion counts as one that holds. Genotypes and processor time: medians of all runs."
)


def make_champions_table(records: Records, ages: Ages | None) -> str:
    """Return the table as Markdown; empty where no run is known."""
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
