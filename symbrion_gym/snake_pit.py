"""The Gymnasium environment: a body of docked Scouts has to get across."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium import spaces

from symbrion_gym.config import SnakePitConfig
from symbrion_gym.episodes import FLAGS, NUMBERS, Episodes
from symbrion_gym.observation import add_noise
from symbrion_gym.randomisation import apply_domain, draw_domain, make_usual_domain
from symbrion_gym.rendering import RENDER_MODES, Pictures
from symbrion_gym.world import Physics, World

_NAMES = NUMBERS + FLAGS


class SnakePitEnv(gym.Env[np.ndarray, np.ndarray]):
    """A snake of docked Scouts has to cross a pit."""

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 400,
        **options: Any,
    ) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(f"no render mode {render_mode!r}; there are: {', '.join(RENDER_MODES)}")
        self.config = SnakePitConfig.from_options(options)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.config.dt)}
        self.render_mode, self.width, self.height = render_mode, width, height
        self.world = World(self.config, (width, height))
        self.model = self.world.model
        self.data = mujoco.MjData(self.model)
        self._episodes = Episodes(self.world, 1)
        self.observation_structure = self._episodes.observer.structure
        self.action_space, self.observation_space = make_spaces(self._episodes)
        self.domain = self._usual = make_usual_domain(self.world)
        self._pictures: Pictures | None = None
        self._clock = None
        self._find_views()

    def _find_views(self) -> None:
        self._control = self.data.ctrl[None]
        self._physics = self.world.view(lambda name: getattr(self.data, name)[None])

    @property
    def dt(self) -> float:
        """Length of a control tick [s]."""
        return self.config.dt

    @property
    def physics(self) -> Physics:
        """The present state as a batch of one."""
        if not self.world.is_sliced:
            self._find_views()
        return self._physics

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Lay the body down at the start.

        Args:
            seed: of everything random from here on.
            options: what is special about this episode; see the class.

        Raises:
            ValueError: an unknown option or a value out of range.
        """
        super().reset(seed=seed)
        world, wanted = self.world, {**self.config.randomise, **(options or {})}
        self.domain = domain = draw_domain(self._usual._asdict(), wanted, self.np_random)
        apply_domain(world, self.model, domain)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = world.lay_down(domain.start_offset, domain.start_lateral, domain.yaw)
        target, speed = self.data.qpos[None, world.hinge_qpos], np.full((1, 1), domain.track_speed)
        world.write_control(self._control, target, speed)
        mujoco.mj_forward(self.model, self.data)
        physics = self.physics
        self._episodes.begin([0], physics, [domain.track_speed])
        observation = self._episodes.observe(physics)
        numbers = self._episodes.describe_start(physics, 0)
        info = {**dict(zip(_NAMES, numbers, strict=True)), **domain._asdict()}
        if self._pictures is not None:
            self._pictures.follow(physics.position[0], at_once=True)
        if self.render_mode == "human":
            self.render()
        return self._add_noise(observation)[0], info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass.

        Raises:
            ValueError: an action of another shape.
        """
        actions = np.asarray(action, dtype=np.float64)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"an action has shape {self.action_space.shape}, got {actions.shape}")
        episodes, world = self._episodes, self.world
        target, speed = episodes.command(actions[None])
        world.write_control(self._control, target, speed)
        if episodes.num_tracks:
            world.write_track_speed(self.model.geom_surfacevel[None], speed)
        mujoco.mj_step(self.model, self.data, nstep=self.config.frame_skip)
        physics = self.physics
        tick = episodes.finish_tick(physics, (0,))[0]
        observation = self._add_noise(episodes.observe(physics))
        info: dict[str, Any] = dict(zip(_NAMES, tick.numbers + tick.flags, strict=True))
        if info["diverged"]:
            mujoco.mj_resetData(self.model, self.data)
        if self.render_mode == "human":
            self.render()
        return observation[0], tick.reward, tick.terminated, tick.truncated, info

    def render(self) -> Any:
        """Return a picture in the render mode; None without one and in a window."""
        if self.render_mode is None:
            gym.logger.warn("render() does nothing without a render_mode; give one of render_modes to make()")
            return None
        if self._pictures is None:
            length = self.world.num_modules * self.world.organism.scout.pitch
            size = (self.width, self.height)
            self._pictures = Pictures(self.model, self.data, *size, length, self.world.route.heading)
        self._pictures.follow(self.physics.position[0])
        return self._pictures.draw(self.render_mode)

    def close(self) -> None:
        """Free what pictures and windows need."""
        if self._pictures is not None:
            self._pictures.close()
            self._pictures = None

    def __deepcopy__(self, memo: dict[int, Any]) -> SnakePitEnv:
        """Return an independent copy in the same state, without window or graphics context."""
        twin = object.__new__(type(self))
        memo[id(self)] = twin
        shared = {"world", "config", "_pictures", "_physics", "_control"}
        for name, value in self.__dict__.items():
            twin.__dict__[name] = value if name in shared else copy.deepcopy(value, memo)
        twin._pictures = None
        twin._find_views()
        return twin

    def _add_noise(self, observation: np.ndarray) -> np.ndarray:
        if self.config.noise:
            observation[0] = add_noise(observation[0], self._episodes.observer, self.np_random)
        return observation


def make_spaces(episodes: Episodes) -> tuple[spaces.Box, spaces.Box]:
    """Return the action and the observation space of one environment."""
    observer = episodes.observer
    return (
        spaces.Box(-1.0, 1.0, (episodes.num_actions,), dtype=np.float64),
        spaces.Box(observer.low, observer.high, dtype=np.float64),
    )
