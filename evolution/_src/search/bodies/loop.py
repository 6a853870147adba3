"""The search for bodies: ask an algorithm, let bodies learn, tell it, record everything.

A run resumes by going through the same code from its beginning, with results from the record instead of physics; so
what follows is bit-identical.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

from evolution._src.backends.body_rollout import simulate_bodies
from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.rollout import warm_up
from evolution._src.backends.simulation import Simulate
from evolution._src.backends.trials import prepare_arena
from evolution._src.errors import RunError
from evolution._src.search.bodies.algorithms import make_algorithm
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.learner import Learner, OnTried, Tried
from evolution._src.search.bodies.learning import LevelResult
from evolution._src.search.bodies.record import BodyRecord
from evolution._src.search.bodies.run import (
    BodyRun,
    begin_folder,
    change_folder,
    read_confirmation,
    read_folder,
    write_run,
)
from evolution._src.search.run import RunFolder
from reconstruction._src.base.progress import Progress, silent

logger = logging.getLogger(__name__)
OnIteration = Callable[[BodyRun], None]  # Called with the run so far after each iteration


def evolve_bodies(
    config: BodyEvolutionConfig,
    *,
    simulate: Simulate | None = None,
    on_iteration: OnIteration | None = None,
    progress: Progress = silent,
) -> BodyRun:
    """Search for bodies from the beginning.

    Args:
        config: configuration of the run; `config.folder` must not contain a run yet.
        simulate: the function that tries jobs; None means physics.
        on_iteration: called with the run so far after each iteration.
        progress: called with the progress of the run.

    Raises:
        RunError: the folder contains a run, cannot be written or is being written by another run, or the environment
            cannot be made.
        ArenaError: there is no such arena, or it cannot be built.
    """
    config.to_json()  # refuses what no file could restore, before anything is written
    if simulate is None and config.iterations:
        prepare_arena(config.arena, progress)
        warm_up(config.make_trials(config.make_shortest(), 1, ()), 1, 1)
    if config.folder is None:
        return _run(config, BodyRecord(), None, simulate, on_iteration, progress)
    folder = RunFolder(config.folder)
    with folder.lock():
        begin_folder(folder.path, config)
        return _run(config, BodyRecord(), folder.path, simulate, on_iteration, progress)


def resume_bodies(
    folder: str | Path,
    *,
    simulate: Simulate | None = None,
    on_iteration: OnIteration | None = None,
    progress: Progress = silent,
    allow: Collection[str] = (),
    **changes: Any,
) -> BodyRun:
    """Continue a search for bodies as if it had never stopped.

    Args:
        folder: folder of the run.
        simulate: the function that tries jobs; None means physics.
        on_iteration: called with the run so far after each new iteration.
        progress: called with the progress of the run.
        allow: modules of yours that the folder names and that may be imported; a folder runs no other code.
        changes: new values of `iterations`, `workers`, `backend` or `address`.

    Raises:
        RunError: there is no run, or it is damaged, contradicts its configuration, or is being written.
    """
    allowed = set(BodyEvolutionConfig.RUNTIME) - {"folder"}
    if not set(changes) <= allowed:
        raise RunError(f"{sorted(set(changes) - allowed)} cannot change in a run; {sorted(allowed)} can")
    read_folder(Path(folder))  # says what is wrong before the lock makes a folder
    run_folder = RunFolder(folder)
    with run_folder.lock():
        stored, record = read_folder(run_folder.path)
        config, known = replace(stored, folder=str(folder), **changes).restore(allow), record.num_results
        if simulate is None:
            prepare_arena(config.arena, progress)
        if config != stored:
            change_folder(run_folder.path, config)
        run = _run(config, record, run_folder.path, simulate, on_iteration, progress)
    if run.record.num_results == known:
        limit = f"iterations={config.iterations}" if run.has_all_iterations else "its end"
        logger.warning("%s: nothing more is tried, as the run has reached %s", folder, limit)
    return run


def load_bodies(folder: str | Path) -> BodyRun:
    """Read a search for bodies without continuing it; also while another process writes it.

    Raises:
        RunError: there is none, or it is damaged or contradicts its configuration.
    """
    config, record = read_folder(Path(folder))
    return _iterate(config, record, Path(folder), None)


def _run(
    config: BodyEvolutionConfig,
    record: BodyRecord,
    folder: Path | None,
    simulate: Simulate | None,
    on_iteration: OnIteration | None,
    progress: Progress,
) -> BodyRun:
    backend = make_backend(config.backend, config.workers, config.address, simulate or simulate_bodies)
    try:
        return _iterate(config, record, folder, backend, on_iteration, progress)
    finally:
        backend.close()


def _iterate(
    config: BodyEvolutionConfig,
    record: BodyRecord,
    folder: Path | None,
    backend: Backend | None,
    on_iteration: OnIteration | None = None,
    progress: Progress = silent,
) -> BodyRun:
    """Go through the iterations; those that the record knows cost nothing. Without a backend there are no others."""
    algorithm, learner = make_algorithm(config), Learner(config, record, backend)
    run = BodyRun(config, record, (), folder)
    used: dict[tuple[str, int], LevelResult] = {}
    for _ in range(config.iterations):
        assignments = algorithm.ask()
        is_known = learner.knows(assignments)
        if not assignments or (backend is None and not is_known):
            break
        results = learner.learn(assignments, None if is_known else _follow(config, run, progress))
        algorithm.tell(results)
        for result in results:
            used |= {(result.body.canonical_text, each.level): each for each in record.find_until(result)}
        run = replace(run, history=(*run.history, (_sum_seconds(used), _select_best(config, used))))
        if is_known:
            continue
        if folder is not None:
            write_run(folder, run)
        if on_iteration is not None:
            on_iteration(run)
        done = f"iteration {len(run.history)} of {config.iterations}"
        progress(done, len(run.history) / config.iterations)
    return replace(run, confirmation=read_confirmation(run))


def _follow(config: BodyEvolutionConfig, run: BodyRun, progress: Progress) -> OnTried | None:
    """Return what shows the trials of the next iteration of a run as progress of the whole; None for silence."""
    if progress is silent:
        return None

    def show(tried: Tried) -> None:
        number = f"iteration {len(run.history) + 1} of {config.iterations}"
        text = f"{number}: {tried.trials} of {tried.due} trials" if tried.due else number
        progress(text, (len(run.history) + tried.trials / max(tried.due, 1)) / config.iterations)

    show(Tried(0, 0, 0.0))
    return show


def _sum_seconds(results: dict[tuple[str, int], LevelResult]) -> float:
    return sum(result.seconds for result in results.values())


def _select_best(config: BodyEvolutionConfig, results: dict[tuple[str, int], LevelResult]) -> float:
    """Return the best fitness of a body that has learned to the last level."""
    last = len(config.learning.levels) - 1
    return max((each.fitness for each in results.values() if each.level == last), default=-inf)
