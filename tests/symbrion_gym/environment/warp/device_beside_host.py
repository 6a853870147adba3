"""An environment of the host, and the tick of a device that sees the same physics of the C engine."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.warp.device_vector_env import StartingEnv
from symbrion_gym._src.environment.warp.tick import DeviceTick
from symbrion_gym._src.environment.world import Physics

NUM = 4
RANDOM = {"friction": (0.5, 0.9), "yaw": (-0.1, 0.1), "track_speed": (0.08, 0.12)}
CLOSE = 1e-5
"""Of numbers that are all below 100, in single precision."""


class Both:
    """An environment of the host, and the tick of a device that sees the same physics."""

    def __init__(self, **options: Any) -> None:
        self.envs = OrganismVectorEnv(NUM, 1, "Disabled", **options)
        self.observation, self.info = self.envs.reset(seed=3)
        self.host = StartingEnv(NUM, 1, options)
        starts = self.host.draw([3 + i for i in range(NUM)], [{}] * NUM)
        self.episode = jax.tree.map(jnp.asarray, starts.episode)
        tick = DeviceTick(self.envs.world, self.host.episodes, NUM, None)
        self._command, self._finish = jax.jit(tick.command), jax.jit(tick.finish)
        self.running = np.ones(NUM, dtype=bool)

    def step(self, actions: np.ndarray, unstable: int | None = None) -> None:
        """Let a tick pass on both, and compare what they say of the simulations that run.

        Args:
            actions: of all simulations.
            unstable: one that the host has found so, and has set back since.
        """
        commanded, sent, _ = self._command(self.episode, jnp.asarray(actions, dtype=jnp.float32))
        self.observation, reward, terminated, truncated, self.info = self.envs.step(actions)
        control = self.envs.batch.bind("ctrl")
        np.testing.assert_allclose(sent[self.running], control[self.running], atol=CLOSE)
        physics = Physics(*(each.copy() for each in self.envs.world.view(self.envs.batch.bind)))
        if unstable is not None:
            physics.qvel[unstable] = physics.position[unstable] = np.nan
        single = Physics(*(jnp.asarray(each, jnp.float32) for each in physics))  # pyright: ignore
        self.episode, gained, over, cut = self._finish(commanded, single)
        run = self.running.copy()
        names = self.host.episodes
        for found, wanted in (
            (gained, reward),
            (self._unwind(self.episode.observation), self._unwind(self.observation)),
            (self.episode.numbers, np.array([self.info[name] for name in names.number_names]).T),
        ):
            np.testing.assert_allclose(np.asarray(found)[run], wanted[run], atol=10 * CLOSE)
        flags = np.array([self.info[name] for name in names.flag_names]).T
        for found, wanted in ((over, terminated), (cut, truncated), (self.episode.flags, flags)):
            np.testing.assert_array_equal(np.asarray(found)[run], wanted[run])
        self.running &= ~(terminated | truncated)

    def _unwind(self, observation: Any) -> np.ndarray:
        """Return observations with bearings from 0 on, as pi and -pi are the same."""
        found = np.array(observation, dtype=float)
        if "goal_direction" in self.envs.observation_structure:
            first = self.envs.observation_structure["goal_direction"].start
            found[:, first] = np.abs(found[:, first])
        return found


def run(both: Both, ticks: int, low: float, high: float) -> None:
    """Take random actions, new ones every 25 ticks, until all episodes are over."""
    rng = np.random.default_rng(0)
    for tick in range(ticks):
        if tick % 25 == 0:
            actions = rng.uniform(low, high, both.envs.action_space.shape)
        both.step(actions)
        if not both.running.any():
            return
