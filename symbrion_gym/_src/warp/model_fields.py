"""The fields of the model of which every simulation on a device has its own: friction, torque, speed of the tracks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.environment.models import FieldViews
from symbrion_gym._src.environment.randomization import ModelFields
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.warp.batch import VARIED, WarpBatch

_TURN = 4
"""Entry of a geom's surface velocity that drives: its rate about the lateral axis."""


def list_columns(world: World) -> dict[str, Int[np.ndarray, " C"]]:
    """Return which entries of the flattened fields of the model differ between simulations, name -> columns."""
    geoms = np.concatenate([world.robot_geoms, world.patch_geoms])
    varied = {"geom_friction": geoms, "actuator_forcerange": world.hinge_servos}
    if not len(world.wheel_servos):
        varied["geom_surfacevel"] = world.track_geoms.ravel()
    widths = {name: getattr(world.model, name).shape[1] for name in varied}
    return {
        name: (ids[:, None] * widths[name] + np.arange(widths[name])).ravel() for name, ids in varied.items()
    }


def list_driven(world: World) -> Int[np.ndarray, " T"]:
    """Return the entries of the flattened surface velocities that drive, module by module."""
    return world.track_geoms.ravel() * world.model.geom_surfacevel.shape[1] + _TURN


class WarpModel:
    """One model for all simulations of a `WarpBatch`, with the methods of `SharedModel`.

    Args:
        batch: batch of the simulations.
        world: world of all simulations.
    """

    def __init__(self, batch: WarpBatch, world: World) -> None:
        self._batch, self._world = batch, world
        self._fields = {name: batch.expand(name) for name in VARIED}
        self._columns = list_columns(world)
        self._driven = list_driven(world)
        self._begun: list[int] = []

    def select(self, row: int, index: int) -> ModelFields:
        """Return the fields of a simulation's own that begins; there is one world."""
        del index
        self._begun.append(row)
        return FieldViews(**{name: values[row] for name, values in self._fields.items()})

    def commit(self) -> None:
        """Pass to the device what was written of the simulations that begin."""
        rows, self._begun = np.array(self._begun, dtype=np.int64), []
        for name, columns in self._columns.items():
            values = self._fields[name]
            self._batch.write_field(name, rows, columns, values.reshape(len(values), -1)[rows][:, columns])

    def write_track_speed(self, speed: Float[np.ndarray, "N tracks"]) -> None:
        """Write track speeds [m/s], one per simulation, per module or per side."""
        if len(self._world.wheel_servos):
            return
        field = self._fields["geom_surfacevel"]
        self._world.write_track_speed(field, speed)
        values = field.reshape(len(field), -1)[:, self._driven]
        self._batch.write_field("geom_surfacevel", np.arange(len(field)), self._driven, values)
