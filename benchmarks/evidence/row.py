"""A row of the evidence: a question, what is measured, and what was asked of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
"""Folder of the real scans, which are not part of this repository."""
Figures = dict[str, Any]
"""Name -> number; `said` is the sentence for the table, `missing` the reason where nothing could be measured."""


@dataclass(frozen=True)
class Row:
    """A row.

    Attributes:
        name: short name, by which the command line selects it.
        group: the question that it answers, as a heading.
        what: what is measured, understood without the source.
        target: what was asked, "" for nothing; with † where it was set after a first result.
        measure: measures it.
    """

    name: str
    group: str
    what: str
    target: str
    measure: Callable[[], Figures]


ROWS: dict[str, Row] = {}
"""Name -> row, in the order of the table."""


def row(group: str, what: str, target: str = "") -> Callable[[Callable[[], Figures]], Callable[[], Figures]]:
    """Register a function that measures a row; its name is that of the row."""

    def register(measure: Callable[[], Figures]) -> Callable[[], Figures]:
        name = measure.__name__.removeprefix("measure_")
        ROWS[name] = Row(name, group, what, target, measure)
        return measure

    return register
