"""One way into both searches: for controllers of one body, and for bodies that learn."""

from __future__ import annotations

from pathlib import Path
from typing import Any, overload

from evolution.body_search.config import BodyEvolutionConfig
from evolution.body_search.loop import evolve_bodies, resume_bodies
from evolution.body_search.run import BodyRun, has_bodies
from evolution.search.config import EvolutionConfig
from evolution.search.loop import evolve as evolve_controller
from evolution.search.loop import resume as resume_controller
from evolution.search.run import Run


@overload
def evolve(config: EvolutionConfig, **options: Any) -> Run: ...


@overload
def evolve(config: BodyEvolutionConfig, **options: Any) -> BodyRun: ...


def evolve(config: EvolutionConfig | BodyEvolutionConfig, **options: Any) -> Run | BodyRun:
    """Evolve controllers of one body, or bodies that each learn a controller, from the beginning.

    Args:
        config: an `EvolutionConfig` has one body; a `BodyEvolutionConfig` searches for it.
        options: those of `evolution.search.loop.evolve`, or of `evolve_bodies`.

    Raises:
        RunError: the folder contains a run, cannot be written or is being written by another run, or the environment
            cannot be made.
        ArenaError: there is no such arena, or it cannot be built.
    """
    if isinstance(config, BodyEvolutionConfig):
        return evolve_bodies(config, **options)
    return evolve_controller(config, **options)


def resume(folder: str | Path, **options: Any) -> Run | BodyRun:
    """Continue a run of either kind as if it had never stopped.

    Args:
        folder: folder of the run.
        options: those of `evolution.search.loop.resume`, or of `resume_bodies`.

    Raises:
        RunError: there is no run, or it is damaged, contradicts its configuration, or is being written.
    """
    return (resume_bodies if has_bodies(folder) else resume_controller)(folder, **options)
