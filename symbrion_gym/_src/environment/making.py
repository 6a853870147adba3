"""Make vector environments: on the engine that the option `backend` names, and for stable-baselines3."""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.environment.organism_vector_env import ManyArenasVectorEnv, OrganismVectorEnv
from symbrion_gym._src.errors import OptionError

if TYPE_CHECKING:
    from symbrion_gym._src.environment.stable_baselines_env import StableBaselinesEnv
    from symbrion_gym._src.environment.warp.device_vector_env import DeviceVectorEnv


def make_vector_env(
    num_envs: int = 1, backend: str = "mujoco", array: str = "numpy", arenas: Any = None, **options: Any
) -> "OrganismVectorEnv | ManyArenasVectorEnv | DeviceVectorEnv":
    """Return the vector environment of an id, on an engine and with arrays of a library, or in several arenas."""
    check_choice("backend", backend, ("mujoco", "warp"), OptionError)
    check_choice("array", array, ("numpy", "jax", "torch"), OptionError)
    if backend == "mujoco":
        if array != "numpy":
            raise OptionError(f"array={array!r} needs backend='warp'; leave out array")
        if arenas is not None:
            return ManyArenasVectorEnv(num_envs, arenas, **options)
        return OrganismVectorEnv(num_envs, **options)
    if arenas is not None and array != "numpy":
        raise OptionError(
            f"array={array!r} holds one arena; give arena in place of arenas, or leave out array"
        )
    if array == "torch" and find_spec("torch") is None:
        raise OptionError(
            "array='torch' needs torch, which is not installed: pip install torch, or take 'jax'"
        )
    if array == "numpy":
        from symbrion_gym._src.environment.warp.batch import WarpArenasVectorEnv, WarpVectorEnv

        if arenas is not None:
            return WarpArenasVectorEnv(num_envs, arenas, **options)
        return WarpVectorEnv(num_envs, **options)
    require_extras("backend 'warp'", "gpu")
    from symbrion_gym._src.environment.warp.device_vector_env import DeviceVectorEnv

    return DeviceVectorEnv(num_envs, array, **options)


def make_sb3_env(
    environment_id: str, num_envs: int = 16, seed: int | None = None, **options: Any
) -> "StableBaselinesEnv":
    """Return a `VecEnv` of stable-baselines3 over a registered environment.

    Args:
        environment_id: such as "symbrion_gym/CrossGap-v0".
        num_envs: number of simulations.
        seed: environment i is reset with `seed + i`; None for random seeds.
        options: options of the environment.

    Raises:
        MissingExtraError: stable-baselines3 is not installed.
        OptionError: an option is unknown or out of range.
    """
    require_extras("`symbrion_gym.make_sb3_env`", "rl")
    from symbrion_gym._src.environment.stable_baselines_env import StableBaselinesEnv

    envs = gym.make_vec(
        environment_id,
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        **options,
    )
    adapted = StableBaselinesEnv(envs)
    if seed is not None:
        adapted.seed(seed)
    return adapted
