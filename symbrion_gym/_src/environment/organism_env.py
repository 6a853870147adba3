"""The Gymnasium environment: an organism of docked Scouts has to get across."""

from typing import Any, NoReturn

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium import spaces

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.episodes import Episodes
from symbrion_gym._src.environment.randomization import begin_episode, draw_domain, make_nominal_domain
from symbrion_gym._src.environment.rendering import RENDER_MODES, SceneRenderer
from symbrion_gym._src.environment.world import Physics, World
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.registration import KnowsLimits
from symbrion_gym._src.sensing.timing import timing
from symbrion_gym._src.tasks.paths import PathRoute


class OrganismEnv(KnowsLimits, gym.Env[np.ndarray, np.ndarray]):  # pyright: ignore[reportIncompatibleVariableOverride]
    """An organism of docked Scouts has to cross a pit, climb stairs or a ramp, or reach a place on scanned ground.

    By default: two ramps, a plateau with a pit between them, and a snake of modules whose tracks always run (paper,
    section III). The actions move the hinges. This text is the specification.

    ## Action

    `Box(-1, 1, (A,))`. A control step (tick) lasts `timestep * frame_skip`, 20 ms. Values beyond ±1 are clipped;
    NaN, infinity or another shape is a `ValueError`.

    | index    | meaning                                                        | -1 ... 1             |
    |----------|----------------------------------------------------------------|----------------------|
    | i        | target of hinge i, between modules i and i + 1 from the head; positive lifts the part ahead | ±90° |
    | n - 1 ...| track speeds, with `track_control`: "body" 1, "modules" n      | ± `track_speed`      |

    The servo's target moves towards the commanded angle at 0.8 rad/s; its torque is limited to `hinge_torque`.

    ## Observation

    `Box`, float64. `observation_structure` maps names to slices; `sensors` selects parts and their order.
    Positions of modules are those of the last physics step (5 ms) before the end of the tick; infrared and
    laser are read once per tick. n is the number of modules, listed from head to tail; h = n - 1 hinges.

    | part              | size   | meaning                                                    | range      |
    |-------------------|--------|------------------------------------------------------------|------------|
    | `hinge_angle`     | h      | [rad]                                                      | ±1.73      |
    | `hinge_rate`      | h      | [rad/s]                                                    | ±20        |
    | `pitch`           | n      | nose up is positive [rad]                                  | ±π/2       |
    | `roll`            | n      | left side up is positive [rad]                             | ±π         |
    | `acceleration`    | 6n     | front x y z, rear x y z of each module, including gravity [m/s²] | ±39.24 |
    | `ir`              | 2 a free side | distance [m] of front, back, left, right of each module | 0 ... 0.2 |
    | `contact`         | n      | sum of the normal forces on a module [N]                   | 0 ... 50   |
    | `previous_action` | A      | the previous action, after clipping                        | ±1         |
    | `hinge_target`*   | h      | commanded angle of the servo [rad]                         | ±π/2       |
    | `dock_force`*     | 3h     | force between neighbors [N]                                | ±500       |
    | `odometry`*       | 1      | ground-truth distance traveled by the head along the route [m] | ±100   |
    | `track_odometry`* | 1      | position of the head by dead reckoning, from the middle of the pit [m] | ±100 |
    | `laser`*          | 19     | ranges of a vertical scan ahead of the head, -60° to 30° [m] | 0 ... 4  |
    | `goal`*           | 2      | place to head for, ahead of the head and to its left [m]   | ±100       |
    | `goal_direction`* | 2      | its bearing (left: +) and distance, by dead reckoning [rad, m] | ±π, 0 ... 100 |

    * optional: part of the observation only if `sensors` names it.

    `odometry` is what an external localization would measure. `track_odometry` is the robot's own estimate: it begins
    with the start position on the map (without a pit, relative to the origin of the map), and in every tick adds the
    distance that the head's tracks run, times the cosine of its pitch. It does not contain slip, `start_offset`, `yaw`
    and `stretch`. `goal_direction` is an estimate likewise, in the plane: the speeds of all tracks and the tilt of the
    modules turn and move a pose from the start on the map. Of several places, the next is headed for from 0.7 of
    the distance at which one counts as reached. `goal` is the truth. In tasks without a place to head
    for, as one of your own may be, `goal` is zero and `goal_direction` 100 m ahead of the start.

    ## Reward

    | term in `info`   | value                                                                         |
    |------------------|-------------------------------------------------------------------------------|
    | `reward_forward` | `forward_weight` x change of progress [m], which a failure takes back             |
    | `reward_success` | `success_bonus` once, on success                                              |
    | `reward_failure` | -`failure_cost` once, on a failure; a parameter of the task, 1 unless given   |
    | `reward_effort`  | -`effort_weight` x work of the hinges [J]                                     |

    Progress is the mean position of the modules along the route, each counted up to the finish.

    ## Episode

    Success: for 0.3 s, every module is past the finish (completely beyond the far edge of the pit), at ground height
    (center 2 to 7.5 cm above the ground) and upright (z of its up axis above 0.5), and the body was not faster than
    its tracks (5 cm tolerance). Terminated: on success; `rolled_over`: z of a module's up axis below -0.3; `fell`: off
    the side of the arena; `touched_pit`: with `bottomless`; `diverged`: the simulation is numerically unstable (the
    reward is finite). Truncated: after `duration`, or `stuck`: progress of at most `stuck_progress` within
    `stuck_time`. Modules collide with each other, except adjacent ones.

    ## Options

    | option                | default   | meaning                                                         |
    |-----------------------|-----------|-----------------------------------------------------------------|
    | `arena`               | "truth"   | a name, a folder, a mesh file or an `Arena`                     |
    | `modules`             | 8         | length of the snake, or an `Organism`                           |
    | `pit`                 | None      | width of the pit [m], of `truth` and `simple`; `default_pit` if None |
    | `default_pit`         | None      | None: 0.45 m                                                    |
    | `course`              | {}        | sizes of an arena made in code, of `Course` or `StairsCourse`   |
    | `default_course`      | {}        | name of such an arena -> sizes that an id sets                  |
    | `progress`            | None      | called while a surface in a file is made an arena; None: logged |
    | `stretch`             | 1.0       | factor on all lengths along x: simulates errors of a scan       |
    | `friction`            | None      | sliding friction of the robot on the ground; None: the arena's  |
    | `track_speed`         | 0.10      | surface speed of the tracks [m/s]                               |
    | `hinge_torque`        | 4.5       | largest torque of a hinge [N m]                                 |
    | `sensors`             | see above | parts of the observation                                        |
    | `noise`               | 0.0       | 1: sensor noise as estimated for the real robot                 |
    | `track_control`       | "constant"| "body", "modules", "skid": track speeds are part of the action  |
    | `timestep`            | 0.005     | physics step, 0.0001 to 0.02 [s]                                |
    | `frame_skip`          | 4         | physics steps per tick                                          |
    | `timers`              | False     | `info` contains `physics_us`, `collision_us`, `raycast_us`      |
    | `randomize`           | {}        | reset options that apply to every episode                       |
    | `sensor_noise`        | None      | a `SensorNoise`: standard deviations at `noise` 1               |
    | `task`                | None      | a `Task`, or a name of `symbrion_gym.tasks.TASKS`; None: `default_task` |
    | `task_parameters`     | {}        | parameters of a named task; they can be given as options, too   |
    | `recorders`           | ()        | what `read_records` returns, of `symbrion_gym._src.tasks.recorders`  |
    | `default_task`        | "snake_pit" | the task of an id                                             |
    | `default_parameters`  | {}        | parameters that an id sets for its own task                     |
    | `start`               | None      | "floor": before the ramp; "pit": 0.2 m before the pit; or (x, y) [m] |
    | `goal`                | None      | (x, y) to be reached [m]; None: far side of course or pit       |
    | `bottomless`          | None      | True: touching the floor of the pit ends the episode            |
    | `duration`            | None      | longest episode, at most 10 million physics steps [s]           |
    | `stuck_time`          | None      | an episode without progress for this long is truncated [s]      |
    | `stuck_progress`      | None      | smallest progress that counts, for `stuck` [m]                  |
    | `forward_weight`      | None      | reward per meter of progress                                    |
    | `success_bonus`       | None      | reward of a success                                             |
    | `effort_weight`       | None      | penalty per joule of work of the hinges                         |
    | `organism`            | None      | the body in place of `modules`: a number, name, body plan or file |
    | `render_mode`, `width`, `height` | None, 640, 400 | "human", "rgb_array", "depth_array", "rgbd_tuple"   |

    From `start` on, and before `organism`, the options are parameters of the task; None is the task's own value. Those
    of "snake_pit" are "floor", None, False, 90, 15, 0.02, 1, 1 and 0.002; other tasks have others
    (`symbrion_gym.make_task` names them), which are options as well.

    Reset options, each a number or a pair (low, high) to sample from uniformly: `friction`, `torque_scale` (factor on
    the hinge torque), `start_offset` (displacement of the start along the route [m]), `start_lateral` (the same to the
    left [m]), `yaw` (rotation about the head [rad]), `track_speed` [m/s]. `info` of a reset contains the values used.

    `info` also contains `x_position` (position of the head along the route, which is x on courses [m]), `progress`
    since the start [m], `time` [s], `lowest_module` (height of the lowest module [m]), `least_upright` (z of the up
    axis of the module that leans most), and the flags `success`, `diverged`, `rolled_over`, `fell`, `touched_pit`,
    `stuck`. `reason` is the flag that ended the episode, or "timeout", and "" as long as it goes on.
    Other tasks have flags and terms of the reward of their own.

    In an arena with a `friction_map`, `friction` holds outside of its patches. The friction of a patch keeps its ratio
    to that of the arena: with `friction` at half the arena's, all patches have half of theirs. The reset option
    `patch_friction` moves them within their intervals: 0 is the middle, -1 and 1 are the ends of the 95 % interval.

    `RecordVideo` of Gymnasium needs moviepy: `pip install symbrion-gym[video]`, whatever its own message says.

    Raises:
        OptionError: an option is unknown or out of range (a `ValueError`); the message says what is allowed.
        ArenaError: there is no such arena, or it does not have the start or goal.
        OrganismError: the organism is impossible, for example because modules overlap.

    References:
        Russo et al. (2013), IEEE/ASME Trans. Mechatronics 18(6): the Scout.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012

    def __init__(
        self, render_mode: str | None = None, width: int = 640, height: int = 400, **options: Any
    ) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise OptionError(f"no render mode {render_mode!r}; there are: {', '.join(RENDER_MODES)}")
        self.config = EnvironmentConfig.from_options(options, ("render_mode", "width", "height"))
        self.dt = self.config.dt  # Length of a control tick [s]
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.dt)}
        self.render_mode, self.width, self.height = render_mode, width, height
        self.world = World(self.config, (width, height))
        self.model = self.world.model
        self.data = mujoco.MjData(self.model)
        self._episodes = Episodes(self.world, 1)
        self.observation_structure = self._episodes.observer.structure
        self.action_space, self.observation_space = make_spaces(self._episodes)
        self._action_shape = self.action_space.shape
        self.domain = make_nominal_domain(self.world)
        self._renderer: SceneRenderer | None = None
        self._find_views()

    def _find_views(self) -> None:
        self._control = self.data.ctrl[None]
        self._physics = self.world.view(lambda name: getattr(self.data, name)[None])

    @property
    def physics(self) -> Physics:
        """The present state as a batch of one."""
        if not self.world.is_sliced:
            self._find_views()
        return self._physics

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Place the organism at the start and begin an episode.

        Args:
            seed: seed of all random numbers of the environment from now on.
            options: reset options of this episode; see the class.

        Raises:
            OptionError: an unknown option or a value out of range.
        """
        super().reset(seed=seed)
        world, data = self.world, self.data
        self.domain = draw_domain(world, options or {}, self.np_random)
        mujoco.mj_resetData(self.model, data)
        begin_episode(world, self.domain, self.model, data.qpos, data.ctrl)
        mujoco.mj_forward(self.model, data)
        physics = self.physics
        self._episodes.begin(physics, [0], [self.domain.track_speed])
        info = {**self._episodes.describe(0), **self.domain._asdict()}
        if self._renderer is not None:
            self._renderer.follow(physics.position[0], at_once=True)
        if self.render_mode == "human":
            self.render()
        return self._observe(physics), info

    def _observe(self, physics: Physics) -> np.ndarray:
        observation = self._episodes.observe(physics)[0]
        if self.config.noise:
            return self._episodes.observer.add_noise(observation, self.np_random)
        return observation

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Apply an action and simulate one tick.

        Raises:
            ValueError: an action of another shape.
        """
        actions = np.asarray(action, dtype=np.float64)
        if actions.shape != self._action_shape:
            raise ValueError(f"an action has shape {self._action_shape}, got {actions.shape}")
        episodes, world = self._episodes, self.world
        target, speed = episodes.command(actions[None])
        self._control[:, world.servos] = target
        if episodes.commands.num_tracks:
            world.write_track_speed(self.model.geom_surfacevel[None], speed)
        measured = self._advance()
        physics = self._physics if world.is_sliced else self.physics
        reward, terminated, truncated, has_ended = episodes.finish_tick(physics)
        info = episodes.describe(0)
        observation = self._observe(physics)
        if info["diverged"]:
            mujoco.mj_resetData(self.model, self.data)
        if self.render_mode == "human":
            self.render()
        is_over, is_cut = (terminated.item(), truncated.item()) if has_ended else (False, False)
        return observation, reward.item(), is_over, is_cut, {**info, **measured} if measured else info

    def read_records(self) -> dict[str, Any]:
        """Return what the option `recorders` kept of the present episode, by name."""
        return self._episodes.read_records(0)

    def _advance(self) -> dict[str, float]:
        """Step the physics of a tick; return the times of MuJoCo's timers if the option `timers` is set."""
        if not self.config.timers:
            mujoco.mj_step(self.model, self.data, nstep=self.config.frame_skip)
            return {}
        with timing(self.data) as measured:
            mujoco.mj_step(self.model, self.data, nstep=self.config.frame_skip)
        return {name: getattr(measured, name) for name in ("physics_us", "collision_us", "raycast_us")}

    def render(self) -> Any:
        """Return an image in the render mode; None without one and in a window.

        `gymnasium.wrappers.RecordVideo` joins them to a video; it needs the extra: `pip install symbrion-gym[video]`.
        """
        if self.render_mode is None:
            gym.logger.warn("render() does nothing without a render_mode; give one of render_modes to make()")
            return None
        if self._renderer is None:
            self._renderer = make_renderer(self.world, self.data, self.width, self.height)
        self._renderer.follow(self.physics.position[0])
        return self._renderer.render(self.render_mode)

    def close(self) -> None:
        """Release renderer and window."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __deepcopy__(self, memo: dict[int, Any]) -> NoReturn:
        """Refuse a copy, whose views of the physics would be of this environment."""
        raise TypeError("an environment is not copied; make another one, and repeat seed and actions there")


def make_spaces(episodes: Episodes) -> tuple[spaces.Box, spaces.Box]:
    """Return the action and the observation space of one environment."""
    observer = episodes.observer
    return (
        spaces.Box(-1.0, 1.0, (episodes.commands.num_actions,), dtype=np.float64),
        spaces.Box(observer.low, observer.high, dtype=np.float64),
    )


def make_renderer(world: World, data: mujoco.MjData, width: int, height: int) -> SceneRenderer:
    """Return what makes images of a simulation."""
    length = world.num_modules * world.organism.scout.pitch
    route, quality = world.route, world.arena.quality
    places = route.places if isinstance(route, PathRoute) else ()
    return SceneRenderer(world.model, data, width, height, length, route.heading, quality, places)
