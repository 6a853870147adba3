"""The archive of MAP-Elites: behaviors that tell genotypes apart, and the grid of pyribs that keeps the fittest."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evolution._src.backends.outcome import Outcome
from evolution._src.errors import RunError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import coerce_floats

_MAX_CELLS = 1_000_000
_MAX_STEP = 10.0


def _measure_effort(outcome: Outcome) -> float:
    return outcome.effort


def _measure_seconds(outcome: Outcome) -> float:
    return outcome.seconds / max(outcome.trials, 1)


def _measure_progress(outcome: Outcome) -> float:
    return outcome.progress


AXES: Mapping[str, Callable[[Outcome], float]] = {
    "effort": _measure_effort,
    "seconds": _measure_seconds,
    "progress": _measure_progress,
}
"""What every outcome tells, on any backend: mean effort, mean time [s] and mean progress [m] of a trial."""


@dataclass(frozen=True)
class ArchiveConfig:
    """The grid of behaviors of MAP-Elites, and how elites vary.

    Attributes:
        axes: behaviors that tell genotypes apart: "effort", "seconds" or "progress", each the mean of a genotype's
            trials, or a number that `descriptors` keep, such as "most_tilted" or "highest:2" (its third number).
            Without axes the search is CMA-ES.
        cells: number of cells of each axis.
        lower: where each axis begins; what lies beyond counts as the first cell.
        upper: where each axis ends.
        noise: standard deviation of what is added to each gene of an elite, in widths of its range (iso of
            Vassiliades and Mouret 2018, who take 0.01).
        line: standard deviation of the share of the way to another elite that is added (line of theirs, 0.2).
    """

    axes: tuple[str, ...] = ()
    cells: tuple[int, ...] = ()
    lower: tuple[float, ...] = ()
    upper: tuple[float, ...] = ()
    noise: float = 0.02
    line: float = 0.2

    def __post_init__(self) -> None:
        for name in ("axes", "cells", "lower", "upper"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        coerce_floats(self, {"noise": (0.0, _MAX_STEP), "line": (0.0, _MAX_STEP)}, RunError)
        sizes = {name: len(getattr(self, name)) for name in ("axes", "cells", "lower", "upper")}
        if len(set(sizes.values())) != 1:
            raise RunError(f"cells, lower and upper need one number for each of the axes, got {sizes}")
        if not all(isinstance(count, int) and count > 0 for count in self.cells) or (
            np.prod(self.cells, dtype=float) > _MAX_CELLS
        ):
            raise RunError(f"cells is {self.cells}; whole numbers above 0, at most {_MAX_CELLS} cells in all")
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise RunError(f"lower is {self.lower} and upper is {self.upper}; each axis must rise")

    def measure(self, outcome: Outcome) -> list[float]:
        """Return the place of an outcome on each axis.

        Raises:
            RunError: the outcome has no such descriptor.
        """
        return [
            AXES[axis](outcome) if axis in AXES else _find_descriptor(axis, outcome) for axis in self.axes
        ]


def _find_descriptor(axis: str, outcome: Outcome) -> float:
    """Return the mean over trials of a number that descriptors keep."""
    name, _, index = axis.partition(":")
    try:
        values = [np.ravel(kept[name])[int(index or 0)] for kept in outcome.descriptors]
    except (KeyError, IndexError, ValueError) as error:
        raise _refuse_axis(axis, outcome) from error
    if not values:
        raise _refuse_axis(axis, outcome)
    return float(np.mean(values))


def _refuse_axis(axis: str, outcome: Outcome) -> RunError:
    kept = ", ".join(sorted(outcome.descriptors[0])) if outcome.descriptors else "none"
    return RunError(
        f"archive has axis {axis!r}; there are {', '.join(AXES)}, and what `descriptors` keep: {kept}"
    )


def make_archive(config: ArchiveConfig, num_genes: int) -> Any:
    """Return an empty archive of genotypes.

    Raises:
        MissingExtraError: the extra `ribs` is not installed.
    """
    require_extras("MAP-Elites over controllers", "ribs")
    from ribs.archives import GridArchive

    return GridArchive(
        solution_dim=num_genes,
        dims=config.cells,
        ranges=list(zip(config.lower, config.upper, strict=True)),
    )
