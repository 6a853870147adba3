"""Train PPO on a pit of 0.33 m, which the zero policy does not cross reliably, and compare the two.

pip install "symbrion-gym[rl]"
python examples/train_ppo.py --steps 400000
"""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from symbrion_gym import SnakePitVectorEnv


class BatchedEnv(VecEnv):
    """`SnakePitVectorEnv` in the clothes of stable-baselines3: resets in the same step, infos one by one."""

    def __init__(self, num_envs: int, **options: Any) -> None:
        self.envs = SnakePitVectorEnv(num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **options)
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)
        self._actions = np.zeros(self.envs.action_space.shape)

    def reset(self) -> np.ndarray:
        """Reset all."""
        seeds = [seed for seed in self._seeds if seed is not None]
        return self.envs.reset(seed=seeds if len(seeds) == self.num_envs else None)[0]

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all."""
        observation, reward, terminated, truncated, info = self.envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated):
            infos[row]["terminal_observation"] = info["final_obs"][row]
            infos[row]["TimeLimit.truncated"] = bool(truncated[row])
            infos[row]["is_success"] = bool(info["final_info"]["success"][row])
        return observation, reward, terminated | truncated, infos

    def close(self) -> None:
        """Close all."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute once for each."""
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method once."""
        return [getattr(self.envs, method_name)(*args, **kwargs)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Nothing is wrapped."""
        return [False] * self.num_envs

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Draw nothing."""
        return [None] * self.num_envs


OPTIONS = {
    "modules": 6,
    "pit": 0.33,
    "start": "pit",
    "duration": 30.0,
    "stuck_time": 6.0,
    "frame_skip": 20,
    "randomise": {"friction": (0.55, 0.7), "start_offset": (-0.05, 0.05), "yaw": (-0.05, 0.05)},
}


def judge(policy: Any, trials: int = 32) -> tuple[float, float]:
    """Return the mean progress [m] and the share of successes of `policy(observation) -> actions`."""
    envs = SnakePitVectorEnv(trials, autoreset_mode=AutoresetMode.DISABLED, **OPTIONS)
    observation, info = envs.reset(seed=10_000)
    done = np.zeros(trials, dtype=bool)
    while not done.all():
        observation, _, terminated, truncated, info = envs.step(policy(observation))
        done |= terminated | truncated
    return float(info["progress"].mean()), float(info["success"].mean())


def main() -> None:
    """Train, then compare with the zero policy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=400_000)
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    envs = VecNormalize(BatchedEnv(options.envs, **OPTIONS), clip_obs=5.0)
    model = PPO("MlpPolicy", envs, n_steps=256, batch_size=512, seed=options.seed, device="cpu", verbose=1)
    model.learn(options.steps)
    size = envs.action_space.shape
    zero = judge(lambda observation: np.zeros((len(observation), *size)))
    envs.training = False
    ppo = judge(lambda observation: model.predict(envs.normalize_obs(observation), deterministic=True)[0])
    for name, (progress, successes) in (("zero", zero), ("PPO", ppo)):
        print(f"{name}: progress {progress:.3f} m, {100 * successes:.0f} % crossed")  # noqa: T201


if __name__ == "__main__":
    main()
