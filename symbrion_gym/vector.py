"""The environment many at once: one `mujoco.batch.Batch` steps all simulations on threads."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco.batch import Batch

from symbrion_gym.config import SnakePitConfig
from symbrion_gym.episodes import Episodes, Outcome
from symbrion_gym.randomisation import Domain, draw_domain, split_options
from symbrion_gym.snake_pit import SnakePitEnv, add_noise, apply_domain, make_spaces, make_usual_domain
from symbrion_gym.world import World


class SnakePitVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many `SnakePitEnv` at once, equal to them to the bit for equal seeds and actions."""

    metadata = {  # noqa: RUF012
        **SnakePitEnv.metadata,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        num_threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs must be at least 1, got {num_envs}")
        self.config = SnakePitConfig.from_options(options)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self.autoreset_mode,
            "render_fps": round(1.0 / self.config.dt),
        }
        self.render_mode = render_mode
        self.num_envs = int(num_envs)
        self.world = World(self.config)
        self.model = self.world.model
        self._max_ticks = max_episode_steps
        self._make_batch(num_threads)
        self._episodes = Episodes(self.world, self.num_envs)
        self.observation_structure = self._episodes.observer.structure
        self.single_action_space, self.single_observation_space = make_spaces(self._episodes)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._usual = make_usual_domain(self.world)
        self._generators = [seeding.np_random(None)[0] for _ in range(self.num_envs)]
        self._options: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._is_done = np.ones(self.num_envs, dtype=bool)
        self._last_info: dict[str, np.ndarray] = {}

    def _make_batch(self, num_threads: int | None) -> None:
        threads = min(num_threads or os.cpu_count() or 1, self.num_envs)
        self.batch = Batch(self.model, self.num_envs, threads)
        batch, world = self.batch, self.world
        self._fields = {
            name: batch.expand(name) for name in ("geom_friction", "actuator_forcerange", "geom_surfacevel")
        }
        self._qpos, self._qvel, self._ctrl = batch.bind("qpos"), batch.bind("qvel"), batch.bind("ctrl")
        self._physics = world.view(batch.bind)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Lay the bodies down at their starts.

        Args:
            seed: environment i gets `seed + i`, or `seed[i]`.
            options: as of `SnakePitEnv.reset`, with an array for a value each; they hold for later automatic
                resets too. `reset_mask` `[num_envs]` resets only some.
        """
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)), dtype=bool)
        if mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask has shape {mask.shape}; give one value for each of {self.num_envs}")
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int | np.integer) else seed
        if seeds is not None:
            if len(seeds) != self.num_envs:
                raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments; give one each")
            for i in np.flatnonzero(mask):
                if seeds[i] is not None:
                    self._generators[i] = seeding.np_random(int(seeds[i]))[0]
        split = split_options(options, self.num_envs)
        for i in np.flatnonzero(mask):
            self._options[i] = split[i]
        domains = self._begin(np.flatnonzero(mask))
        observation = self._add_noise(self._episodes.observe(self._physics), mask)
        info = self._episodes.describe_start(self._physics)
        for name in Domain._fields:
            info[name] = np.zeros(self.num_envs)
            info[name][mask] = [getattr(domain, name) for domain in domains]
        return observation, _add_masks(info, mask)

    def _begin(self, ids: np.ndarray) -> list[Domain]:
        """Lay down the bodies of some simulations; return their circumstances."""
        world, domains = self.world, []
        self.batch.reset(ids, stage=0)
        for i in ids:
            wanted = {**self.config.randomise, **self._options[int(i)]}
            domain = draw_domain(self._usual._asdict(), wanted, self._generators[int(i)])
            apply_domain(world, _Row(self._fields, i), domain)
            self._qpos[i] = world.lay_down(domain.start_offset, domain.start_lateral, domain.yaw)
            target, speed = self._qpos[[i]][:, world.hinge_qpos], np.full((1, 1), domain.track_speed)
            world.write_control(self._ctrl[i : i + 1], target, speed)
            domains.append(domain)
        self.batch.forward(ids)
        if not world.is_sliced:
            self._physics = world.view(self.batch.bind)
        self._episodes.begin(ids, self._physics, np.array([domain.track_speed for domain in domains]))
        self._is_done[ids] = False
        return domains

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass in every simulation that is not done."""
        actions = np.asarray(actions, dtype=np.float64)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"actions have shape {self.action_space.shape}, got {actions.shape}")
        was_done = self._is_done.copy()
        running = np.flatnonzero(~was_done)
        outcome = self._advance(actions, running)
        terminated, truncated = outcome.terminated & ~was_done, outcome.truncated & ~was_done
        observation, reward, info = outcome.observation, np.where(was_done, 0.0, outcome.reward), outcome.info
        observation = self._add_noise(observation, ~was_done)
        self._is_done = was_done | terminated | truncated
        info = _add_masks(dict(info), ~was_done)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and was_done.any():
            observation = self._restart(np.flatnonzero(was_done), observation)
        ended = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and ended.any():
            info["final_obs"] = np.array(
                [row.copy() if end else None for row, end in zip(observation, ended, strict=True)],
                dtype=object,
            )
            info["_final_obs"] = ended.copy()
            info["final_info"] = {
                name: np.copy(value) for name, value in info.items() if not name.endswith("final_obs")
            }
            info["_final_info"] = ended.copy()
            observation = self._restart(np.flatnonzero(ended), observation)
        return observation, reward, terminated, truncated, info

    def _advance(self, actions: np.ndarray, running: np.ndarray) -> Outcome:
        episodes = self._episodes
        target = episodes.command(actions)
        speed = episodes.command_tracks()
        self.world.write_control(self._ctrl, target, speed)
        if episodes.num_tracks:
            self._fields["geom_surfacevel"][:, self.world.track_geoms, 4] = (speed / self.world.wheel_radius)[
                :, :, None
            ]
        self.batch.step(running, nstep=self.config.frame_skip)
        if not self.world.is_sliced:
            self._physics = self.world.view(self.batch.bind)
        is_running = ~self._is_done
        outcome = episodes.finish_tick(self._physics, is_running)
        if self._is_done.any():
            for name, value in outcome.info.items():
                outcome.info[name] = np.where(is_running, value, self._last_info.get(name, value))
        self._last_info = outcome.info
        if self._max_ticks is not None:
            late = ~outcome.terminated & (episodes.ticks >= self._max_ticks)
            outcome = outcome._replace(truncated=outcome.truncated | late)
        diverged = np.flatnonzero(outcome.info["diverged"])
        if len(diverged):
            self.batch.reset(diverged)
        return outcome

    def _restart(self, ids: np.ndarray, observation: np.ndarray) -> np.ndarray:
        self._begin(ids)
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[ids] = True
        return np.where(
            mask[:, None], self._add_noise(self._episodes.observe(self._physics), mask), observation
        )

    def _add_noise(self, observation: np.ndarray, mask: np.ndarray) -> np.ndarray:
        if self.config.noise:
            for i in np.flatnonzero(mask):
                observation[i] = add_noise(observation[i], self._episodes, self._generators[i])
        return observation


class _Row:
    """One simulation's part of the batch's model fields, written as those of a model."""

    def __init__(self, fields: dict[str, np.ndarray], row: int) -> None:
        for name, values in fields.items():
            setattr(self, name, values[row])


def _add_masks(info: dict[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """Add Gymnasium's `_name` masks: which environments a value of `info` is about."""
    for name in list(info):
        if not name.startswith("_"):
            info[f"_{name}"] = mask
    return info
