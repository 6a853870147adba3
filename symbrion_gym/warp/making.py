"""The vector environment of an id, on the engine that the option `backend` names."""

from __future__ import annotations

from typing import Any

from reconstruction.range_checks import check_choice
from symbrion_gym.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym.errors import OptionError

ENGINES = ("mujoco", "warp")
"""Engines that step the simulations of a vector environment."""


def make_vector_env(num_envs: int = 1, backend: str = "mujoco", **options: Any) -> OrganismVectorEnv:
    """Make a vector environment.

    Args:
        num_envs: number of simulations.
        backend: "mujoco": MuJoCo's C engine, on threads; "warp": MuJoCo Warp, on a GPU.
        options: those of `OrganismVectorEnv`, or of `WarpVectorEnv`.

    Raises:
        OptionError: there is no such engine, or an option is unknown or out of range.
        MissingExtraError: the engine needs an extra that is not installed.
    """
    check_choice("backend", backend, ENGINES, OptionError)
    if backend == "mujoco":
        return OrganismVectorEnv(num_envs, **options)
    from symbrion_gym.warp.warp_vector_env import WarpVectorEnv

    return WarpVectorEnv(num_envs, **options)
