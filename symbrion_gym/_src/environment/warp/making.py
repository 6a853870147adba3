"""The vector environment of an id, on the engine that the option `backend` names."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import OptionError

if TYPE_CHECKING:
    from symbrion_gym._src.environment.warp.device.vector_env import DeviceVectorEnv

ENGINES = ("mujoco", "warp")  # Engines that step the simulations of a vector environment
ARRAYS = ("numpy", "jax", "torch")
"""What environments take and return; only "warp" knows others than the first."""


def make_vector_env(
    num_envs: int = 1, backend: str = "mujoco", array: str = "numpy", **options: Any
) -> OrganismVectorEnv | DeviceVectorEnv:
    """Make a vector environment."""
    check_choice("backend", backend, ENGINES, OptionError)
    check_choice("array", array, ARRAYS, OptionError)
    if backend == "mujoco" and array != "numpy":
        raise OptionError(f"array={array!r} needs backend='warp'; leave out array")
    if backend == "mujoco":
        return OrganismVectorEnv(num_envs, **options)
    if array == "torch" and find_spec("torch") is None:
        raise OptionError(
            "array='torch' needs torch, which is not installed: pip install torch, or take 'jax'"
        )
    if array != "numpy":
        from symbrion_gym._src.environment.warp.requirements import import_warp

        import_warp()
        from symbrion_gym._src.environment.warp.device.vector_env import DeviceVectorEnv

        return DeviceVectorEnv(num_envs, array, **options)
    from symbrion_gym._src.environment.warp.warp_vector_env import WarpVectorEnv

    return WarpVectorEnv(num_envs, **options)
