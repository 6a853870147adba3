"""Episodes of N simulations: commands in, rewards and endings out. Single and vector environment share it.

Commands and observations are computed for all simulations at once. How a tick ended is computed one by one in
plain Python, which is faster than small arrays; `vectorized_episodes` does that for many simulations. Every row
comes out alike whatever N is, to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym.environment.commands import Commands
from symbrion_gym.environment.observation import Observer
from symbrion_gym.environment.world import Physics, World, make_slice
from symbrion_gym.tasks.success_check import OrganismState, SuccessCheck

NUMBERS = (
    "x_position",
    "progress",
    "time",
    "reward_forward",
    "reward_success",
    "reward_effort",
    "lowest_module",
    "least_upright",
)
"""The numbers of `info`, in order."""
FLAGS = ("success", "diverged", "rolled_over", "fell", "touched_pit", "stuck")
"""The flags of `info`, which follow the numbers."""


Tick = tuple[float, bool, bool, dict[str, float | bool]]
"""What a tick came to in one simulation: reward, terminated, truncated and `info`, which holds `NUMBERS` and
`FLAGS` in their order."""


class Start(NamedTuple):
    """The start of an episode in one simulation.

    Attributes:
        row: index of the simulation.
        track_speed: [m/s].
        check: success check, if the simulation is in another world than before.
    """

    row: int
    track_speed: float
    check: SuccessCheck | None = None


@dataclass(slots=True)
class Episode:
    """The memory of one episode, apart from the physics.

    Attributes:
        track_speed: [m/s].
        start: mean position of the modules at the start, along the route [m].
        start_progress: progress at the start [m].
        progress: progress at the last tick [m].
        best: progress at which the organism last moved on [m].
        best_tick: tick at which that was.
        ticks: since the start.
        held: ticks for which the organism has arrived.
    """

    track_speed: float = 0.0
    start: float = 0.0
    start_progress: float = 0.0
    progress: float = 0.0
    best: float = 0.0
    best_tick: int = 0
    ticks: int = 0
    held: int = 0


class Episodes:
    """The memory of N episodes, and how a tick (a control step) changes it.

    Attributes:
        commands: what the actions command.
        target: `[N, h]` commanded angles of the servos [rad].
        action: `[N, A]` the last action, after clipping.
        num_tracks: number of track speeds in an action.
        check: success check in the world in which the simulations begin.
    """

    def __init__(self, world: World, num: int) -> None:
        self.world = world
        config, hinges = world.config, world.num_hinges
        self.commands = Commands(world, num)
        self.num_tracks, self.num_actions = self.commands.num_tracks, self.commands.num_actions
        self.check = world.make_success_check()
        self.target, self.action = self.commands.target, self.commands.action
        self.observer = Observer(world, self.action, self.target)
        self._checks = [self.check] * num
        self._viewed: Physics | None = None
        self._states: list[OrganismState | None] = [None] * num
        self._episodes = [Episode() for _ in range(num)]
        self._start_head = np.zeros(num)
        self._has_driven = np.zeros(num, dtype=bool)
        self._dt = config.dt
        self._num_hinges = hinges
        self._last_tick = round(config.duration / config.dt)
        self._stuck_ticks = round(config.stuck_time / config.dt)
        self._stuck_progress = config.stuck_progress
        self._weights = (config.forward_weight, config.success_bonus, -config.effort_weight * config.dt)
        servos, dofs = world.hinge_servos, world.hinge_dof
        self._servos, self._dofs = make_slice(servos), make_slice(dofs)
        self._is_live = world.is_sliced and isinstance(self._servos, slice) and isinstance(self._dofs, slice)

    def begin(self, physics: Physics, starts: Sequence[Start]) -> None:
        """Start episodes from the present physics.

        Args:
            physics: state of all simulations.
            starts: which simulations begin, and what differs between them.
        """
        for row, speed, check in starts:
            self._checks[row] = check or self._checks[row]
            self.commands.begin(row, physics.qpos[row, self.world.hinge_qpos], speed)
            measured = self._checks[row].measure(self._find_state(physics, row))
            start = measured.progress
            self._episodes[row] = Episode(speed, measured.mean, start, start, start)
            self._start_head[row] = measured.head
            self._has_driven[row] = False
            self.observer.track_odometry[row] = self.check.start

    def command(
        self, actions: Float[np.ndarray, "N A"], active: Bool[np.ndarray, " N"] | None = None
    ) -> tuple[Float[np.ndarray, "N h"], Float[np.ndarray, "N tracks"]]:
        """Take actions: move the servos' targets at their speed.

        NaN keeps the previous command of that entry; other values are clipped to ±1.

        Args:
            actions: actions of all simulations.
            active: whether each simulation is stepped; None for all.

        Returns:
            Targets [rad] and track speeds, one per simulation or one per module [m/s].
        """
        target, speed = self.commands.take(actions, active)
        self._has_driven[:] = True if active is None else active
        return target, speed

    def observe(self, physics: Physics) -> Float[np.ndarray, "N O"]:
        """Return noiseless observations, within their bounds."""
        if self.observer.has_odometry:
            way = self.check.find_distance(physics.position)[:, 0] - self._start_head
            self.observer.odometry[:, 0] = way
        if self.observer.has_track_odometry:
            self._integrate_track_odometry(physics)
        return self.observer.read(physics)

    def _integrate_track_odometry(self, physics: Physics) -> None:
        """Add the way of the last tick, once: what the head's tracks ran, as steep as its pitch."""
        level = np.sqrt(np.maximum(1.0 - physics.rotation[:, 0, 6] ** 2, 0.0))
        way = self._dt * self.commands.find_head_speed() * level
        self.observer.track_odometry[self._has_driven, 0] += way[self._has_driven]
        self._has_driven[:] = False

    def describe_start(self, physics: Physics, row: int) -> dict[str, float | bool]:
        """Return the `info` of a reset in one row."""
        measured = self._checks[row].measure(self._find_state(physics, row))
        numbers = (measured.head, 0.0, 0.0, 0.0, 0.0, 0.0, measured.lowest, measured.uprightness)
        return dict(zip(NUMBERS + FLAGS, numbers + (False,) * len(FLAGS), strict=True))

    def finish_tick(self, physics: Physics, row: int = 0) -> Tick:
        """Return how the control step ended whose physics has just been stepped, and its reward, in one row."""
        episode, check = self._episodes[row], self._checks[row]
        measured = check.measure(self._find_state(physics, row))
        head, mean, is_across, progress, lateral, lowest, uprightness, power, is_sound = measured
        positions, rotations = physics.position[row], physics.rotation[row]
        rolled_over = fell = touched = False
        if is_sound:
            rolled_over = uprightness < check.criteria.rolled_over
            fell = lateral > check.max_lateral or lowest < check.lowest
            touched = check.is_bottomless and check.has_touched_pit(positions, rotations)
        else:
            head, progress = episode.start, episode.progress
        has_failed = rolled_over or fell or touched or not is_sound
        has_arrived = is_across and not has_failed
        episode.ticks += 1
        time = episode.ticks * self._dt
        farthest = episode.start + episode.track_speed * time + check.criteria.speed_slack
        has_arrived = has_arrived and mean <= farthest and check.is_standing(positions, rotations)
        episode.held = episode.held + 1 if has_arrived else 0
        success = episode.held >= check.hold_ticks
        forward, bonus, cost = self._reward(episode, progress, success, power if is_sound else None)
        stuck = self._advance(episode, progress)
        terminated = success or has_failed
        truncated = not terminated and (stuck or episode.ticks >= self._last_tick)
        info = {
            "x_position": head,
            "progress": progress - episode.start_progress,
            "time": time,
            "reward_forward": forward,
            "reward_success": bonus,
            "reward_effort": cost,
            "lowest_module": lowest,
            "least_upright": uprightness,
            "success": success,
            "diverged": not is_sound,
            "rolled_over": rolled_over,
            "fell": fell,
            "touched_pit": touched,
            "stuck": stuck,
        }
        return forward + bonus + cost, terminated, truncated, info

    def _reward(
        self, episode: Episode, progress: float, success: bool, power: float | None
    ) -> tuple[float, float, float]:
        """Return the parts of the reward: for progress since the last step, success and effort (None: unknown)."""
        forward_weight, success_bonus, effort_weight = self._weights
        forward = forward_weight * (progress - episode.progress)
        cost = 0.0 if power is None else effort_weight * power
        return forward, success_bonus if success else 0.0, cost

    def _advance(self, episode: Episode, progress: float) -> bool:
        """Store the progress of an episode and return whether it is stuck."""
        if progress > episode.best + self._stuck_progress:
            episode.best, episode.best_tick = progress, episode.ticks
        episode.progress = progress
        return episode.ticks - episode.best_tick >= self._stuck_ticks

    def _find_state(self, physics: Physics, row: int) -> OrganismState:
        """Return views of one simulation, looked up once where they stay valid while it goes on."""
        if physics is not self._viewed or not self._is_live:
            self._viewed, self._states = physics, [None] * len(self._states)
        state = self._states[row]
        if state is None:
            torque, rate = physics.actuator_force[row, self._servos], physics.qvel[row, self._dofs]
            positions, up = physics.position[row].T, physics.rotation[row, :, 8]
            state = OrganismState(physics.qvel[row], positions, up, torque, rate)
            self._states[row] = state
        return state
