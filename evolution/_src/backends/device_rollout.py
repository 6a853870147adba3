"""Trials on a device from the observation to the action: laws as functions of JAX, no copy to the host in between.

What does not run there (a controller or a task of a user that needs NumPy, descriptors) is tried with the physics on
the device and the rest on the host; see `symbrion_gym._src.warp.warp_vector_env`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from evolution._src.controllers.protocol import Controller
from symbrion_gym._src.environment.models import LayoutError
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.warp.making import make_vector_env

if TYPE_CHECKING:
    from symbrion_gym._src.warp.device.vector_env import DeviceVectorEnv

logger = logging.getLogger(__name__)

_TICKS_BETWEEN_LOOKS = 16
"""Whether all episodes have ended is looked up this often, as looking waits for the device."""


def make_device_environment(controller: Controller, stretches: Sequence[float], **options: Any) -> Any:
    """Return an environment whose physics is on a device, and all else if it can be."""
    if len(stretches) > 1:
        raise LayoutError(f"backend 'warp' holds one arena, and there are stretches {tuple(stretches)}")
    try:
        environment: Any = make_vector_env(backend="warp", array="jax", stretch=stretches[0], **options)
        _check_controller(controller, environment)
    except (TaskError, OptionError, TypeError, AttributeError) as error:
        logger.info("observations, rewards and controllers are computed on the host: %s", error)
        return make_vector_env(backend="warp", stretches=stretches, **options)
    return environment


def _check_controller(controller: Controller, environment: DeviceVectorEnv) -> None:
    """Trace a controller."""
    import jax

    num, shape = environment.num_envs, (environment.num_envs, len(controller.parameters))
    seen, genes = (
        jax.ShapeDtypeStruct(each, np.float32) for each in (environment.observation_space.shape, shape)
    )
    act = _make_act(controller, environment)
    try:
        actions, _ = jax.eval_shape(act, seen, genes, controller.begin(num))
    except Exception as error:  # whatever a controller of a user raises: it then acts on the host
        raise TypeError(f"controller {controller.name!r} does not run on a device: {error}") from error
    if actions.shape != environment.action_space.shape:
        raise TypeError(f"controller {controller.name!r} returns actions of shape {actions.shape}")


def _make_act(controller: Controller, environment: DeviceVectorEnv) -> Any:
    structure = environment.observation_structure
    return lambda seen, genes, state: controller.act(seen, genes, structure, state)


def is_on_device(environment: Any) -> bool:
    """Return whether observations and actions of an environment stay on a device."""
    return getattr(environment, "array", "numpy") == "jax"


def run_on_device(
    environment: DeviceVectorEnv, controller: Controller, genotypes: Float[np.ndarray, "N G"], begun: Any
) -> tuple[dict[str, np.ndarray], Float[np.ndarray, " N"]]:
    """Run one episode of every simulation; return the last `info` and the work of the hinges' reward."""
    import jax
    import jax.numpy as jnp

    device = environment.batch.jax_device
    act = jax.jit(_make_act(controller, environment))

    @jax.jit
    def add_up(effort: Any, running: Any, spent: Any, ended: Any) -> tuple[Any, Any]:
        return effort - jnp.where(running, spent, 0.0), running & ~ended

    with jax.default_device(device):
        state = jax.tree.map(jnp.asarray, controller.begin(environment.num_envs))
        genes = jnp.asarray(genotypes, dtype=jnp.float32)
        effort, running = jnp.zeros(environment.num_envs), environment.find_running()
        observation, info, tick = begun, {}, 0
        while tick % _TICKS_BETWEEN_LOOKS or bool(running.any()):
            actions, state = act(observation, genes, state)
            observation, _, terminated, truncated, info = environment.step(actions)
            spent = info.get("reward_effort", jnp.zeros_like(effort))
            effort, running = add_up(effort, running, spent, terminated | truncated)
            tick += 1
    names = ("success", "progress", "time", "diverged")
    return {name: np.asarray(info[name]) for name in names}, np.asarray(effort, dtype=float)
