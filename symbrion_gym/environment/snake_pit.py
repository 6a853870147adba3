"""The Gymnasium environment: an organism of docked Scouts has to get across."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium import spaces

from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.environment.episodes import Episodes, Start
from symbrion_gym.environment.observation import add_noise
from symbrion_gym.environment.randomization import apply_domain, draw_domain, make_nominal_domain
from symbrion_gym.environment.rendering import RENDER_MODES, SceneRenderer
from symbrion_gym.environment.world import Physics, World
from symbrion_gym.errors import OptionError
from symbrion_gym.sensing.timing import timing


class SnakePitEnv(gym.Env[np.ndarray, np.ndarray]):
    """An organism of docked Scouts has to cross a pit, climb stairs or a ramp, or reach a place on scanned ground.

    Two ramps, a plateau with a pit between them, and a snake of modules with tracks that always run (paper,
    section III). The search is for what the hinges do. This text is the specification.

    ## Action

    `Box(-1, 1, (A,))`. A tick lasts `timestep * frame_skip`, 20 ms. Numbers beyond ±1 are clipped; not a
    number leaves what it commands as it was; another shape is a `ValueError`.

    | index    | meaning                                                        | -1 ... 1             |
    |----------|----------------------------------------------------------------|----------------------|
    | i        | target of hinge i, between modules i and i + 1 from the head; positive lifts what is ahead | ±90° |
    | n - 1 ...| track speeds, with `track_control`: "body" 1, "modules" n      | ± `track_speed`      |

    The servo's target moves towards the wanted angle at 0.8 rad/s; its torque is limited.

    ## Observation

    `Box`, float64. `observation_structure` maps names to slices; `sensors` chooses parts and their order.
    Positions of modules are those of the last physics step (5 ms) before the end of the tick; infrared and
    laser are read once a tick. n modules from the head to the tail, h = n - 1 hinges.

    | part              | size   | meaning                                                    | range      |
    |-------------------|--------|------------------------------------------------------------|------------|
    | `hinge_angle`     | h      | [rad]                                                      | ±1.73      |
    | `hinge_rate`      | h      | [rad/s]                                                    | ±20        |
    | `pitch`           | n      | nose up is positive [rad]                                  | ±π/2       |
    | `roll`            | n      | left side up is positive [rad]                             | ±π         |
    | `acceleration`    | 6n     | front x y z, rear x y z of each module, gravity in it [m/s²] | ±39.24   |
    | `ir`              | 2 a free side | distance [m] of front, back, left, right of each module | 0 ... 0.2 |
    | `contact`         | n      | sum of the normal forces on a module [N]                   | 0 ... 50   |
    | `previous_action` | A      | as it was used                                             | ±1         |
    | `hinge_target`*   | h      | commanded angle of the servo [rad]                         | ±π/2       |
    | `dock_force`*     | 3h     | force between neighbors [N]                                | ±500       |
    | `odometry`*       | 1      | exact way of the head along the route since the start [m]  | ±100       |
    | `track_odometry`* | 1      | place of the head by dead reckoning, from the middle of the pit [m] | ±100 |
    | `laser`*          | 19     | range of the head's upright fan, -60° to 30° [m]           | 0 ... 4    |

    * only where asked for.

    `odometry` is what an external localization would measure. `track_odometry` is what the robot knows by itself: it
    begins at the start as the map has it (without a pit, from the origin of the map) and adds what the head's
    tracks run in a tick, times the cosine of its pitch. It knows neither slip nor `start_offset`, `yaw` and
    `stretch`.

    ## Reward

    | term in `info`   | value                                                                         |
    |------------------|-------------------------------------------------------------------------------|
    | `reward_forward` | `forward_weight` x progress [m]: mean of how far the modules are, none beyond the finish |
    | `reward_success` | `success_bonus` once, on success                                              |
    | `reward_effort`  | -`effort_weight` x work of the hinges [J]                                     |

    ## Episode

    Success: every module lies beyond the finish (a whole module beyond the far edge of the pit), at ground
    height and upright (z of its up axis above 0.5) for 0.3 s, and the organism came no faster than its tracks.
    Terminated: on success; `rolled_over`, a module's up axis below -0.3; `fell` off the side; `touched_pit`,
    with `abyss`; `diverged`, physics gone wrong, with a finite reward. Truncated: after `duration`, or
    `stuck`, no more than `stuck_progress` in `stuck_time`. Modules collide with each other, all but neighbors.

    ## Options

    | option                | default   | meaning                                                         |
    |-----------------------|-----------|-----------------------------------------------------------------|
    | `arena`               | "truth"   | a name, a folder, a mesh file or an `Arena`                     |
    | `modules`             | 8         | length of the snake, or an `Organism`                           |
    | `pit`                 | None      | width of the pit [m], of the named courses; `default_pit` if None |
    | `default_pit`         | None      | None: 0.45 m; SnakePit-v0 and SnakeTerrain-v0 give 0.40         |
    | `stretch`             | 1.0       | all lengths along x times this: what a scan may be wrong by     |
    | `friction`            | None      | of tracks and bodies on everything; the arena's own by default  |
    | `track_speed`         | 0.10      | [m/s]                                                           |
    | `hinge_torque`        | 4.5       | [N m]                                                           |
    | `sensors`             | see above | parts of the observation                                        |
    | `start`               | "floor"   | "floor": before the ramp; "pit": 0.2 m before it; or (x, y) [m] |
    | `goal`                | None      | (x, y) to be reached by the head [m]                            |
    | `noise`               | 0.0       | 1: sensor noise as estimated for the real robot                 |
    | `abyss`               | False     | the floor of the pit ends the episode: only a bridge counts     |
    | `track_control`       | "constant"| "body", "modules": track speeds are part of the action          |
    | `tracks`              | "spheres" | "wheels", "cylinders": with joints, slower, to compare          |
    | `timestep`            | 0.005     | physics step [s]                                                |
    | `frame_skip`          | 4         | physics steps in a tick                                         |
    | `duration`            | 90        | [s]                                                             |
    | `stuck_time`          | 15        | [s]                                                             |
    | `forward_weight`      | 1         | per meter                                                       |
    | `success_bonus`       | 1         |                                                                 |
    | `effort_weight`       | 0.002     | per joule                                                       |
    | `timers`              | False     | `info` holds `physics_us`, `collision_us`, `raycast_us`         |
    | `randomize`           | {}        | reset options for every episode                                 |
    | `stuck_progress`      | 0.02      | progress that counts as moving on [m]                           |
    | `criteria`            | None      | a `SuccessCriteria`: what a success must fulfill                |
    | `margins`             | None      | a `RouteMargins`: distances that the route keeps                |
    | `pit_search`          | None      | a `PitSearch`: what counts as a pit of a scanned surface        |
    | `sensor_noise`        | None      | a `SensorNoise`: standard deviations at `noise` 1               |
    | `render_mode`, `width`, `height` | None, 640, 400 | "human", "rgb_array", "depth_array", "rgbd_tuple"   |

    Sphere tracks and wheels with joints are the same shape and cross alike. The authors' cylinders are smaller
    and carry less far: of 30 random controllers of 6 modules, three cross a pit of 0.35 m on spheres and on
    wheels, none on cylinders; at 0.30 m three, two and two. What only just crosses here may not there.

    Reset options, each a number or a pair (low, high) to draw from: `friction`, `torque_scale` (factor on the
    hinge torque), `start_offset` (along the route [m]), `start_lateral` (to its left [m]), `yaw` (about the
    head [rad]), `track_speed` [m/s]. `info` of a reset holds what was drawn.

    `info` further holds `x_position` (of the head along the route; x on courses [m]), `progress` [m], `time`
    [s], `lowest_module` (height [m]), `least_upright` (z of the up axis of the module that leans most), and
    the flags `success`, `diverged`, `rolled_over`, `fell`, `touched_pit`, `stuck`.

    Raises:
        OptionError: an option is unknown or out of range (a `ValueError`); the message says what is allowed.
        ArenaError: there is no such arena, or it has no such start.
        OrganismError: an impossible organism.

    References:
        Russo et al. (2013), IEEE/ASME Trans. Mechatronics 18(6): the Scout.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 400,
        **options: Any,
    ) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise OptionError(f"no render mode {render_mode!r}; there are: {', '.join(RENDER_MODES)}")
        self.config = SnakePitConfig.from_options(options)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.config.dt)}
        self.render_mode, self.width, self.height = render_mode, width, height
        self.world = World(self.config, (width, height))
        self.model = self.world.model
        self.data = mujoco.MjData(self.model)
        self._episodes = Episodes(self.world, 1)
        self.observation_structure = self._episodes.observer.structure
        self.action_space, self.observation_space = make_spaces(self._episodes)
        self._action_shape = self.action_space.shape
        self.domain = self._nominal = make_nominal_domain(self.world)
        self._renderer: SceneRenderer | None = None
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
        """Lay the organism down at the start.

        Args:
            seed: of everything random from here on.
            options: what differs in this episode; see the class.

        Raises:
            OptionError: an unknown option or a value out of range.
        """
        super().reset(seed=seed)
        world, wanted = self.world, {**self.config.randomize, **(options or {})}
        self.domain = domain = draw_domain(self._nominal._asdict(), wanted, self.np_random)
        apply_domain(world, self.model, domain)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = world.lay_down(domain.start_offset, domain.start_lateral, domain.yaw)
        target, speed = self.data.qpos[None, world.hinge_qpos], np.full((1, 1), domain.track_speed)
        world.write_control(self._control, target, speed)
        mujoco.mj_forward(self.model, self.data)
        physics = self.physics
        self._episodes.begin(physics, [Start(0, domain.track_speed)])
        observation = self._episodes.observe(physics)
        info = {**self._episodes.describe_start(physics, 0), **domain._asdict()}
        if self._renderer is not None:
            self._renderer.follow(physics.position[0], at_once=True)
        if self.render_mode == "human":
            self.render()
        return self._add_noise(observation)[0], info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the targets of the hinges and let a tick pass.

        Raises:
            ValueError: an action of another shape.
        """
        actions = np.asarray(action, dtype=np.float64)
        if actions.shape != self._action_shape:
            raise ValueError(f"an action has shape {self._action_shape}, got {actions.shape}")
        episodes, world = self._episodes, self.world
        target, speed = episodes.command(actions[None])
        world.write_control(self._control, target, speed)
        if episodes.num_tracks:
            world.write_track_speed(self.model.geom_surfacevel[None], speed)
        measured = self._advance()
        physics = self.physics
        reward, terminated, truncated, info = episodes.finish_tick(physics)
        observation = episodes.observe(physics)
        if self.config.noise:
            observation = self._add_noise(observation)
        if info["diverged"]:
            mujoco.mj_resetData(self.model, self.data)
        if self.render_mode == "human":
            self.render()
        return observation[0], reward, terminated, truncated, {**info, **measured} if measured else info

    def _advance(self) -> dict[str, float]:
        """Step the physics of a tick; return what MuJoCo's timers measured, where it was asked for."""
        if not self.config.timers:
            mujoco.mj_step(self.model, self.data, nstep=self.config.frame_skip)
            return {}
        with timing(self.data) as measured:
            mujoco.mj_step(self.model, self.data, nstep=self.config.frame_skip)
        return {name: getattr(measured, name) for name in ("physics_us", "collision_us", "raycast_us")}

    def render(self) -> Any:
        """Return an image in the render mode; None without one and in a window."""
        if self.render_mode is None:
            gym.logger.warn("render() does nothing without a render_mode; give one of render_modes to make()")
            return None
        if self._renderer is None:
            length = self.world.num_modules * self.world.organism.scout.pitch
            size = (self.width, self.height)
            self._renderer = SceneRenderer(self.model, self.data, *size, length, self.world.route.heading)
        self._renderer.follow(self.physics.position[0])
        return self._renderer.render(self.render_mode)

    def close(self) -> None:
        """Free what images and windows need."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __deepcopy__(self, memo: dict[int, Any]) -> SnakePitEnv:
        """Return an independent copy in the same state, without window or graphics context."""
        twin = object.__new__(type(self))
        memo[id(self)] = twin
        shared = {"world", "config", "_renderer", "_physics", "_control"}
        for name, value in self.__dict__.items():
            twin.__dict__[name] = value if name in shared else copy.deepcopy(value, memo)
        twin._renderer = None
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
