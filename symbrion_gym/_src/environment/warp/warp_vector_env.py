"""The environment many at once on an accelerator: physics in MuJoCo Warp, everything else as in `OrganismVectorEnv`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

from mujoco.batch import Batch

from symbrion_gym._src.environment.models import LayoutError, SharedModel
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.warp.batch import WarpBatch, WarpModel
from symbrion_gym._src.environment.warp.requirements import import_warp
from symbrion_gym._src.errors import OptionError


class WarpVectorEnv(OrganismVectorEnv):
    """Many `OrganismEnv` at once on a GPU, or on Warp's CPU device to try it without one.

    Made by `gymnasium.make_vec(..., vectorization_mode="vector_entry_point", backend="warp")`. The physics runs on the
    device in single precision; observations, rewards, terminations and resets are computed by the same code on the
    host, in NumPy, from what is copied there once a control step: `qpos`, `qvel`, the poses of the bodies, the sensors
    and the forces of the actuators. Controls and track speeds are copied to the device.

    Results differ from those of `OrganismVectorEnv` by single precision, and after contacts have amplified that, in
    the course of episodes; see the page on GPUs. On the processor, equal seeds give equal bits.

    It takes the options of `OrganismVectorEnv`, without `num_threads`, `timers` and several `stretches`, and these:

    | argument           | meaning                                                                                  |
    |--------------------|------------------------------------------------------------------------------------------|
    | `device`           | "cpu", "cuda:0" and so on; the first GPU by default, the processor where there is none    |
    | `max_contacts`     | contacts of a simulation for which there is space; as many as geoms that move by default  |
    | `is_deterministic` | whether equal seeds give equal bits on a GPU, too; its cost has not been measured         |

    Raises:
        MissingExtraError: the extra `gpu` is not installed.
        OptionError: an option is not supported on this backend, or out of range.
    """

    def __init__(
        self,
        num_envs: int = 1,
        device: str | None = None,
        max_contacts: int | None = None,
        is_deterministic: bool = False,
        num_threads: int | None = None,
        stretches: Sequence[float] | None = None,
        **options: Any,
    ) -> None:
        if num_threads not in (None, 1):
            raise OptionError(f"num_threads is {num_threads}, but backend 'warp' has a device; leave it out")
        if options.get("timers"):
            raise OptionError("backend 'warp' has no timers; leave out the option timers")
        if stretches is not None and len(stretches) > 1:
            raise LayoutError(
                f"backend 'warp' holds one arena, and there are stretches {tuple(stretches)}; give each an environment "
                "of its own, with the option stretch"
            )
        import_warp()
        self._device_options = {
            "device": device,
            "max_contacts": max_contacts,
            "is_deterministic": is_deterministic,
        }
        super().__init__(num_envs, 1, stretches=stretches, **options)

    def _make_batch(self, num_threads: int) -> None:
        del num_threads
        batch = WarpBatch(self.model, self.num_envs, **self._device_options)
        self.batch = cast(Batch, batch)
        self._models = cast(SharedModel, WarpModel(batch, self.world))
        self._qpos, self._control = batch.bind("qpos"), batch.bind("ctrl")
        self._physics = self.world.view(batch.bind)
