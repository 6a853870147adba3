"""Let all bodies learn in all tasks, in rounds that are stored, so that an interrupted computation goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path

from evolution._src.backends.simulation import Simulate
from evolution._src.bodies.enumeration import enumerate_bodies
from evolution._src.bodies.genome import BodyGenome
from evolution._src.body_search.loop import evolve_bodies, load_bodies, resume_bodies
from evolution._src.body_search.run import BodyRun, has_bodies
from evolution._src.errors import RunError
from evolution._src.landscape.config import CHILDREN, LandscapeConfig, make_search
from reconstruction._src.base.progress import Progress, silent


def list_bodies(largest: int) -> list[BodyGenome]:
    """Return all bodies of up to a number of modules, the small ones first."""
    return [body for count in range(1, largest + 1) for body in enumerate_bodies(count)]


def count_rounds(config: LandscapeConfig) -> int:
    """Return after how many rounds every body has learned."""
    return ceil(len(list_bodies(config.largest)) / CHILDREN)


def let_bodies_learn(
    config: LandscapeConfig,
    arenas: dict[str, Path],
    folder: Path,
    workers: int = 1,
    rounds: int | None = None,
    simulate: Simulate | None = None,
    progress: Progress = silent,
) -> dict[str, BodyRun]:
    """Let every body learn every task, a round of each task in turn; what is stored is not tried again.

    Args:
        config: of the landscape.
        arenas: folder of the arena of each task.
        folder: where the run of each task is kept.
        workers: number of threads; they change nothing but the time.
        rounds: last round; None: until every body has learned.
        simulate: the function that tries jobs; None means physics.
        progress: called with what is being done and the share done.

    Raises:
        RunError: the folder has runs of another configuration.
    """
    last = count_rounds(config) if rounds is None else rounds
    runs: dict[str, BodyRun] = {}
    for number in range(1, last + 1):
        for name, arena in arenas.items():
            search = make_search(config, name, arena, folder / name, workers)
            runs[name] = _go_on(search, number, simulate)
            done = sum(len(run.history) for run in runs.values())
            progress(f"{name}, round {number} of {last}", done / (last * len(arenas)))
    return runs


def read_runs(folder: Path, names: Sequence[str]) -> dict[str, BodyRun]:
    """Return what has been stored of each task."""
    return {name: load_bodies(folder / name) for name in names}


def _go_on(search, rounds: int, simulate: Simulate | None) -> BodyRun:
    folder = Path(search.folder)
    if not has_bodies(folder):
        return evolve_bodies(replace(search, iterations=rounds), simulate=simulate)
    known = load_bodies(folder)
    if known.config.digest() != replace(search, iterations=rounds).digest():
        raise RunError(f"{folder} contains a run of another configuration; name another folder")
    if len(known.history) >= rounds:
        return known
    return resume_bodies(folder, iterations=rounds, workers=search.execution.workers, simulate=simulate)
