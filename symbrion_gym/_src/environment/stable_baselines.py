"""Make environments for stable-baselines3."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode

from reconstruction._src.base.extras import require_extras

if TYPE_CHECKING:
    from symbrion_gym._src.environment.stable_baselines_env import StableBaselinesEnv


def make_sb3_env(
    environment_id: str, num_envs: int = 16, seed: int | None = None, **options: Any
) -> StableBaselinesEnv:
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
