"""When and at which commit figures were measured, and whether the code has changed since."""

from collections.abc import Sequence
from typing import Any

from benchmarks.ages import Ages
from benchmarks.claims.sources import find_sources

OLD, UNKNOWN = ", **old**", ", age unknown"
SET_AFTER, KNOWN_SEED = " †", " ‡"
LEGEND = (
    '*Measured*: day and commit; "at" a commit: its code was measured; "in" a commit: it brought the figures, which '
    "are older than this account of them. **old**: the code that the row measures has changed since, comments and "
    "docstrings aside. † the bar, or the measure that it is held against, was set when a first figure was known; "
    "the others were set before. ‡ rests on champions judged by seeds that stand in the code; later ones are judged "
    "by seeds drawn for each row."
)

Records = dict[str, dict[str, Any]]
Origin = dict[str, Any]


def find_runs(results: dict[str, Any], part: str) -> list[dict[str, Any]]:
    """Return the runs of evolution that a part holds, or is worked out from."""
    figures = results.get(part)
    if not isinstance(figures, dict):
        return []
    others = [row for other in figures.get("from_parts", []) for row in find_runs(results, other)]
    return [*figures.get("runs", []), *others]


def find_origins(record: dict[str, Any], part: str) -> list[Origin]:
    """Return what is known of the measuring of a part: of each run where it holds runs or is worked out from them."""
    rows = find_runs(record["results"], part)
    return [row["origin"] for row in rows] or [record["origins"][part]]


def describe_measuring(
    places: Sequence[tuple[str, str]], records: Records, ages: Ages | None, sources: Sequence[str] = ()
) -> str:
    """Return day and commit of figures, and marks, as they stand in a table.

    Args:
        places: file and part of the results that the figures lie in.
        records: file -> its whole content.
        ages: tells what is old; None says nothing of it.
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
    """Return a text without what only the whole history can tell."""
    return text.replace(OLD, "").replace(UNKNOWN, "")


def _describe_moments(origins: Sequence[Origin]) -> str:
    days = sorted({origin["date"] for origin in origins})
    span = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    commits = list(dict.fromkeys(origin["commit"][:7] for origin in origins if origin["commit"]))
    if not commits:
        return span
    word = "in" if any(origin.get("from_history") for origin in origins) else "at"
    more = f" and {len(commits) - 2} more" if len(commits) > 2 else ""
    return f"{span} {word} {', '.join(commits[:2])}{more}"


def _mark_age(pairs: Sequence[tuple[Origin, tuple[str, ...]]], ages: Ages | None) -> str:
    if ages is None:
        return ""
    found = {
        ages.is_old(origin["commit"], sources) if origin["commit"] else None for origin, sources in pairs
    }
    return OLD if True in found else UNKNOWN if None in found else ""
