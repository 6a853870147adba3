"""Simulations whose state stays on the device: physics between arrays of JAX, without a copy where nothing moves."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.world import World
from symbrion_gym._src.warp.batch import WarpBatch
from symbrion_gym._src.warp.device.handover import find_jax_device, give_to_warp, take_from_warp
from symbrion_gym._src.warp.model_fields import list_columns, list_driven

_CLEARED = ("qvel", "qacc_warmstart")
"""State that is 0 where an episode begins."""


class DeviceBatch(WarpBatch):
    """A `WarpBatch` that neither reads nor writes the arrays of the host.

    Args:
        world: world of the simulations.
        nsim: number of simulations.
        options: those of `WarpBatch`.

    Attributes:
        warp_device: the device in Warp.
        jax_device: the device in JAX.
    """

    def __init__(self, world: World, nsim: int, **options: Any) -> None:
        super().__init__(world.model, nsim, **options)
        self.warp_device = self._device
        self.jax_device = find_jax_device(self._device)
        self._world = world
        self._places = {name: self._make_indices(columns) for name, columns in list_columns(world).items()}
        self._places["qpos"] = self._make_indices(np.arange(world.model.nq))
        self._driven = self._make_indices(list_driven(world))
        self._controls = self._make_indices(np.arange(world.model.nu))
        places = ("site_xpos", "site_xmat") if world.is_by_site else ("xpos", "xmat")
        self._names = ("qpos", "qvel", "sensordata", "actuator_force", *places)
        self._kept: list[Any] = []

    def _make_indices(self, values: np.ndarray) -> Any:
        return self._wp.array(np.asarray(values, dtype=np.int32), dtype=int, device=self._device)

    def _find_target(self, name: str) -> Any:
        """Return a field of the data or the model as `[nsim, C]`."""
        return self._flatten(getattr(self._data if hasattr(self._data, name) else self._model, name))

    def put_starts(self, values: dict[str, Float[np.ndarray, "K C"]]) -> dict[str, Any]:
        """Copy starts to the device; return what `begin` takes."""
        return {
            name: self._wp.array(np.ascontiguousarray(each, dtype=np.float32), device=self._device)
            for name, each in values.items()
        }

    def begin(
        self, starts: dict[str, Any], mask: Bool[jax.Array, " nsim"], numbers: Int[jax.Array, " nsim"]
    ) -> None:
        """Begin episodes in some simulations."""
        from symbrion_gym._src.warp.kernels import clear_chosen, write_chosen

        chosen = [give_to_warp(self._wp, each) for each in (mask, numbers)]
        self._kept += [mask, numbers]
        with self._wp.ScopedDevice(self._device):
            for name, source in starts.items():
                if source.shape[1]:
                    self._wp.launch(
                        write_chosen,
                        dim=(self.nsim, source.shape[1]),
                        inputs=[*chosen, self._places[name], source],
                        outputs=[self._find_target(name)],
                    )
            for name in _CLEARED:
                target = self._find_target(name)
                self._wp.launch(clear_chosen, dim=target.shape, inputs=chosen[:1], outputs=[target])

    def advance(
        self,
        control: Float[jax.Array, "nsim nu"],
        surface: Float[jax.Array, "nsim T"] | None,
        nstep: int,
    ) -> dict[str, jax.Array]:
        """Step all simulations; return their state by the names of `MjData`, as views until the next call."""
        self._kept += [control, surface]
        with self._wp.ScopedDevice(self._device):
            if control.shape[1]:
                self._write_whole("ctrl", self._controls, control)
            if surface is not None:
                self._write_whole("geom_surfacevel", self._driven, surface)
            self._rewind()
            self._launch(nstep)
        return self.view()

    def _write_whole(self, name: str, columns: Any, values: jax.Array) -> None:
        from symbrion_gym._src.warp.kernels import write_all

        source, target = give_to_warp(self._wp, values), self._find_target(name)
        self._wp.launch(write_all, dim=values.shape, inputs=[columns, source], outputs=[target])

    def view(self) -> dict[str, jax.Array]:
        """Return the present state of all simulations, as views that are valid until the next step."""
        found = {name: take_from_warp(self._wp, getattr(self._data, name)) for name in self._names}
        self._kept = []  # what Warp still read has been waited for
        return found

    def warn_of_overflow(self) -> None:
        """Warn once if contacts were dropped; waits for the device."""
        self._look_for_overflow()
