"""The champion of an experiment's own run of evolution."""

from __future__ import annotations

from pathlib import Path

import evolution as ev
import reconstruction as rc
from evolution._src.search.run import RunFolder


def find_run_champion(
    folder: Path, arena: str, modules: int, seed: int, generations: int, workers: int, progress: rc.Progress
) -> ev.Champion:
    """Return the champion of a run of evolution; an unfinished run goes on."""
    if RunFolder(folder).has_run():
        run = ev.resume(str(folder), progress=progress, workers=workers)
    else:
        run = ev.evolve(
            ev.EvolutionConfig(
                arena=arena,
                modules=modules,
                seed=seed,
                generations=generations,
                workers=workers,
                folder=str(folder),
            ),
            progress=progress,
        )
    if run.champion is None:
        raise ev.RunError(f"no champion after {generations} generations; allow more, in another folder")
    return run.champion
