"""Short runs on toys, and what of them is equal between equal runs."""

from pathlib import Path

import numpy as np

from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import TIMES

TOY = EvolutionConfig(
    arena="truth",
    controller="reactive",
    origin="hint",
    generations=24,
    sigma=0.3,
    restart_after=None,
    stop_when_solved=False,
)


def without_times(history: np.ndarray) -> list:
    """Return the rows of a history without the columns of times."""
    names = [name for name in history.dtype.names or () if name not in TIMES]
    return history[names].tolist()


def read_without_times(folder: Path) -> list[list[str]]:
    """Return the cells of `history.csv` without the columns of times."""
    rows = [line.split(",") for line in (folder / "history.csv").read_text().splitlines()]
    skipped = [rows[0].index(name) for name in TIMES]
    return [[cell for index, cell in enumerate(row) if index not in skipped] for row in rows]
