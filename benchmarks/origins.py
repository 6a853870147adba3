"""When and at which commit results were measured, and whether the code has changed since."""

from collections.abc import Sequence
from typing import Any

from benchmarks.ages import Ages
from benchmarks.claims.sources import find_sources

OLD, UNKNOWN = ", **old**", ", age unknown"
SET_AFTER, KNOWN_SEED = " †", " ‡"
LEGEND = """How to read the rows:

- *Target*: what was set as the goal before the first measurement, and whether it is met.
- *Measured*: the day, and a commit. A *code commit* contains the code that was measured. A *result commit* added the
  result; when it was measured, the commit of the code was not recorded yet.
- **old**: the measured code has changed since then, so the figure is that of the commit given, not of the present code
  (changes of comments and docstrings do not count).
- † The target, or the way of measuring, was set after a first result was known.
- ‡ The champions were judged with fixed seeds that are part of the code. All others were judged with seeds drawn at
  random for the row.
- *Robust* champion: fresh trials in the arena of its run have confirmed it, and it succeeds in at least 18 of 20 fresh
  trials in the true arena."""
"""What the columns and marks of the tables mean, in Markdown."""

Records = dict[str, dict[str, Any]]
Origin = dict[str, Any]


def find_runs(results: dict[str, Any], part: str) -> list[dict[str, Any]]:
    """Return the runs of evolution that a part contains, or is computed from."""
    figures = results.get(part)
    if not isinstance(figures, dict):
        return []
    others = [row for other in figures.get("from_parts", []) for row in find_runs(results, other)]
    return [*figures.get("runs", []), *others]


def find_origins(record: dict[str, Any], part: str) -> list[Origin]:
    """Return what is known of the measuring of a part: of each run, where runs are what it contains or rests on."""
    own = [row["origin"] for row in find_runs(record["results"], part) if "origin" in row]
    return own or [record["origins"][part]]


def describe_measuring(
    places: Sequence[tuple[str, str]], records: Records, ages: Ages | None, sources: Sequence[str] = ()
) -> str:
    """Return day and commit of results, and marks, as written in a table.

    Args:
        places: file and part of the results that contain the figures.
        records: file -> its whole content.
        ages: finds what is old; with None nothing is marked.
        sources: the code that was measured; empty means that of the parts.
    """
    pairs = [
        (origin, tuple(sources) or find_sources(file, part))
        for file, part in places
        for origin in find_origins(records[file], part)
    ]
    origins = [origin for origin, _ in pairs]
    rows = [row for file, part in places for row in find_runs(records[file]["results"], part)]
    marks = [
        (
            " (quick run)",
            any(records[file]["origins"].get(part, {}).get("is_quick") for file, part in places),
        ),
        (", uncommitted changes", any(origin["dirty"] for origin in origins)),
        (KNOWN_SEED, any("judging_seed" not in row for row in rows)),
    ]
    return (
        _describe_moments(origins)
        + "".join(mark for mark, is_set in marks if is_set)
        + _mark_age(pairs, ages)
    )


def strip_ages(text: str) -> str:
    """Return a text without the marks that need the whole history."""
    return text.replace(OLD, "").replace(UNKNOWN, "")


def _describe_moments(origins: Sequence[Origin]) -> str:
    days = sorted({origin["date"] for origin in origins})
    span = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    commits = list(dict.fromkeys(origin["commit"][:7] for origin in origins if origin["commit"]))
    if not commits:
        return span
    kind = "result" if any(origin.get("from_history") for origin in origins) else "code"
    more = f" and {len(commits) - 2} more" if len(commits) > 2 else ""
    noun = "commits" if len(commits) > 1 else "commit"
    return f"{span}, {kind} {noun} {', '.join(commits[:2])}{more}"


def _mark_age(pairs: Sequence[tuple[Origin, tuple[str, ...]]], ages: Ages | None) -> str:
    if ages is None:
        return ""
    found = {
        ages.is_old(origin["commit"], sources) if origin["commit"] else None for origin, sources in pairs
    }
    return OLD if True in found else UNKNOWN if None in found else ""
