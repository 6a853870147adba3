"""Many simulations of one model on a device, with the methods of `mujoco.batch.Batch` that environments use."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.models import FieldViews
from symbrion_gym._src.environment.randomization import ModelFields
from symbrion_gym._src.environment.warp.requirements import find_device, import_warp, prepare_model
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError

logger = logging.getLogger(__name__)

VARIED = ("geom_friction", "actuator_forcerange", "geom_surfacevel")
"""Fields of the model of which every world has its own."""
_INPUTS = ("qpos", "qvel", "ctrl")  # Fields that are written to the device; all others are only read
_ROWS_PER_CONTACT = 4  # Rows of constraints of a contact with pyramidal cones; elliptic ones need three
_FLOAT_SIZE = 4  # Of a number on the device [bytes]
_MIN_CONTACTS = 32  # Space for contacts of a world, however small the body


class WarpBatch:
    """Simulations of one model in MuJoCo Warp, in single precision.

    The state lives on the device. What environments read is copied to the host after every call of `step`, and what
    they write (controls, the state of simulations that begin, fields of the model) is copied to the device before it.
    Arrays of the host are double, like those of `mujoco.batch.Batch`, and stay the same arrays.

    Args:
        model: compiled model.
        nsim: number of simulations.
        device: "cpu", "cuda:0" and so on; None: the first GPU, and the processor where there is none.
        max_contacts: contacts of a simulation for which there is space; None: one for each geom that moves. Where it
            does not suffice, contacts are dropped, and a warning is logged.
        is_deterministic: whether contacts and sums have a fixed order on a GPU, too, which costs time.

    Attributes:
        nsim: number of simulations.
        device: name of the device.
        max_contacts: contacts of a simulation for which there is space.

    Raises:
        MissingExtraError: the extra `gpu` is not installed.
        OptionError: there is no such device, or Warp cannot step the model.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        nsim: int,
        device: str | None = None,
        max_contacts: int | None = None,
        is_deterministic: bool = False,
    ) -> None:
        if max_contacts is not None and (int(max_contacts) != max_contacts or max_contacts < 1):
            raise OptionError(f"max_contacts must be a whole number above 0, got {max_contacts!r}")
        self._wp, self._mjw = import_warp()
        self._device = find_device(self._wp, device)
        self.nsim, self.device = nsim, str(self._device)
        moving = int(np.count_nonzero((model.geom_bodyid > 0) & (model.geom_contype > 0)))
        self.max_contacts = int(max_contacts or max(moving, _MIN_CONTACTS))
        self._host_model = model.__copy__()
        self._probe = mujoco.MjData(model)
        self._make(prepare_model(model), is_deterministic)
        self._host: dict[str, np.ndarray] = {}
        self._fields: dict[str, np.ndarray] = {}
        for name in _INPUTS:
            self.bind(name)
        self._host["qpos"][:] = model.qpos0
        self._is_stale = np.ones(nsim, dtype=bool)
        self._graphs: dict[int, Any] = {}
        self._has_overflowed = False

    def _make(self, model: mujoco.MjModel, is_deterministic: bool) -> None:
        mjw, rows = self._mjw, _ROWS_PER_CONTACT * self.max_contacts + 2 * model.nv + model.nu
        with self._wp.ScopedDevice(self._device):
            try:
                self._model = mjw.put_model(model, batch_sizes=dict.fromkeys(VARIED, self.nsim))
            except NotImplementedError as error:
                raise OptionError(
                    f"backend 'warp' cannot step this model: {error} Leave out backend"
                ) from error
            self._model.opt.warn_overflow = 0
            self._model.opt.deterministic = is_deterministic
            self._data = mjw.make_data(model, nworld=self.nsim, nconmax=self.max_contacts, njmax=rows)
            self._history = self._wp.clone(self._data.history) if model.nhistory else None
        lost = mjw.OverflowType.NEFC | mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE
        self._lost = int(lost | mjw.OverflowType.CCD)

    def bind(self, name: str) -> np.ndarray:
        """Return a live `[nsim, ...]` array over a field of `MjData`."""
        if name not in self._host:
            shape = getattr(self._probe, name).shape
            self._host[name] = np.zeros((self.nsim, *shape))
        return self._host[name]

    def expand(self, name: str) -> np.ndarray:
        """Return the values of a field of the model in every simulation; `write_field` passes on what was written."""
        if name not in VARIED:
            raise OptionError(f"{name} is the same in all worlds of Warp; there are: {', '.join(VARIED)}")
        if name not in self._fields:
            value = getattr(self._host_model, name)
            self._fields[name] = np.tile(value, (self.nsim,) + (1,) * value.ndim)
        return self._fields[name]

    def write_field(
        self,
        name: str,
        rows: Int[np.ndarray, " R"],
        columns: Int[np.ndarray, " K"],
        values: Float[np.ndarray, "R K"],
    ) -> None:
        """Write a part of a field of the model on the device."""
        self._write(getattr(self._model, name), rows, columns, values)

    def _write(self, array: Any, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> None:
        """Write entries of an array of the device."""
        from symbrion_gym._src.environment.warp.kernels import write_entries

        wp, shape = self._wp, (len(rows), len(columns))
        if not all(shape):
            return
        with wp.ScopedDevice(self._device):
            source = wp.array(np.ascontiguousarray(values, dtype=np.float32).reshape(shape), dtype=float)
            indices = [wp.array(np.asarray(each, dtype=np.int32), dtype=int) for each in (rows, columns)]
            wp.launch(write_entries, dim=shape, inputs=[*indices, source], outputs=[self._flatten(array)])

    def _write_rows(self, array: Any, rows: np.ndarray, values: np.ndarray) -> None:
        """Write all entries of some simulations."""
        self._write(array, rows, np.arange(values.shape[1]), values)

    def _flatten(self, array: Any) -> Any:
        """Return an array of the device as `[nsim, C]` of single numbers, without a copy."""
        shape = self.nsim, array.strides[0] // _FLOAT_SIZE
        return self._wp.array(ptr=array.ptr, dtype=float, shape=shape, device=self._device)

    def reset(self, ids: Sequence[int] | np.ndarray, stage: int = 0) -> None:
        """Set simulations to the model's defaults; `forward` computes what follows from that, whatever the stage."""
        del stage
        for name in _INPUTS:
            self._host[name][ids] = self._host_model.qpos0 if name == "qpos" else 0.0
        self._is_stale[ids] = True

    def forward(self, ids: Sequence[int]) -> None:
        """Compute what follows from the states of a few simulations, on the host: their observations at the start are
        those of MuJoCo's C engine."""
        data, model = self._probe, self._host_model
        for row in ids:
            for name, values in self._fields.items():
                getattr(model, name)[:] = values[row]
            mujoco.mj_resetData(model, data)
            for name in _INPUTS:
                getattr(data, name)[:] = self._host[name][row]
            mujoco.mj_forward(model, data)
            for name, values in self._host.items():
                if name not in _INPUTS:
                    values[row] = getattr(data, name)

    def step(self, active: Bool[np.ndarray, " nsim"] | None = None, nstep: int = 1) -> None:
        """Step the simulations; those that are not active end in the state that they had.

        Sensors with an interval are read once, in the first physics step: a clock of single precision that adds up the
        steps of an episode would miss the intervals.
        """
        if active is not None:
            self._is_stale |= ~active
        self._upload()
        with self._wp.ScopedDevice(self._device):
            self._rewind()
            self._launch(nstep)
        self._download(active)
        if active is not None:
            self._is_stale |= ~active

    def _rewind(self) -> None:
        """Set back the clock of sensors with an interval."""
        if self._history is not None:
            self._wp.copy(self._data.history, self._history)
            self._data.time.zero_()

    def _upload(self) -> None:
        """Write controls to the device, and the states of simulations that began or stood still."""
        data, host, rows = self._data, self._host, np.flatnonzero(self._is_stale)
        if len(rows):
            self._write_rows(data.qpos, rows, host["qpos"][rows])
            self._write_rows(data.qvel, rows, host["qvel"][rows])
            self._write_rows(data.qacc_warmstart, rows, np.zeros((len(rows), self._host_model.nv)))
            self._is_stale[:] = False
        self._write_rows(data.ctrl, np.arange(self.nsim), host["ctrl"])

    def _launch(self, nstep: int) -> None:
        """Run physics steps; on a GPU as one recorded graph, so that launches cost little."""
        if self._device.is_cpu:
            for _ in range(nstep):
                self._mjw.step(self._model, self._data)
            return
        if nstep not in self._graphs:
            self._compile()
            with self._wp.ScopedCapture() as capture:
                for _ in range(nstep):
                    self._mjw.step(self._model, self._data)
            self._graphs[nstep] = capture.graph
        self._wp.capture_launch(self._graphs[nstep])

    def _compile(self) -> None:
        """Compile the kernels by a step from which the simulations return."""
        data, wp = self._data, self._wp
        names = (
            "qpos",
            "qvel",
            "qacc_warmstart",
            "ctrl",
            "time",
            *(("history",) if self._history is not None else ()),
        )
        kept = {name: wp.clone(getattr(data, name)) for name in names}
        self._mjw.step(self._model, data)
        for name, values in kept.items():
            wp.copy(getattr(data, name), values)

    def _download(self, active: Bool[np.ndarray, " nsim"] | None) -> None:
        """Copy what environments read to the host, of the active simulations."""
        for name, values in self._host.items():
            if name == "ctrl":
                continue
            found = getattr(self._data, name).numpy().reshape(values.shape)
            if active is None:
                values[...] = found
            else:
                values[active] = found[active]
        self._look_for_overflow()

    def _look_for_overflow(self) -> None:
        """Warn once if contacts were dropped."""
        if not self._has_overflowed and (self._data.overflow.numpy() & self._lost).any():
            self._has_overflowed = True
            logger.warning(
                "Warp has dropped contacts: space for %d per simulation does not suffice; raise max_contacts",
                self.max_contacts,
            )

    def list_contacts(self) -> list[Int[np.ndarray, "C 2"]]:
        """Return the geoms of the contacts of every simulation in the last physics step."""
        count, contact = int(self._data.nacon.numpy()[0]), self._data.contact
        geoms, worlds = contact.geom.numpy()[:count].reshape(-1, 2), contact.worldid.numpy()[:count]
        return [geoms[worlds == row] for row in range(self.nsim)]

    @property
    def has_overflowed(self) -> bool:
        """Whether contacts were ever dropped for lack of space."""
        return self._has_overflowed

    def get_data(self, sim: int, data: mujoco.MjData | None = None) -> mujoco.MjData:
        """Return the state of a simulation; run `mj_forward` for what follows from it."""
        data = mujoco.MjData(self._host_model) if data is None else data
        for name in _INPUTS:
            getattr(data, name)[:] = self._host[name][sim]
        return data


_TURN = 4  # Entry of a geom's surface velocity that drives: its rate about the lateral axis


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
