"""What a controller is: the protocol that laws of this package and controllers of users follow."""

import warnings
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.errors import RunError

Structure = Mapping[str, slice]
"""Where each quantity lies in an observation, as in `OrganismEnv.observation_structure`."""
MAX_NAMED_GENES = 12
"""Genes that a message names."""


class OutOfBoundsWarning(UserWarning):
    """A genotype lies beyond the bounds of its controller."""


@runtime_checkable
class Controller(Protocol):
    """What moves a body: from observations and genotypes to actions, at every control step.

    A controller steps P simulations as arrays. The action of a row must depend on that row alone, to the bit, so that
    the outcome of a genotype does not depend on others tried at the same time.

    Attributes:
        name: its name, as records and messages show it.
        version: raised whenever equal genotypes act differently than before; a recorded run is continued with the
            version that it began with, or refused.
        sensors: the parts of an observation that it reads (`symbrion_gym._src.environment.config.SENSORS`).
        parameters: name of each gene.
        lower: smallest value of each gene.
        upper: largest value of each gene.
        initial: genotype at which a search with a hint begins.
    """

    @property
    def name(self) -> str: ...
    @property
    def version(self) -> str: ...
    @property
    def sensors(self) -> tuple[str, ...]: ...
    @property
    def parameters(self) -> tuple[str, ...]: ...
    @property
    def lower(self) -> tuple[float, ...]: ...
    @property
    def upper(self) -> tuple[float, ...]: ...
    @property
    def initial(self) -> tuple[float, ...]: ...

    def begin(self, count: int) -> Any:
        """Return the state of `count` controllers before their first observation.

        Any array whose first axis is `count`, or a tuple or NamedTuple of such; () for no state.
        """
        ...

    def act(
        self,
        observation: Float[np.ndarray, "P O"],
        genotype: Float[np.ndarray, "P G"],
        structure: Structure,
        state: Any,
    ) -> tuple[Float[np.ndarray, "P A"], Any]:
        """Return actions in [-1, 1] (hinge targets as a share of their range, then tracks) and the new state.

        Args:
            observation: one row for each controller.
            genotype: one row for each controller.
            structure: slice of each quantity in an observation.
            state: as returned by `begin` or the previous call.
        """
        ...


def check_genotypes(controller: Controller, genotypes: Float[np.ndarray, "*P G"]) -> None:
    """Refuse genotypes that do not fit a controller."""
    genes = controller.parameters
    if genotypes.shape[-1] != len(genes):
        more = ", ..." if len(genes) > MAX_NAMED_GENES else ""
        names = f": {', '.join(genes[:MAX_NAMED_GENES])}{more}" if genes else ""
        raise RunError(
            f"genotypes of {genotypes.shape[-1]} numbers; {controller.name!r} reads {len(genes)}{names}"
        )
    if not np.all(np.isfinite(genotypes)):
        raise RunError("a genotype has a number that is not finite")


def warn_of_bounds(controller: Controller, genotypes: Float[np.ndarray, "*P G"], stacklevel: int = 3) -> None:
    """Warn of genes beyond the bounds of a controller, which `evolve` never tries.

    CMA-ES of `evolve` maps samples into the bounds, and learns from what was tried. Genotypes of other searches
    are neither refused, as laws act beyond their bounds, too, nor clipped: a search that does not know of it would
    learn from genotypes that were never tried.

    Warns:
        OutOfBoundsWarning: with the first such gene.
    """
    beyond = (genotypes < np.array(controller.lower)) | (genotypes > np.array(controller.upper))
    if not beyond.any():
        return
    first = tuple(np.argwhere(beyond)[0])
    gene = first[-1]
    name, low, high = (getattr(controller, each)[gene] for each in ("parameters", "lower", "upper"))
    warnings.warn(
        f"{np.count_nonzero(beyond)} of {beyond.size} genes lie beyond the bounds of controller {controller.name!r}, "
        f"the first is {name} = {genotypes[first]:.4g}, not in {low:g} to {high:g}; they are tried as they are. Give "
        "the bounds `controller.lower` and `controller.upper` to the search",
        OutOfBoundsWarning,
        stacklevel,
    )


def reset_rows(
    controller: Controller, state: Any, rows: Int[np.ndarray, " R"] | Bool[np.ndarray, " P"] | list[int]
) -> Any:
    """Return a state in which some controllers begin anew."""
    arrays = find_arrays(state)
    return _combine(state, controller.begin(len(arrays[0])), rows) if arrays else state


def find_arrays(state: Any) -> list[Any]:
    """Return the arrays of a state, in order."""
    if isinstance(state, tuple):
        return [array for each in state for array in find_arrays(each)]
    return [] if state is None else [state]


def _combine(state: Any, fresh: Any, rows: Any) -> Any:
    if state is None:
        return state
    if isinstance(state, tuple):
        parts = [_combine(*pair, rows) for pair in zip(state, fresh, strict=True)]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    combined = np.array(state)
    combined[rows] = np.asarray(fresh)[rows]
    return combined
