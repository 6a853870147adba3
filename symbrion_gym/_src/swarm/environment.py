"""The environment of a swarm in the form of PettingZoo: every Scout is an agent."""

from dataclasses import dataclass, fields
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from reconstruction._src.base.range_checks import check_choice, check_not_negative, check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.docks import find_groups
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.placing import find_across, find_field, scatter
from symbrion_gym._src.swarm.senses import Senses, SwarmWorld
from symbrion_gym._src.swarm.signals import NO_MESSAGE, SATURATION, Signals
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands

if TYPE_CHECKING:
    from symbrion_gym._src.swarm.film import SwarmCamera

LEVELS = {"kinematic": KinematicWorld, "dynamic": DynamicWorld}
"""All robots simply and fast; all in full contact."""
TASKS = ("cross", "assemble")  # To get beyond the pit; to dock until all robots are one body
MOST_ROBOTS = 1000
NUM_MESSAGES = 16  # Messages that a dock can send: numbers from 0 on
_NUM_DOCKS = len(SIDES)
_NUM_BEAMS = 7  # The lowest ones of the laser
_NUM_ACTIONS = 15
_BEYOND = 0.2  # Way beyond the pit that is still rewarded [m]
_LARGEST_SEED = 2**31


@dataclass(frozen=True)
class SwarmOptions:
    """Options of `swarm_v0.parallel_env`; see `SwarmEnv`."""

    arena: str | Path | Arena = "gsrm"  # a name, a folder, a mesh file or an `Arena`; with a pit for "cross"
    task: str = "cross"  # one of `TASKS`
    num_robots: int = 8  # robots, all Scouts
    duration: float = 900.0  # of an episode [s]
    success_bonus: float = 1.0  # reward of every robot once all are beyond the pit, undocked and upright
    noise: float = 1.0  # factor on the noise of the sensors; 0 for none
    fidelity: str = "kinematic"  # level of physics, one of `LEVELS`

    def __post_init__(self) -> None:
        count = self.num_robots
        if isinstance(count, bool) or not isinstance(count, Integral) or not 1 <= count <= MOST_ROBOTS:
            raise OptionError(f"num_robots must be a whole number from 1 to {MOST_ROBOTS}, got {count!r}")
        check_positive(self, ("duration",), OptionError)
        check_not_negative(self, ("success_bonus", "noise"), OptionError)
        check_choice("fidelity", self.fidelity, tuple(LEVELS), OptionError)
        check_choice("task", self.task, TASKS, OptionError)


class SwarmEnv(ParallelEnv[str, np.ndarray, np.ndarray]):
    """Scouts scattered before a pit have to get beyond it; none of them can cross it alone. Or, with the task
    "assemble", on any ground with a way ahead, to dock until all are one body.

    Motion is that of the level of physics, `fidelity`; sensors and signals are those of `Senses` and `Signals`. A
    decision lasts 0.1 s.
    This text is the specification.

    ## Agents

    `robot_0` ... `robot_N-1`, the same from the reset to the end: a robot that docks stays an agent, as a part of an
    organism that moves as one body; its tracks go on driving it. So robots come and go as bodies,
    not as agents: `docked` in its observation and `organism` in its info, the smallest number of a robot of its body,
    say what it belongs to.

    ## Action

    `Box(-1, 1, (15,))` for each agent; values beyond ±1 are clipped, what is not finite or of another shape is refused.
    An agent without an action stands still and releases its docks.

    | index | meaning | -1 ... 1 |
    |---|---|---|
    | 0, 1 | speed of the left and the right track | ± `track_speed` |
    | 2 | target angle of the hinge, positive lifts the arm; kinematic: straight where the front dock holds | ±90° |
    | 3 - 6 | docks front, back, left, right: above 0 latches, else releases | |
    | 7 - 10 | beacon of each dock: above 0 shines | |
    | 11 - 14 | message of each dock by infrared and wire: below 0 none, else one of 16 in equal steps | |

    ## Observation

    `Box`, float32, 40 numbers. Docks and sides in the order front, back, left, right.

    | index | meaning | range |
    |---|---|---|
    | 0 - 7 | distance of the infrared proximity units, two a side [m] | 0 ... 0.2 |
    | 8, 9 | pitch (nose up) and roll (left side up) [rad] | ±π |
    | 10, 11 | way of each track since the last decision [m] | ±1 |
    | 12 | angle of the hinge [rad] | ±π/2 |
    | 13 - 16 | `docked`: whether each dock holds another | 0, 1 |
    | 17 - 24 | light of beacons at each infrared unit [counts] | 0 ... 275 |
    | 25 - 28 | message that each side received; -1 for none | -1 ... 15 |
    | 29 - 32 | message over the wire of each dock; -1 for none | -1 ... 15 |
    | 33 - 39 | the forward laser's beams from -60° to -30°, every 5° [m] | 0 ... 4 |

    ## Reward, end, options

    The change of the robot's own position along the way across the pit, up to 0.2 m beyond it [m], and
    `success_bonus` for all at the end; in "assemble" the change of the share of all robots that its body consists of.
    Terminated for all: every robot is beyond the pit with its whole chassis, upright and undocked, or all are one body
    (`success` in the info). Truncated for all after `duration`. `info` contains `success`,
    `organism` and `across`, whether the robot itself is there.

    | option | default | meaning |
    |---|---|---|
    | `arena` | "gsrm" | a name, a folder, a mesh file or an `Arena`; with a pit for "cross" |
    | `task` | "cross" | "cross", or "assemble", which needs no pit |
    | `num_robots` | 8 | N, 1 to 1000 |
    | `duration` | 900.0 | of an episode [s] |
    | `success_bonus` | 1.0 | reward of each robot at a success |
    | `noise` | 1.0 | factor on the noise of sensors and signals |
    | `fidelity` | "kinematic" | level of physics, "kinematic" or "dynamic" |

    "kinematic" moves all robots simply and fast, "dynamic" all in full contact.

    With `render_mode="rgb_array"`, `render()` returns an image [400, 640, 3] from the right of the way across.
    Kinematic robots stop where they would fall; dynamic ones fall.

    `reset` takes a `seed`: equal seeds and actions give equal bits; and `options={"poses": [N, 3]}`: x [m], y [m] and
    heading [rad] of each robot, such as two before each other's docks. Other options are left out.

    Raises:
        OptionError: an option is unknown or out of range.
        ArenaError: there is no such arena, or it has no pit for "cross" or no room for so many robots.
    """

    metadata = {  # noqa: RUF012
        "name": "swarm_v0",
        "render_modes": ["rgb_array"],
        "render_fps": round(1.0 / DECISION),
        "is_parallelizable": True,
    }

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise OptionError(f"no render mode {render_mode!r}; there is 'rgb_array', or leave it out")
        names = [field.name for field in fields(SwarmOptions)]
        for name in options:
            check_choice("option", name, names, OptionError)
        self.options, self.render_mode = SwarmOptions(**options), render_mode
        count, source = int(self.options.num_robots), self.options.arena
        self.arena = source if isinstance(source, Arena) else load_arena(source)
        self.field = find_field(self.arena, needs_pit=self.options.task == "cross")
        self.world: SwarmWorld = LEVELS[self.options.fidelity](self.arena, count)
        self._senses = Senses(self.world, self.options.noise, beams=_NUM_BEAMS)
        self._signals = Signals(self.world, self.options.noise)
        self.possible_agents = [f"robot_{index}" for index in range(count)]
        self._rows = {agent: row for row, agent in enumerate(self.possible_agents)}
        self.agents: list[str] = []
        self._action = {
            agent: spaces.Box(-1.0, 1.0, (_NUM_ACTIONS,), np.float32) for agent in self.possible_agents
        }
        low, high = _find_bounds(self.world.scout.ir_range, self.world.scout.laser_range)
        self._observation = {agent: spaces.Box(low, high, dtype=np.float32) for agent in self.possible_agents}
        self._rng = np.random.default_rng()
        self._camera: SwarmCamera | None = None
        self._is_placed = False

    def action_space(self, agent: str) -> spaces.Box:
        """Return the action space of an agent, always the same object."""
        return self._action[agent]

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the observation space of an agent, always the same object."""
        return self._observation[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Scatter the robots on the ground before the pit, or place them as told, and begin an episode.

        Args:
            seed: of all random numbers from now on; None to go on with the present ones.
            options: `poses`, `[N, 3]` x [m], y [m] and heading [rad] of the robots; others are left out.

        Raises:
            OptionError: the poses have another shape or are not finite.
            ArenaError: a robot would not stand there, or two would overlap.
        """
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        start, world, senses, signals = self._rng.integers(_LARGEST_SEED, size=4).tolist()
        self.world.reset(self._place((options or {}).get("poses"), np.random.default_rng(start)), world)
        self._senses.reset(senses)
        self._signals.reset(signals)
        self._is_placed, self.agents = True, list(self.possible_agents)
        self._progress = self._measure_progress()
        silent = np.full((self.world.num_robots, _NUM_DOCKS), NO_MESSAGE)
        return self._observe(silent >= 0, silent), self._describe(False)

    def _place(self, given: Any, rng: np.random.Generator) -> np.ndarray:
        """Return the poses that are given, or those of robots that are scattered."""
        count = self.world.num_robots
        if given is None:
            return scatter(self.field, count, self.world, rng)
        try:
            poses = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            poses = np.zeros(0)
        if poses.shape != (count, 3) or not np.isfinite(poses).all():
            raise OptionError(f"poses must be [{count}, 3] finite numbers (x, y, heading), got {given!r}")
        return poses

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Advance all robots by a decision.

        Raises:
            OptionError: an action of another shape, not finite, or of no agent; or the episode has ended.
        """
        if not self.agents:
            raise OptionError("the episode has ended; call reset() first")
        action = self._read_actions(actions)
        scout, latch = self.world.scout, action[:, 3:7] > 0.0
        commands = SwarmCommands(action[:, :2] * scout.track_speed, action[:, 2] * scout.hinge_range, latch)
        self.world.step(commands)
        level = np.minimum((action[:, 11:] * NUM_MESSAGES).astype(int), NUM_MESSAGES - 1)
        message = np.where(action[:, 11:] < 0.0, NO_MESSAGE, level)
        progress = self._measure_progress()
        success = self._has_succeeded()
        gain = progress - self._progress + success * self.options.success_bonus
        self._progress = progress
        is_over = self.world.time >= self.options.duration - DECISION / 2
        names = self.agents
        results = (
            self._observe(action[:, 7:11] > 0.0, message),
            dict(zip(names, gain.tolist(), strict=True)),
            dict.fromkeys(names, success),
            dict.fromkeys(names, is_over and not success),
            self._describe(success),
        )
        if success or is_over:
            self.agents = []
        return results

    def render(self) -> np.ndarray | None:
        """Return an image of the robots now, `[400, 640, 3]`; None without a render mode.

        Raises:
            OptionError: before the first reset.
        """
        if self.render_mode is None:
            return None
        if not self._is_placed:
            raise OptionError("nothing to draw yet; call reset() first")
        if self._camera is None:
            from symbrion_gym._src.swarm.film import SwarmCamera

            self._camera = SwarmCamera(self.arena, self.world.num_robots, self.field.route.heading)
        state = self.world.state
        return self._camera.draw(state.position, state.rotation, state.hinge, self.world.time)

    def close(self) -> None:
        """Free what draws."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def _read_actions(self, actions: dict[str, np.ndarray]) -> np.ndarray:
        """Return `[N, 15]`, robots without an action idle."""
        idle = np.zeros(_NUM_ACTIONS)
        idle[3:] = -1.0
        result = np.tile(idle, (self.world.num_robots, 1))
        for agent, action in actions.items():
            if agent not in self._rows:
                raise OptionError(f"no agent {agent!r}; there are robot_0 to {self.possible_agents[-1]}")
            values = np.asarray(action, dtype=np.float64)
            result[self._rows[agent]] = values if values.shape == idle.shape else np.nan
        if not np.isfinite(result).all():
            agent = self.possible_agents[int(np.isfinite(result).all(axis=1).argmin())]
            raise OptionError(f"the action of {agent} must be 15 finite numbers, got {actions[agent]!r}")
        return np.clip(result, -1.0, 1.0)

    def _has_succeeded(self) -> bool:
        if self.options.task == "assemble":
            return not self._find_groups().any()
        return bool(find_across(self.world.state, self.field).all())

    def _find_groups(self) -> np.ndarray:
        return find_groups(self.world.state.links, self.world.num_robots)

    def _measure_progress(self) -> np.ndarray:
        if self.options.task == "assemble":
            groups = self._find_groups()
            return np.bincount(groups, minlength=len(groups))[groups] / len(groups)
        return np.minimum(self.field.find_way(self.world.state.position), self.field.far_edge + _BEYOND)

    def _observe(self, beacon: np.ndarray, message: np.ndarray) -> dict[str, np.ndarray]:
        """Return what robots observe as their docks shine and send."""
        readings, state = self._senses.read(), self.world.state
        received = self._signals.exchange(beacon, message)
        parts = (
            readings["proximity"],
            readings["tilt"],
            readings["odometry"],
            state.hinge[:, None],
            state.docked,
            *received,
            readings["laser"],
        )
        space = self._observation[self.possible_agents[0]]
        rows = np.clip(np.concatenate(parts, axis=1), space.low, space.high).astype(np.float32)
        return dict(zip(self.agents, rows, strict=True))

    def _describe(self, success: bool) -> dict[str, dict[str, Any]]:
        across = find_across(self.world.state, self.field).tolist()
        organism = self._find_groups().tolist()
        return {
            agent: {"success": success, "organism": organism[index], "across": across[index]}
            for index, agent in enumerate(self.agents)
        }


def _find_bounds(ir_range: float, laser_range: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest observation."""
    sizes = (8, 2, 2, 1, _NUM_DOCKS, 8, _NUM_DOCKS, _NUM_DOCKS, _NUM_BEAMS)
    last = NUM_MESSAGES - 1
    low = (0.0, -np.pi, -1.0, -np.pi / 2, 0.0, 0.0, NO_MESSAGE, NO_MESSAGE, 0.0)
    high = (ir_range, np.pi, 1.0, np.pi / 2, 1.0, SATURATION, last, last, laser_range)
    return np.repeat(low, sizes).astype(np.float32), np.repeat(high, sizes).astype(np.float32)
