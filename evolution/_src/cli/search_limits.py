"""The limits of a search for bodies in words: which of them stopped it, how to go on, what an iteration can take."""

from __future__ import annotations

import logging
import shlex
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction._src.base.quantities import format_count

if TYPE_CHECKING:
    import evolution as ev
    from evolution._src.body_search.run import BodyRun

logger = logging.getLogger(__name__)
_MORE = 2
"""A search is proposed to go on to this many times what it has done."""


def find_stops(run: BodyRun) -> list[str]:
    """Return the options whose limits have stopped a search for bodies; none where nothing is left to be tried."""
    stops = []
    if run.has_all_iterations:
        stops.append(f"--generations {run.config.iterations}")
    if run.is_spent:
        stops.append(f"--max-seconds {run.config.bodies.max_seconds:g}")
    return stops


def describe_stop(run: BodyRun) -> str:
    """Return in one line which limits have stopped a search, and the command that goes on."""
    stops = find_stops(run)
    if not stops:
        return "every body has learned to the end: nothing is left to be tried"
    return f"stopped by {' and '.join(stops)}; to go on: {name_resume(run)}"


def name_resume(run: BodyRun) -> str:
    """Return the command that continues a stopped search: it raises each limit that stands in the way."""
    command = f"symbrion resume {shlex.quote(str(run.folder))}"
    if run.has_all_iterations:
        command += f" --generations {max(_MORE * len(run.history), 1)}"
    if run.is_spent:
        command += f" --max-seconds {max(ceil(_MORE * run.history[-1][0]), 1)}"
    return command


def describe_interruption(folder: Path) -> str:
    """Return how an interrupted run goes on; empty where it has not begun."""
    if not (folder / "config.json").is_file():
        return ""
    return f"all but what was unfinished is stored; to go on: symbrion resume {shlex.quote(str(folder))}"


def find_longest_iteration(config: ev.BodyEvolutionConfig) -> tuple[int, int, float]:
    """Return the bodies and the trials of the first iteration, and the longest time that a trial can take [s]."""
    from evolution._src.body_search.algorithms import make_algorithm
    from symbrion_gym._src.environment.config import EnvironmentConfig

    assignments = make_algorithm(config).ask()
    trials = sum(config.learning.count_trials(rung) for each in assignments for rung in range(each.rung + 1))
    longest = EnvironmentConfig.from_options(config.episode.make_options()).find_task().duration
    return len(assignments), trials, longest


def warn_of_limit(config: ev.BodyEvolutionConfig) -> None:
    """Log one line if an iteration, which is always finished, can take more simulated time than a search may."""
    limit = config.bodies.max_seconds
    if limit is None:
        return
    bodies, trials, longest = find_longest_iteration(config)
    if trials * longest > limit:
        logger.warning(
            "--max-seconds %g may be exceeded: an iteration is always finished, and the first one has %d trials of %s, "
            "up to %g s each, %g s in all; for shorter ones give --population %d, or --environment duration %g",
            *(limit, trials, format_count(bodies, "body", "bodies"), longest, trials * longest),
            *(max(config.bodies.children // 3, 1), ceil(longest / 4)),
        )
