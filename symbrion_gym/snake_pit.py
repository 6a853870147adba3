"""The Gymnasium environment: a body of docked Scouts has to get across."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium import spaces

from symbrion_gym.config import SnakePitConfig
from symbrion_gym.episodes import Episodes
from symbrion_gym.randomisation import Domain, draw_domain
from symbrion_gym.scout import find_track_field
from symbrion_gym.world import Physics, World


class SnakePitEnv(gym.Env[np.ndarray, np.ndarray]):
    """A snake of docked Scouts has to cross a pit."""

    metadata = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array", "depth_array", "rgbd_tuple"],
        "render_fps": 50,
    }

    def __init__(
        self, render_mode: str | None = None, width: int = 640, height: int = 400, **options: Any
    ) -> None:
        self.config = SnakePitConfig.from_options(options)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.config.dt)}
        self.render_mode = render_mode
        self.width, self.height = width, height
        self.world = World(self.config)
        self.model = self.world.model
        self.data = mujoco.MjData(self.model)
        self._control = self.data.ctrl[None]
        self._physics = self._view()
        self._episodes = Episodes(self.world, 1)
        self.observation_structure = self._episodes.observer.structure
        self.action_space, self.observation_space = make_spaces(self._episodes)
        self.domain = self._usual = make_usual_domain(self.world)

    def _view(self) -> Physics:
        return self.world.view(lambda name: getattr(self.data, name)[None])

    @property
    def dt(self) -> float:
        """Length of a control tick [s]."""
        return self.config.dt

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Lay the body down at the start."""
        super().reset(seed=seed)
        wanted = {**self.config.randomise, **(options or {})}
        self.domain = draw_domain(self._usual._asdict(), wanted, self.np_random)
        apply_domain(self.world, self.model, self.domain)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.world.lay_down(
            self.domain.start_offset, self.domain.start_lateral, self.domain.yaw
        )
        target, speed = self.data.qpos[None, self.world.hinge_qpos], np.full((1, 1), self.domain.track_speed)
        self.world.write_control(self.data.ctrl[None], target, speed)
        mujoco.mj_forward(self.model, self.data)
        if not self.world.is_sliced:
            self._control = self.data.ctrl[None]
        self._physics = self._view()
        self._episodes.begin(slice(None), self._physics, self.domain.track_speed)
        observation = self._episodes.observe(self._physics)[0]
        info = {name: value[0] for name, value in self._episodes.describe_start(self._physics).items()}
        return self._add_noise(observation), {**info, **self.domain._asdict()}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass."""
        actions = np.asarray(action, dtype=np.float64)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"an action has shape {self.action_space.shape}, got {actions.shape}")
        episodes, world = self._episodes, self.world
        target = episodes.command(actions[None])
        speed = episodes.command_tracks()
        world.write_control(self._control, target, speed)
        if episodes.num_tracks:
            self.model.geom_surfacevel[world.track_geoms, 4] = speed.T / world.wheel_radius
        mujoco.mj_step(self.model, self.data, nstep=self.config.frame_skip)
        if not world.is_sliced:
            self._physics = self._view()
        outcome = self._episodes.finish_tick(self._physics)
        info = {name: value[0] for name, value in outcome.info.items()}
        if info["diverged"]:
            mujoco.mj_resetData(self.model, self.data)
        observation = self._add_noise(outcome.observation[0])
        return (
            observation,
            float(outcome.reward[0]),
            bool(outcome.terminated[0]),
            bool(outcome.truncated[0]),
            info,
        )

    def _add_noise(self, observation: np.ndarray) -> np.ndarray:
        if not self.config.noise:
            return observation
        return add_noise(observation, self._episodes, self.np_random)


def make_spaces(episodes: Episodes) -> tuple[spaces.Box, spaces.Box]:
    """Return the action and the observation space of one environment."""
    observer = episodes.observer
    return (
        spaces.Box(-1.0, 1.0, (episodes.num_actions,), dtype=np.float64),
        spaces.Box(observer.low, observer.high, dtype=np.float64),
    )


def make_usual_domain(world: World) -> Domain:
    """Return the circumstances of an episode for which nothing was asked."""
    return Domain(world.friction, 1.0, 0.0, 0.0, 0.0, world.organism.scout.track_speed)


def apply_domain(world: World, fields: Any, domain: Domain) -> None:
    """Write circumstances into a model, or into one row of a batch's fields."""
    scout = world.organism.scout
    fields.geom_friction[world.robot_geoms, 0] = domain.friction
    torque = scout.hinge_torque * domain.torque_scale
    fields.actuator_forcerange[world.hinge_servos, 0] = -torque
    fields.actuator_forcerange[world.hinge_servos, 1] = torque
    if scout.tracks == "spheres":
        fields.geom_surfacevel[world.track_geoms] = find_track_field(scout, domain.track_speed)


def add_noise(observation: np.ndarray, episodes: Episodes, generator: np.random.Generator) -> np.ndarray:
    """Return one observation `[O]` with sensor noise, within its bounds."""
    observer = episodes.observer
    noisy = observation + observer.noise * generator.standard_normal(observer.size)
    return np.clip(noisy, observer.low, observer.high)
