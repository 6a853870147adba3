"""Arenas of several lengths on a device: one environment for each, side by side behind one interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from symbrion_gym._src.environment.randomization import split_options
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.warp.device.run import convert, convert_all, take_actions
from symbrion_gym._src.warp.device.vector_env import DeviceVectorEnv


class StretchedVectorEnv(VectorEnv[Any, Any, Any]):
    """A `DeviceVectorEnv` for each of several stretches of the arena, side by side.

    Made by `gymnasium.make_vec(..., backend="warp", array="jax", stretches=(0.95, 1.0, 1.05))`. The simulations are
    shared out evenly: the first ones have the first stretch, and so on. Each keeps its stretch, and automatic resets
    choose among starts in an arena of this length.

    Args:
        num_envs: number of simulations, at least one for each stretch.
        array: "jax" or "torch".
        stretches: factors on the length of the arena, each once.
        options: those of `DeviceVectorEnv`; `num_starts` for each stretch.

    Attributes:
        stretch: `[num_envs]` that of each simulation.
        parts: environment of each stretch.

    Raises:
        OptionError: a stretch comes twice, there are fewer simulations, or an option is not supported.
    """

    def __init__(self, num_envs: int, array: str, stretches: Sequence[float], **options: Any) -> None:
        known = tuple(map(float, stretches))
        if len(set(known)) < len(known):
            raise OptionError(f"stretches {known} has one twice; give each once")
        if num_envs < len(known):
            raise OptionError(f"there are {len(known)} stretches for {num_envs} simulations; give as many")
        rows = np.array_split(np.arange(int(num_envs)), len(known))
        self.num_envs, self.array = int(num_envs), array
        self._rows = [slice(int(each[0]), int(each[-1]) + 1) for each in rows]
        self.stretch = np.repeat(known, [len(each) for each in rows])
        self.parts = [
            DeviceVectorEnv(len(each), "jax", stretch=stretch, **options)
            for each, stretch in zip(rows, known, strict=True)
        ]
        first = self.parts[0]
        self.metadata, self.autoreset_mode = first.metadata, first.autoreset_mode
        self.config, self.world, self.model = first.config, first.world, first.model
        self.observation_structure = first.observation_structure
        self.single_action_space = first.single_action_space
        self.single_observation_space = first.single_observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Lay the organisms down at their starts; see `DeviceVectorEnv.reset`."""
        options = dict(options or {})
        if "stretch" in options:
            raise OptionError("each simulation keeps its stretch, which envs.stretch has; leave out stretch")
        masks = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)), dtype=bool)
        if masks.shape != (self.num_envs,):
            raise OptionError(
                f"reset_mask has shape {masks.shape}; give one value for each of {self.num_envs}"
            )
        if self.is_before_reset and not masks.all():
            raise OptionError("the first reset is one of all simulations; leave out reset_mask")
        split = split_options(options, self.num_envs)
        if seed is not None and not isinstance(seed, int | np.integer) and len(seed) != self.num_envs:
            raise OptionError(f"{len(seed)} seeds for {self.num_envs} environments; give one each")
        found = []
        for part, rows in zip(self.parts, self._rows, strict=True):
            own: dict[str, Any] = {name: [each[name] for each in split[rows]] for name in options}
            own_seed = seed + rows.start if isinstance(seed, int | np.integer) else seed and seed[rows]
            found.append(part.reset(seed=own_seed, options=own | {"reset_mask": masks[rows]}))
        observation, info = _join(found)
        return convert(observation, self.array), convert_all(info, self.array)

    @property
    def is_before_reset(self) -> bool:
        """Whether no episode has begun yet."""
        return any(part.is_before_reset for part in self.parts)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Let a tick pass in every simulation that is not done; see `DeviceVectorEnv.step`."""
        actions = take_actions(actions, self.parts[0].batch.jax_device)
        if actions.shape != self.action_space.shape:
            raise OptionError(f"actions have shape {self.action_space.shape}, got {actions.shape}")
        found = [part.step(actions[rows]) for part, rows in zip(self.parts, self._rows, strict=True)]
        *arrays, info = _join(found)
        observation, reward, terminated, truncated = (convert(each, self.array) for each in arrays)
        return observation, reward, terminated, truncated, convert_all(info, self.array)

    def find_running(self) -> Any:
        """Return which simulations have an episode that has not ended, as an array of JAX."""
        return jnp.concatenate([part.find_running() for part in self.parts])

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environments of all stretches."""
        for part in self.parts:
            part.close(**kwargs)


def _join(found: Sequence[Any]) -> Any:
    """Return what all parts returned as arrays of all simulations."""
    join: Callable[..., jax.Array] = lambda *each: jnp.concatenate(each)  # noqa: E731
    return jax.tree.map(join, *found)
