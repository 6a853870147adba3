"""Physics on an accelerator in MuJoCo Warp, and the vector environment whose other parts stay on the host."""

import logging
from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any, cast

import mujoco
import numpy as np
from jaxtyping import Bool, Int
from mujoco.batch import Batch

from reconstruction._src.base.extras import require_extras
from symbrion_gym._src.environment.config import check_count
from symbrion_gym._src.environment.organism_vector_env import ManyArenasVectorEnv, OrganismVectorEnv
from symbrion_gym._src.environment.randomization import VARIED
from symbrion_gym._src.environment.warp.slots import check_alike, share_model
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError

logger = logging.getLogger(__name__)

_INPUTS = ("qpos", "qvel", "qacc_warmstart", "ctrl")
"""Fields that are written to the device; others are only read."""
_ROWS_PER_CONTACT = 4  # Rows of constraints of a contact with pyramidal cones; elliptic ones need three
_FLOAT_SIZE = 4  # Of a number on the device [bytes]
_SHAPES = ("mesh_", "hfield_", "nmesh", "nhfield", "npolygonmax")
"""What fields of the model begin with that hold the shapes of geoms."""
_MIN_CONTACTS = 32  # Space for contacts of a world, however small the body


def import_warp() -> tuple[Any, Any]:
    """Return the modules `warp` and `mujoco_warp`, which print nothing from now on."""
    require_extras("backend 'warp'", "gpu")
    import warp

    warp.config.log_level = max(warp.config.log_level, warp.LOG_ERROR)
    import mujoco_warp

    return warp, mujoco_warp


def find_device(name: str | None) -> Any:
    """Return a device of Warp; by default the first GPU, and the processor where there is none."""
    known = {each.alias: each for each in import_warp()[0].get_devices()}
    if name is None:
        name = next((alias for alias in known if alias.startswith("cuda")), "cpu")
    name = "cuda:0" if name == "cuda" else name
    if name not in known:
        raise OptionError(f"there is no device {name!r} for backend 'warp'; there are: {', '.join(known)}")
    return known[name]


class WarpEngine:
    """N simulations in single precision on a device; simulation i is in world i modulo their number.

    Arrays of the host, which are double, are copied to the device before every `step` if they are inputs, and from it
    afterwards; fields of the model are written by `write`. Contacts for which there is no space are dropped, and a
    warning is logged. Add worlds, then call `build`.
    """

    def __init__(
        self,
        nsim: int,
        device: str | None = None,
        max_contacts: int | None = None,  # of a simulation; None for one for each geom that moves
    ) -> None:
        self.warp, self._mjw = import_warp()
        self.warp_device = find_device(device)
        self.nsim, self.device = nsim, str(self.warp_device)
        self._max_contacts = max_contacts
        self._worlds: list[World] = []
        self._host: dict[str, np.ndarray] = {}
        self._graphs: dict[int, Any] = {}
        self.has_overflowed = False  # whether contacts were ever dropped

    def add(self, world: World) -> int:
        """Add a world; return its number."""
        check_alike([*self._worlds, world])
        self._worlds.append(world)
        if len(self._worlds) == 1:
            self._probe = mujoco.MjData(world.model)
            for name in _INPUTS:
                self.bind(name)
            self._host["qpos"][:] = world.model.qpos0
        return len(self._worlds) - 1

    def build(self) -> None:
        """Put the model and the state of all simulations on the device."""
        self.shared = shared = share_model(self._worlds)
        model = shared.model.__copy__()
        moving = int(np.count_nonzero((model.geom_bodyid > 0) & (model.geom_contype > 0)))
        usual = max(moving, _MIN_CONTACTS)
        wanted = usual if self._max_contacts is None else self._max_contacts
        self.max_contacts = check_count("max_contacts", wanted)
        mjw, rows = self._mjw, _ROWS_PER_CONTACT * self.max_contacts + 2 * model.nv + model.nu
        sizes = dict.fromkeys(shared.fields, len(self._worlds)) | dict.fromkeys(VARIED, self.nsim)
        with self.warp.ScopedDevice(self.warp_device):
            try:
                self._model = mjw.put_model(_adapt(model), batch_sizes=sizes)
                shapes = None if shared.shapes is None else mjw.put_model(_adapt(shared.shapes))
            except NotImplementedError as error:
                raise OptionError(
                    f"backend 'warp' cannot step this model: {error} Leave out backend"
                ) from error
            self._data = mjw.make_data(model, nworld=self.nsim, nconmax=self.max_contacts, njmax=rows)
            if shapes is not None:
                self._take_shapes(shapes)
            self._model.opt.warn_overflow = 0
            self._blind_model = copy(self._model)  # of the same arrays
            self._blind_model.nrangefinder = 0
            self._history = self.warp.clone(self._data.history) if model.nhistory else None
            self._each = self.make_indices(np.arange(self.nsim))
            self._all = self.warp.array(np.ones(self.nsim, dtype=bool), dtype=self.warp.bool)
        lost = mjw.OverflowType.NEFC | mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE
        self._lost = int(lost | mjw.OverflowType.CCD)

    def _take_shapes(self, shapes: Any) -> None:
        """Put the shapes of all arenas in place of the model's, and those of its own arena into each simulation."""
        for name in vars(self._model):
            if name.startswith(_SHAPES):
                setattr(self._model, name, getattr(shapes, name))
        for owner, fields in ((self._model, self.shared.fields), (self._data, self.shared.places)):
            for name, values in fields.items():
                field = getattr(owner, name)
                own = np.resize(values, (field.shape[0], *values.shape[1:]))  # those of the worlds in turn
                field.assign(own.reshape(field.numpy().shape))

    def make_indices(self, values: Int[np.ndarray, " K"]) -> Any:
        """Return indices as an array of Warp."""
        return self.warp.array(np.asarray(values, dtype=np.int32), dtype=int, device=self.warp_device)

    def bind(self, name: str) -> np.ndarray:
        """Return a live `[nsim, ...]` array over a field of `MjData`."""
        if name not in self._host:
            self._host[name] = np.zeros((self.nsim, *getattr(self._probe, name).shape))
        return self._host[name]

    def write(
        self, name: str, values: Any, columns: Any = None, mask: Any = None, numbers: Any = None
    ) -> None:
        """Write `values[numbers[i], k]` to entry `columns[k]` of a field of simulation i, where a mask holds.

        Values are an array of NumPy or Warp `[K, C]`, the others are arrays of Warp; by default they mean all.
        """
        from symbrion_gym._src.environment.warp.kernels import write_rows

        wp = self.warp
        if isinstance(values, np.ndarray):
            single = np.ascontiguousarray(values.reshape(len(values), -1), dtype=np.float32)
            values = wp.array(single, dtype=float, device=self.warp_device)
        if not values.shape[1]:
            return
        field = getattr(self._data if hasattr(self._data, name) else self._model, name)
        shape = self.nsim, field.strides[0] // _FLOAT_SIZE
        target = wp.array(ptr=field.ptr, dtype=float, shape=shape, device=self.warp_device)
        columns = self.make_indices(np.arange(shape[1])) if columns is None else columns
        chosen = self._all if mask is None else mask, self._each if numbers is None else numbers
        with wp.ScopedDevice(self.warp_device):
            dim = self.nsim, values.shape[1]
            wp.launch(write_rows, dim=dim, inputs=[*chosen, columns, values], outputs=[target])

    def step(self, active: Bool[np.ndarray, " nsim"] | None = None, nstep: int = 1) -> None:
        """Step the simulations; those that are not active end in the state that they had."""
        for name in _INPUTS:
            self.write(name, self._host[name])
        self.launch(nstep)
        for name, values in self._host.items():
            if name != "ctrl":
                rows = slice(None) if active is None else active
                values[rows] = getattr(self._data, name).numpy().reshape(values.shape)[rows]
        self.warn_of_overflow()

    def launch(self, nstep: int) -> None:
        """Run physics steps on the device; on a GPU as one recorded graph, so that launches cost little.

        Rays have an interval and are cast once, in the first physics step: they cost more than all else, and a clock of
        single precision that adds up the steps of an episode would miss the intervals.
        """
        wp = self.warp
        with wp.ScopedDevice(self.warp_device):
            if self._history is not None:
                wp.copy(self._data.history, self._history)
                self._data.time.zero_()
            if self.warp_device.is_cpu:
                self._step(nstep)
                return
            if nstep not in self._graphs:
                self._compile()
                with wp.ScopedCapture() as capture:
                    self._step(nstep)
                self._graphs[nstep] = capture.graph
            wp.capture_launch(self._graphs[nstep])

    def _step(self, nstep: int) -> None:
        for number in range(nstep):
            self._mjw.step(self._blind_model if number else self._model, self._data)

    def _compile(self) -> None:
        """Compile the kernels by a step from which the simulations return."""
        names = (*_INPUTS, "time", *(("history",) if self._history is not None else ()))
        kept = {name: self.warp.clone(getattr(self._data, name)) for name in names}
        self._step(1)
        for name, values in kept.items():
            self.warp.copy(getattr(self._data, name), values)

    def warn_of_overflow(self) -> None:
        """Warn once if contacts were dropped; waits for the device."""
        if not self.has_overflowed and (self._data.overflow.numpy() & self._lost).any():
            self.has_overflowed = True
            logger.warning(
                "Warp has dropped contacts: space for %d per simulation does not suffice; raise max_contacts",
                self.max_contacts,
            )


def _adapt(model: mujoco.MjModel) -> mujoco.MjModel:
    """Switch off what Warp does not know; return the model."""
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # Warp never resets
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return model


class WarpBatch:
    """The simulations of one world on an engine, with the methods of `mujoco.batch.Batch` that environments use."""

    def __init__(self, engine: WarpEngine, world: World, rows: slice) -> None:
        self.engine, self.number, self._rows = engine, engine.add(world), rows
        self._model, self._probe = world.model.__copy__(), mujoco.MjData(world.model)
        self.nsim = len(range(engine.nsim)[rows])
        self._bound: dict[str, np.ndarray] = {}
        self._fields: dict[str, np.ndarray] = {}

    def bind(self, name: str) -> np.ndarray:
        """Return a live `[nsim, ...]` array over a field of `MjData`."""
        if name not in self._bound:
            self._bound[name] = self.engine.bind(name)[self._rows]
        return self._bound[name]

    def expand(self, name: str) -> np.ndarray:
        """Return the values of a field of `VARIED` in every simulation; `write` passes on what was written."""
        if name not in self._fields:
            value = getattr(self._model, name)
            self._fields[name] = np.tile(value, (self.nsim,) + (1,) * value.ndim)
        return self._fields[name]

    def write(self, name: str, columns: Int[np.ndarray, " C"], targets: Any) -> None:
        """Pass on some columns of a flattened field, to others of the engine's model (an array of Warp)."""
        values = self.expand(name).reshape(self.nsim, -1)[:, columns]
        self.engine.write(name, values, targets, *self._chosen)

    @cached_property
    def _chosen(self) -> tuple[Any, Any]:
        """Which simulations of the engine are this world's, and which number each has here, as arrays of Warp."""
        mask, numbers = np.zeros(self.engine.nsim, dtype=bool), np.zeros(self.engine.nsim, dtype=np.int32)
        mask[self._rows], numbers[self._rows] = True, np.arange(self.nsim)
        warp, device = self.engine.warp, self.engine.warp_device
        return warp.array(mask, dtype=warp.bool, device=device), self.engine.make_indices(numbers)

    def reset(self, ids: Sequence[int] | np.ndarray, stage: int = 0) -> None:
        """Set simulations to the model's defaults; `forward` computes what follows from that, whatever the stage."""
        del stage
        for name in _INPUTS:
            self.bind(name)[ids] = self._model.qpos0 if name == "qpos" else 0.0

    def forward(self, ids: Sequence[int]) -> None:
        """Compute what follows from the states of a few simulations, on the host: their observations at the start are
        those of MuJoCo's C engine."""
        data, model = self._probe, self._model
        for row in ids:
            for name, values in self._fields.items():
                getattr(model, name)[:] = values[row]
            mujoco.mj_resetData(model, data)
            mujoco.mj_forward(model, self.get_data(row, data))
            for name, values in self._bound.items():
                if name not in _INPUTS:
                    values[row] = getattr(data, name)

    def step(self, active: Bool[np.ndarray, " nsim"] | None = None, nstep: int = 1) -> None:
        """Step the simulations, where they are all of the engine's."""
        self.engine.step(active, nstep)

    def get_data(self, sim: int, data: mujoco.MjData | None = None) -> mujoco.MjData:
        """Return the state of a simulation; run `mj_forward` for what follows from it."""
        data = mujoco.MjData(self._model) if data is None else data
        for name in _INPUTS:
            getattr(data, name)[:] = self.bind(name)[sim]
        return data


def list_columns(
    world: World, geoms: Int[np.ndarray, " G"] | None = None
) -> dict[str, Int[np.ndarray, " C"]]:
    """Return which entries of the flattened fields of the model differ between simulations, name -> columns.

    Geoms may have other numbers, in the model of an engine.
    """
    geoms = np.arange(world.model.ngeom) if geoms is None else geoms
    varied = {
        "geom_friction": geoms[np.concatenate([world.robot_geoms, world.patch_geoms])],
        "actuator_forcerange": world.hinge_servos,
        "geom_surfacevel": geoms[world.track_geoms.ravel()],
    }
    widths = {name: getattr(world.model, name).shape[1] for name in varied}
    return {
        name: (ids[:, None] * widths[name] + np.arange(widths[name])).ravel() for name, ids in varied.items()
    }


class WarpVectorEnv(OrganismVectorEnv):
    """Many `OrganismEnv` at once whose physics runs on a device, in single precision; see the page on GPUs.

    Observations, rewards, terminations and resets are computed by the same code on the host, from what is copied there
    once a control step.
    """

    def __init__(
        self,
        num_envs: int = 1,
        device: str | None = None,
        max_contacts: int | None = None,
        num_threads: int | None = None,
        engine: WarpEngine | None = None,
        rows: slice = slice(None),
        **options: Any,
    ) -> None:
        if num_threads not in (None, 1):
            raise OptionError(f"num_threads is {num_threads}, but backend 'warp' has a device; leave it out")
        self._engine, self._rows = engine or WarpEngine(num_envs, device, max_contacts), rows
        super().__init__(num_envs, 1, **options)
        if engine is None:
            self._engine.build()

    def _make_batch(self, num_threads: int) -> Batch:
        del num_threads
        return cast(Batch, WarpBatch(self._engine, self.world, self._rows))

    @cached_property
    def _columns(self) -> dict[str, tuple[Int[np.ndarray, " C"], Any]]:
        """Columns of what differs between simulations, in this world's model and the engine's, name -> columns."""
        own = list_columns(self.world)
        targets = list_columns(self.world, self._engine.shared.geoms[cast(WarpBatch, self.batch).number])
        return {name: (own[name], self._engine.make_indices(targets[name])) for name in own}

    def _send(self, *names: str) -> None:
        for name in names:
            cast(WarpBatch, self.batch).write(name, *self._columns[name])


class WarpArenasVectorEnv(ManyArenasVectorEnv):
    """Many `OrganismEnv` in different arenas that a device steps at once."""

    def _make_parts(self, sizes: Sequence[int], arenas: Sequence[Any], options: dict[str, Any]) -> list[Any]:
        given = {name: options.pop(name, None) for name in ("device", "max_contacts")}
        self._engine = WarpEngine(self.num_envs, **given)
        each = zip(sizes, arenas, self._rows, strict=True)
        parts = [
            WarpVectorEnv(size, arena=arena, engine=self._engine, rows=rows, **options)
            for size, arena, rows in each
        ]
        self._engine.build()
        return parts

    def _step_parts(self, actions: np.ndarray) -> list[Any]:
        pairs = [(part, actions[rows]) for part, rows in zip(self.parts, self._rows, strict=True)]
        active = [part.command(own) for part, own in pairs]
        if (joined := self._join(active)).any():
            self._engine.step(joined, self.config.frame_skip)
        return [part.finish(each) for part, each in zip(self.parts, active, strict=True)]
