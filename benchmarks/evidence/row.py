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
        met: whether figures are what was asked (None for those that cannot tell); None where nothing was.
    """

    name: str
    group: str
    what: str
    target: str
    measure: Callable[[], Figures]
    met: Callable[[Figures], bool | None] | None

    def judge(self, found: Figures) -> str:
        """Return what was asked, and whether it was missed."""
        if self.met is None or "said" not in found:
            return self.target
        return self.target + {True: "", False: ": missed", None: ": not all measured"}[self.met(found)]


ROWS: dict[str, Row] = {}
"""Name -> row, in the order of the table."""


def row(
    group: str, what: str, target: str = "", met: Callable[[Figures], bool | None] | None = None
) -> Callable[[Callable[[], Figures]], Callable[[], Figures]]:
    """Register a function that measures a row; its name is that of the row."""

    def register(measure: Callable[[], Figures]) -> Callable[[], Figures]:
        name = measure.__name__.removeprefix("measure_")
        ROWS[name] = Row(name, group, what, target, measure, met)
        return measure

    return register
