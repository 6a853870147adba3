"""The elites of a run, from its record: of MAP-Elites, and of any other search."""

import numpy as np

from evolution._src.errors import RunError
from evolution._src.search.archive import ArchiveConfig, make_archive
from evolution._src.search.record import SAMPLE, Entry
from evolution._src.search.run import Run


def find_elites(run: Run, archive: ArchiveConfig | None = None) -> list[Entry]:
    """Return the fittest sample of each cell that has one, the fittest first.

    Args:
        run: any run: of MAP-Elites, or of CMA-ES with an archive given.
        archive: the grid; None for that of the run.

    Raises:
        RunError: there are no axes, or an outcome has no such descriptor.
        MissingExtraError: the extra `ribs` is not installed.
    """
    archive = run.config.search.archive if archive is None else archive
    if not archive.axes:
        raise RunError(
            "the run has no archive; give ArchiveConfig(axes=..., cells=..., lower=..., upper=...)"
        )
    entries = [entry for entry in run.record.entries if entry.kind == SAMPLE and not entry.outcome.error]
    cells = make_archive(archive, 1)
    for index, entry in enumerate(entries):
        cells.add_single(np.array([float(index)]), entry.fitness, archive.measure(entry.outcome))
    found = [entries[int(index)] for index in cells.data("solution")[:, 0]] if entries else []
    return sorted(found, key=lambda entry: -entry.fitness)
