"""Which model each simulation of a batch runs on, and the fields of it that are the simulation's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.batch import Batch

from symbrion_gym._src.environment.randomization import ModelFields
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import ArenaError

_VARIED = ("geom_friction", "actuator_forcerange", "geom_surfacevel")
"""Fields of the model that differ between simulations."""


class LayoutError(ArenaError):
    """Arenas differ in more than lengths, so that one batch cannot hold them."""


@dataclass(slots=True)
class FieldViews:
    """Views of one simulation's part of a batch's model fields; see `ModelFields`."""

    geom_friction: np.ndarray
    actuator_forcerange: np.ndarray
    geom_surfacevel: np.ndarray


class SharedModel:
    """One model for all simulations; `mujoco.batch` holds what differs.

    Args:
        batch: batch of the simulations.
        world: world of all simulations.
    """

    def __init__(self, batch: Batch, world: World) -> None:
        self._world = world
        self._fields = {name: batch.expand(name) for name in _VARIED}

    def select(self, row: int, index: int) -> ModelFields:
        """Return the fields of a simulation's own when it begins in world `index`."""
        return FieldViews(**{name: values[row] for name, values in self._fields.items()})

    def commit(self) -> None:
        """Do nothing: what is written is in the batch at once."""

    def write_track_speed(self, speed: Float[np.ndarray, "N tracks"]) -> None:
        """Write track speeds [m/s], one per simulation or one per module."""
        self._world.write_track_speed(self._fields["geom_surfacevel"], speed)


class IndividualModels:
    """A model for each simulation, of the world that it began in.

    Models that are not in use wait in a pool, so that there are few more of them than simulations.

    Args:
        batch: batch of the simulations.
        worlds: worlds in which they may be.

    Raises:
        LayoutError: the worlds differ in more than lengths, so that one batch cannot hold them.
    """

    def __init__(self, batch: Batch, worlds: Sequence[World]) -> None:
        self._batch, self._worlds = batch, worlds
        self._spare: list[list[mujoco.MjModel]] = [[] for _ in worlds]
        self._index = [0] * batch.nsim
        self._models = [self._take(0) for _ in range(batch.nsim)]
        for index, world in enumerate(worlds):
            try:
                batch.set_models(world.model)
            except mujoco.FatalError as error:
                raise LayoutError(
                    f"the arenas stretched by {worlds[0].config.stretch:g} and {world.config.stretch:g} "
                    "differ in their kinds of pieces; give each an environment of its own"
                ) from error
            self._spare[index].append(self._take(index))
        self.commit()

    def _take(self, index: int) -> mujoco.MjModel:
        spare = self._spare[index]
        return spare.pop() if spare else self._worlds[index].model.__copy__()

    def select(self, row: int, index: int) -> ModelFields:
        """Return the model of a simulation that begins in world `index`."""
        if self._index[row] != index:
            self._spare[self._index[row]].append(self._models[row])
            self._index[row], self._models[row] = index, self._take(index)
        return self._models[row]

    def commit(self) -> None:
        """Pass to the batch what was written."""
        self._batch.set_models(self._models)

    def write_track_speed(self, speed: Float[np.ndarray, "N tracks"]) -> None:
        """Write track speeds [m/s], one per simulation or one per module."""
        for row, model in enumerate(self._models):
            self._worlds[0].write_track_speed(model.geom_surfacevel[None], speed[row : row + 1])
        self.commit()
