"""What a controller is: the protocol that laws of this package and controllers of users follow."""

from collections.abc import Mapping
from math import isfinite
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.environment.config import SENSORS

Population = Float[np.ndarray, "*P G"]  # A genotype for each controller, or one for all

Structure = Mapping[str, slice]
"""Where each quantity lies in an observation, as in `OrganismEnv.observation_structure`."""
MAX_NAMED_GENES = 12  # Genes that a message names


@runtime_checkable
class Controller(Protocol):
    """What moves a body: from observations and genotypes to actions, at every control step.

    A controller steps P simulations as arrays. The action of a row must depend on that row alone, bit for bit, so that
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


def check_genotypes(controller: Controller, genotypes: Population) -> None:
    """Refuse genotypes that do not fit a controller."""
    genes = controller.parameters
    if genotypes.shape[-1] != len(genes):
        names = ", ".join(genes[:MAX_NAMED_GENES])
        raise RunError(
            f"genotypes of {genotypes.shape[-1]} numbers; {controller.name!r} reads {len(genes)}: {names}"
        )
    if not np.all(np.isfinite(genotypes)):
        raise RunError("a genotype has a number that is not finite")


def reset_rows(
    controller: Controller, state: Any, rows: Int[np.ndarray, " R"] | Bool[np.ndarray, " P"] | list[int]
) -> Any:
    """Return a state in which some controllers begin again."""
    arrays = find_arrays(state)
    return _combine(state, controller.begin(len(arrays[0])), rows) if arrays else state


def find_arrays(state: Any) -> list[Any]:
    """Return the arrays of a state, in order."""
    if isinstance(state, tuple):
        return [array for each in state for array in find_arrays(each)]
    return [] if state is None else [state]


def _combine(state: Any, fresh: Any, rows: Any) -> Any:
    if isinstance(state, tuple):
        parts = [_combine(*pair, rows) for pair in zip(state, fresh, strict=True)]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    if state is None:
        return None
    combined = np.array(state)
    combined[rows] = np.asarray(fresh)[rows]
    return combined


_MEMBERS = ("name", "version", "sensors", "parameters", "lower", "upper", "initial", "begin", "act")


class CheckedController:
    """A controller of a user: what it returns is checked, and its errors end the run instead of failing genotypes."""

    def __init__(self, controller: Any, num_actions: int, spec: Any) -> None:
        """Take the user's own, the length of an action, and what names it."""
        missing = [name for name in _MEMBERS if not hasattr(controller, name)]
        if missing:
            raise RunError(f"controller {controller!r} lacks {', '.join(missing)}; see evolution.Controller")
        for member in ("name", "version"):
            value = getattr(controller, member)
            if not isinstance(value, str) or not value:
                raise RunError(f"{member} of controller {controller!r} is {value!r}; a text is needed")
        self.controller, self.num_actions, self.spec = controller, num_actions, spec
        self.name, self.version = controller.name, controller.version
        # the pitch if it reads nothing, as environments observe something
        self.sensors = tuple(map(str, controller.sensors)) or ("pitch",)
        for sensor in self.sensors:
            check_choice(f"sensors of controller {self.name!r}", sensor, SENSORS, RunError)
        self.parameters = tuple(map(str, controller.parameters))
        bounds = [tuple(map(float, getattr(controller, each))) for each in ("lower", "initial", "upper")]
        self.lower, self.initial, self.upper = bounds
        if any(len(each) != len(self.parameters) for each in bounds):
            raise RunError(
                f"controller {self.name!r} has {len(self.parameters)} parameters and {[*map(len, bounds)]} numbers in "
                "lower, initial and upper; one number for each parameter is needed"
            )
        for gene, low, first, high in zip(self.parameters, *bounds, strict=True):
            if not (low <= first <= high and low < high and isfinite(low) and isfinite(high)):
                raise RunError(
                    f"gene {gene!r} of controller {self.name!r} has lower {low}, initial {first} and upper {high}; "
                    "finite numbers in this order are needed"
                )

    def begin(self, count: int) -> Any:
        """Return the state of `count` controllers before their first observation."""
        try:
            state = self.controller.begin(count)
        except Exception as error:
            raise self._blame("begin", error) from error
        wrong = [np.shape(array) for array in find_arrays(state) if np.shape(array)[:1] != (count,)]
        if wrong:
            raise RunError(
                f"begin({count}) of controller {self.name!r} returns arrays of shape {wrong}; "
                f"their first axis must have length {count}"
            )
        return state

    def act(
        self, observation: Float[np.ndarray, "P O"], genotype: Population, structure: Structure, state: Any
    ) -> tuple[Float[np.ndarray, "P A"], Any]:
        """Return the actions and the new state; one genotype may stand for all rows."""
        count = len(observation)
        genes = np.broadcast_to(genotype, (count, genotype.shape[-1]))
        try:
            action, state = self.controller.act(observation, genes, structure, state)
            action = np.asarray(action, dtype=float)
        except Exception as error:
            raise self._blame("act", error) from error
        if action.shape != (count, self.num_actions):
            raise RunError(
                f"act of controller {self.name!r} returns actions of shape {action.shape}; "
                f"{(count, self.num_actions)} is needed: hinges, then tracks"
            )
        return action, state

    def _blame(self, method: str, error: Exception) -> RunError:
        return RunError(f"{method} of controller {self.name!r} failed: {type(error).__name__}: {error}")
