"""The environment of a swarm in the form of PettingZoo: every Scout is an agent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import SIDES, SensorNoise
from symbrion_gym._src.swarm.docks import find_groups
from symbrion_gym._src.swarm.options import SwarmOptions, make_world
from symbrion_gym._src.swarm.placing import find_across, find_field, scatter
from symbrion_gym._src.swarm.senses import Senses
from symbrion_gym._src.swarm.signals.infrared import SATURATION, SignalConfig
from symbrion_gym._src.swarm.signals.signals import Receptions, Signals, Transmissions
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands

if TYPE_CHECKING:
    from symbrion_gym._src.swarm.film import SwarmCamera

NUM_MESSAGES = 16  # Messages that a dock can send: numbers from 0 on
_NUM_DOCKS = len(SIDES)
_LARGEST_SEED = 2**31


class SwarmEnv(ParallelEnv[str, np.ndarray, np.ndarray]):
    """Scouts scattered before a pit have to get beyond it; none of them can cross it alone.

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
    `success_bonus` for all at the end. Terminated for all: every robot is beyond the pit with its whole chassis,
    upright and undocked (`success` in the info). Truncated for all after `duration`. `info` contains `success`,
    `organism` and `across`, whether the robot itself is there.

    | option | default | meaning |
    |---|---|---|
    | `arena` | "gsrm" | a name, a folder, a mesh file or an `Arena` with a pit |
    | `num_robots` | 8 | N, 1 to 1000 |
    | `duration` | 900.0 | of an episode [s] |
    | `success_bonus` | 1.0 | reward of each robot at a success |
    | `noise` | 1.0 | factor on the noise of sensors and signals |
    | `fidelity` | "kinematic" | level of physics, "kinematic" or "dynamic" |

    "kinematic" moves all robots simply and fast, "dynamic" all in full contact.

    With `render_mode="rgb_array"`, `render()` returns an image [400, 640, 3] from the right of the way across.
    Kinematic robots stop where they would fall; dynamic ones fall.

    `reset` takes a `seed`: equal seeds and actions give equal bits. It knows no options and leaves them out.

    Raises:
        OptionError: an option is unknown or out of range.
        ArenaError: there is no such arena, or it has no pit or no room for so many robots.
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
        self.options = SwarmOptions.from_options(options)
        self.render_mode = render_mode
        count = int(self.options.num_robots)
        source = self.options.arena
        self.arena = source if isinstance(source, Arena) else load_arena(source)
        self.field = find_field(self.arena)
        self.world = make_world(self.arena, count, self.options.fidelity)
        noise = self.options.noise
        default = SensorNoise()
        scaled = SensorNoise(
            **{name: noise * getattr(default, name) for name in default.__dataclass_fields__}
        )
        self._senses = Senses(self.world, laser=True, noise=scaled)
        light = SignalConfig()
        light = SignalConfig(
            noise=noise * light.noise,
            relative_noise=noise * light.relative_noise,
            message_loss=min(1.0, noise * light.message_loss),
        )
        self._signals = Signals(self.world, light, sight=self._senses.sight)
        self.possible_agents = [f"robot_{index}" for index in range(count)]
        self.agents: list[str] = []
        self._action = {agent: spaces.Box(-1.0, 1.0, (15,), np.float32) for agent in self.possible_agents}
        low, high = _find_bounds(self.world.scout.ir_range, SATURATION, self.world.scout.laser_range)
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
        """Scatter the robots on the ground before the pit and begin an episode.

        Args:
            seed: of all random numbers from now on; None to go on with the present ones.
            options: none are known.
        """
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        start, world, senses, signals = self._rng.integers(_LARGEST_SEED, size=4).tolist()
        rng = np.random.default_rng(start)
        self.world.reset(scatter(self.field, self.world.num_robots, self.arena, rng), world)
        self._senses.reset(senses)
        self._signals.reset(signals)
        self._is_placed, self.agents = True, list(self.possible_agents)
        self._sent = Transmissions.make_silent(self.world.num_robots)
        self._progress = self._measure_progress()
        return self._observe(), self._describe(False)

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
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
        message = np.where(action[:, 11:] < 0.0, -1, level)
        self._sent = Transmissions(action[:, 7:11] > 0.0, message, message)
        progress = self._measure_progress()
        success = bool(find_across(self.world.state, self.field, scout).all())
        gain = progress - self._progress + success * self.options.success_bonus
        self._progress = progress
        is_over = self.world.time >= self.options.duration - DECISION / 2
        names = self.agents
        results = (
            self._observe(),
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
        idle = np.zeros(15)
        idle[3:] = -1.0
        result = np.tile(idle, (self.world.num_robots, 1))
        for agent, action in actions.items():
            if agent not in self._action:
                last = self.possible_agents[-1]
                raise OptionError(f"no agent {agent!r}; there are robot_0 to {last}")
            values = np.asarray(action, dtype=np.float64)
            if values.shape != idle.shape or not np.isfinite(values).all():
                raise OptionError(f"the action of {agent} must be 15 finite numbers, got {action!r}")
            result[self.possible_agents.index(agent)] = np.clip(values, -1.0, 1.0)
        return result

    def _measure_progress(self) -> np.ndarray:
        way = self.field.find_way(self.world.state.position)
        return np.minimum(way, self.field.far_edge + 0.2)

    def _observe(self) -> dict[str, np.ndarray]:
        readings = self._senses.read()
        received: Receptions = self._signals.exchange(self._sent)
        state = self.world.state
        docked = np.zeros((self.world.num_robots, _NUM_DOCKS))
        for link in state.links:
            for robot, side in link.ends:
                docked[robot, SIDES.index(side)] = 1.0
        parts = (
            readings["proximity"],
            readings["tilt"],
            readings["odometry"],
            state.hinge[:, None],
            docked,
            received.beacon,
            received.message,
            received.wired,
            readings["laser"][:, :_NUM_BEAMS],
        )
        space = self._observation[self.possible_agents[0]]
        rows = np.clip(np.concatenate(parts, axis=1), space.low, space.high).astype(np.float32)
        return dict(zip(self.agents, rows, strict=True))

    def _describe(self, success: bool) -> dict[str, dict[str, Any]]:
        across = find_across(self.world.state, self.field, self.world.scout).tolist()
        organism = find_groups(self.world.state.links, self.world.num_robots).tolist()
        return {
            agent: {"success": success, "organism": organism[index], "across": across[index]}
            for index, agent in enumerate(self.agents)
        }


_NUM_BEAMS = 7


def _find_bounds(ir_range: float, saturation: float, laser_range: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest observation."""
    sizes = (8, 2, 2, 1, _NUM_DOCKS, 8, _NUM_DOCKS, _NUM_DOCKS, _NUM_BEAMS)
    low = (0.0, -np.pi, -1.0, -np.pi / 2, 0.0, 0.0, -1.0, -1.0, 0.0)
    high = (ir_range, np.pi, 1.0, np.pi / 2, 1.0, saturation, NUM_MESSAGES - 1, NUM_MESSAGES - 1, laser_range)
    return np.repeat(low, sizes).astype(np.float32), np.repeat(high, sizes).astype(np.float32)
