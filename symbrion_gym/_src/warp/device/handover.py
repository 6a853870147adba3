"""Arrays handed between Warp, JAX and torch through DLPack: the same memory, no copy.

JAX and Warp queue their work apart from each other. Whoever hands over has finished first: what JAX computed is waited
for before Warp reads it, and the other way round. This takes some microseconds a tick, and no order can go wrong.
"""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from symbrion_gym._src.errors import OptionError


def find_jax_device(device: Any) -> Any:
    """Return the device of JAX that is a device of Warp."""
    kind, ordinal = ("cpu", 0) if device.is_cpu else ("cuda", device.ordinal)
    try:
        return jax.devices(kind)[ordinal]
    except (RuntimeError, IndexError) as error:
        raise OptionError(
            f"JAX does not see device {str(device)!r}; install JAX for GPUs: pip install 'jax[cuda12]'"
        ) from error


def give_to_warp(warp: Any, array: jax.Array) -> Any:
    """Return an array of JAX as one of Warp; keep the former as long as the latter is read."""
    return warp.from_dlpack(jax.block_until_ready(array))


def take_from_warp(warp: Any, array: Any) -> jax.Array:
    """Return an array of Warp as one of JAX, which changes as Warp writes; use it before that."""
    if not array.device.is_cpu:
        warp.synchronize_device(array.device)
    return jax.dlpack.from_dlpack(array)


def convert(array: jax.Array, kind: str) -> Any:
    """Return an array of JAX as one of another kind, of the same memory."""
    if kind == "torch":
        import torch

        return torch.utils.dlpack.from_dlpack(jax.block_until_ready(array))
    return array


def convert_all(info: dict[str, Any], kind: str) -> dict[str, Any]:
    """Return `info` with its arrays converted, also those of nested ones."""
    return {
        name: convert_all(value, kind) if isinstance(value, dict) else convert(value, kind)
        for name, value in info.items()
    }


def take_actions(actions: Any, device: Any) -> jax.Array:
    """Return actions of any kind as an array of JAX on a device, without a copy where they are there."""
    if isinstance(actions, jax.Array):
        return actions
    if hasattr(actions, "detach"):
        actions = jax.dlpack.from_dlpack(actions.detach().float().contiguous())
        return jax.device_put(actions, device)
    return jax.device_put(np.asarray(actions, dtype=np.float32), device)
