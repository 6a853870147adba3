"""One way into both searches: for controllers of one body, and for bodies that learn."""

from __future__ import annotations

from typing import Any, overload

from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.loop import evolve_bodies
from evolution._src.search.bodies.run import BodyRun
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve as evolve_controller
from evolution._src.search.run import Run


@overload
def evolve(config: EvolutionConfig, **options: Any) -> Run: ...


@overload
def evolve(config: BodyEvolutionConfig, **options: Any) -> BodyRun: ...


def evolve(config: EvolutionConfig | BodyEvolutionConfig, **options: Any) -> Run | BodyRun:
    """Evolve controllers of one body, or bodies that each learn a controller, from the beginning.

    Args:
        config: an `EvolutionConfig` has one body; a `BodyEvolutionConfig` searches for it.
        options: those of `evolution._src.search.loop.evolve`, or of `evolve_bodies`.

    Raises:
        RunError: the folder contains a run, cannot be written or is being written by another run, or the environment
            cannot be made.
        ArenaError: there is no such arena, or it cannot be built.
    """
    if isinstance(config, BodyEvolutionConfig):
        return evolve_bodies(config, **options)
    return evolve_controller(config, **options)
