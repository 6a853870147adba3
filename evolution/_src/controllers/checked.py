"""The controller of a user, checked where it meets the environment, so that its mistakes are named as such."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from jaxtyping import Float

from evolution._src.controllers.protocol import Controller, Structure, find_arrays
from evolution._src.controllers.source import ControllerSource
from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.environment.config import SENSORS

_MEMBERS = ("name", "version", "sensors", "parameters", "lower", "upper", "initial", "begin", "act")
"""What a controller has."""


@dataclass(frozen=True)
class CheckedController:
    """A controller of a user: what it returns is checked, and its errors end the run instead of failing genotypes.

    Attributes:
        controller: the user's own.
        num_actions: length of an action.
        source: where it is found again; None where it cannot be.
        spec: what the user gave.

    Raises:
        RunError: it lacks a member of `Controller`, or one is wrong.
    """

    controller: Controller
    num_actions: int
    source: ControllerSource | None = None
    spec: Any = None

    def __post_init__(self) -> None:
        missing = [name for name in _MEMBERS if not hasattr(self.controller, name)]
        if missing:
            raise RunError(
                f"controller {self.controller!r} lacks {', '.join(missing)}; see evolution.Controller"
            )
        for member in ("name", "version"):
            value = getattr(self.controller, member)
            if not isinstance(value, str) or not value:
                raise RunError(f"{member} of controller {self.controller!r} is {value!r}; a text is needed")
        for sensor in self.sensors:
            check_choice(f"sensors of controller {self.name!r}", sensor, SENSORS, RunError)
        self._check_bounds()

    def _check_bounds(self) -> None:
        sizes = {name: len(getattr(self, name)) for name in ("parameters", "lower", "upper", "initial")}
        if len(set(sizes.values())) != 1:
            raise RunError(f"controller {self.name!r} has {sizes}; one number for each parameter is needed")
        for gene, low, high, first in zip(self.parameters, self.lower, self.upper, self.initial, strict=True):
            if not (low <= first <= high and low < high and isfinite(low) and isfinite(high)):
                raise RunError(
                    f"gene {gene!r} of controller {self.name!r} has lower {low}, initial {first} and upper {high}; "
                    "finite numbers in this order are needed"
                )

    @property
    def name(self) -> str:
        """Name of the controller."""
        return self.controller.name

    @property
    def version(self) -> str:
        """Its version."""
        return self.controller.version

    @property
    def sensors(self) -> tuple[str, ...]:
        """The parts of an observation that it reads; the pitch if it reads none, as environments observe something."""
        return _as_tuple(self.controller.sensors, str) or ("pitch",)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Name of each gene."""
        return _as_tuple(self.controller.parameters, str)

    @property
    def lower(self) -> tuple[float, ...]:
        """Smallest value of each gene."""
        return _as_tuple(self.controller.lower, float)

    @property
    def upper(self) -> tuple[float, ...]:
        """Largest value of each gene."""
        return _as_tuple(self.controller.upper, float)

    @property
    def initial(self) -> tuple[float, ...]:
        """Genotype at which a search with a hint begins."""
        return _as_tuple(self.controller.initial, float)

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
        self,
        observation: Float[np.ndarray, "P O"],
        genotype: Float[np.ndarray, "*P G"],
        structure: Structure,
        state: Any,
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


def _as_tuple(values: Sequence[Any], kind: type) -> tuple[Any, ...]:
    return tuple(kind(value) for value in values)
