"""The vector environment in the form of stable-baselines3 (the extra `rl`): one process, all simulations at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv


class StableBaselinesEnv(VecEnv):
    """A vector environment of `symbrion_gym` as a `VecEnv` of stable-baselines3.

    Simulations that end are reset in the same step. The `info` of an ended episode holds `terminal_observation`,
    `TimeLimit.truncated`, `is_success` and every number and flag of the environment.
    """

    def __init__(self, envs: VectorEnv) -> None:
        mode = envs.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode is {mode}; make the environment with autoreset_mode='SameStep'")
        self.envs = envs
        self._actions = np.zeros(envs.action_space.shape or ())
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> np.ndarray:
        """Reset all environments with the seeds given last, and return observations `[N, O]`."""
        has_seeds = any(seed is not None for seed in self._seeds)
        seeds: Any = list(self._seeds) if has_seeds else None
        observation, _ = self.envs.reset(seed=seeds)
        self._reset_seeds()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions `[N, A]` of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments; return observations, rewards, whether episodes ended, and one `info` each."""
        observation, reward, terminated, truncated, info = self.envs.step(self._actions)
        ended = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(ended):
            final = {name: each[row] for name, each in info["final_info"].items() if not name.startswith("_")}
            infos[row] = {
                **final,
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
                "is_success": bool(final["success"]),
            }
        return observation, reward, ended, infos

    def close(self) -> None:
        """Close all environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, once per environment."""
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all environments."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the vector environment."""
        return [getattr(self.envs, method_name)(*args, **kwargs)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Return False for each environment: none is wrapped."""
        return [False] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return one image per environment; None without a render mode."""
        frames: Any = self.envs.render()
        return [None] * self.num_envs if frames is None else list(frames)
