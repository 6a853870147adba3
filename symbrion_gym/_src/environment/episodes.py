"""Episodes of N simulations: commands in, rewards and endings out. Single and vector environment share it.

All is computed as arrays over the simulations, one simulation included, so that every row comes out alike whatever N
is, bit for bit. In most ticks nothing happens: `symbrion_gym._src.tasks.watch` knows it from a few measurements, and
terminations, goal and the rewards at the end are not even called.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.environment.commands import Commands
from symbrion_gym._src.environment.dead_reckoning import DeadReckoning
from symbrion_gym._src.environment.observation import Observer
from symbrion_gym._src.environment.world import Physics, World, make_slice
from symbrion_gym._src.tasks.state import MEASURES, Scene, TaskState, Views, check_function
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.terms import BASE_FLAGS
from symbrion_gym._src.tasks.watch import Watch

_LOWEST = MEASURES.index("lowest")  # Heights of the lowest modules, and the least z of an up axis after them
_SOUND = 0.98  # Share of the square of the largest rate at which the sum of all squares leaves no doubt


def name_numbers(task: Task) -> tuple[str, ...]:
    """Return the names of the numbers of `info`."""
    rewards = tuple(f"reward_{term.name}" for term in task.rewards)
    return ("x_position", "progress", "time", *rewards, "lowest_module", "least_upright")


def name_flags(task: Task) -> tuple[str, ...]:
    """Return the names of the flags of `info`."""
    return BASE_FLAGS + tuple(term.name for term in task.terminations)


class Start(NamedTuple):
    """The start of an episode in one simulation."""

    row: int  # index of the simulation
    track_speed: float  # [m/s]
    scene: Scene | None = None  # arena and way, if the simulation is in another world than before


class Ticks(NamedTuple):
    """How a tick ended in every simulation; nothing in those that stood still."""

    reward: Float[np.ndarray, " N"]  # reward of the tick
    terminated: Bool[np.ndarray, " N"]  # whether the episode ended by what happened
    truncated: Bool[np.ndarray, " N"]  # whether it ended by its time
    has_ended: bool  # whether any episode ended


class Episodes:
    """The memory of N episodes, and how a tick (a control step) changes it.

    Attributes:
        commands: what the actions command.
        observer: how observations are read.
        state: what the terms of the task see.
        reckoning: where the bodies believe they are; None where they do not observe `goal_direction`.
        number_names: names of the numbers of `info`.
        flag_names: names of the flags of `info`.
        info_names: both.
        numbers: `[numbers, N]` numbers of `info` at the last tick or reset of each.
        flags: `[flags, N]` likewise its flags.
        num_tracks: number of track speeds in an action.
        num_actions: length of an action.
    """

    def __init__(self, world: World, num: int) -> None:
        self.world, task = world, world.task
        self._dt = world.config.dt
        self.commands = Commands(world, num)
        self.num_tracks, self.num_actions = self.commands.num_tracks, self.commands.num_actions
        self.target, self.action = self.commands.target, self.commands.action
        self.observer = Observer(world, self.action, self.target)
        is_reckoned = "goal_direction" in self.observer.structure
        self.reckoning = (
            DeadReckoning(world, self.commands, self.observer.goal_direction) if is_reckoned else None
        )
        self.scene = world.scene
        self.state = TaskState(self.scene, task.goal, num, self._dt, self.action)
        self._watch = Watch(task, self.state)
        self._largest_squares = _SOUND * self.state.criteria.max_rate**2
        self.number_names, self.flag_names = name_numbers(task), name_flags(task)
        self.info_names = self.number_names + self.flag_names
        self.flags = self._watch.flags
        self.numbers, self._scratch = np.zeros((2, len(self.number_names), num))
        coefficients = [term.weight * (self._dt if term.per_second else 1.0) for term in task.rewards]
        factors = [np.full(num, each) for each in coefficients]
        terms = list(enumerate(zip(task.rewards, factors, strict=True)))
        self._given = [index for index, (term, _) in terms if not term.at_end]
        self._tick_length = np.full(num, self._dt)
        functions = [check_function(f"reward {term.name!r}", term.function) for term in task.rewards]
        self._rewards = [(functions[index], factor) for index, (term, factor) in terms if not term.at_end]
        self._final_rewards = [
            (index, functions[index], factor) for index, (term, factor) in terms if term.at_end
        ]
        self._last_reward = 3 + len(task.rewards)
        self._has_final = False
        self._start_head = np.zeros(num)
        self._has_driven = np.zeros(num, dtype=bool)
        servos, dofs = world.hinge_servos, world.hinge_dof
        self._servos, self._dofs = make_slice(servos), make_slice(dofs)
        self._is_live = world.is_sliced and isinstance(self._servos, slice) and isinstance(self._dofs, slice)
        self._viewed: Physics | None = None
        self._rates: np.ndarray | None = None
        self._ends = self.state.measures[_LOWEST : _LOWEST + 2]
        self._tables = self._split(self.numbers), self._split(self._scratch)
        self._columns = list(zip(self.numbers.T, self.flags.T, strict=True))
        self._never = np.zeros(num, dtype=bool)
        self._recorders = world.config.recorders

    def _split(self, table: np.ndarray) -> tuple[Any, ...]:
        """Return a table and the rows of it that each tick writes."""
        head, gained, time = table[:3]
        rewards = [*table[3 : self._last_reward]]
        given = [rewards[index] for index in self._given]
        terms = [(*term, row) for term, row in zip(self._rewards, given, strict=True)]
        return table, head, gained, time, rewards, given, terms, table[self._last_reward :]

    def _view(self, physics: Physics) -> None:
        """Let the state read from the physics; once, where its views stay valid while it goes on."""
        if physics is not self._viewed or not self._is_live:
            self._viewed = physics
            self._rates = physics.qvel.reshape(-1) if physics.qvel.flags.c_contiguous else None
            qvel, force = physics.qvel, physics.actuator_force
            views = Views(
                physics.position, physics.rotation, qvel, qvel[:, self._dofs], force[:, self._servos]
            )
            self.state.bind(views)
            self._head = self.state.along[:, 0]

    def begin(self, physics: Physics, starts: Sequence[Start]) -> None:
        """Start episodes from the present physics."""
        self._view(physics)
        state, rows = self.state, [start.row for start in starts]
        for row, speed, _ in starts:
            self.commands.begin(row, physics.qpos[row, self.world.hinge_qpos], speed)
            self.observer.track_odometry[row] = self.scene.start_on_map
        scenes = [start.scene or state.scenes[start.row] for start in starts]
        if self.reckoning is not None:
            self.reckoning.begin(rows, scenes)
        state.begin(rows, scenes, [start.track_speed for start in starts])
        self._watch.begin(rows)
        self._start_head[rows] = state.along[rows, 0]
        self._has_driven[rows] = False
        self.numbers[:, rows] = 0.0
        self.numbers[0, rows] = state.along[rows, 0]
        self._head = state.along[:, 0]
        self.numbers[self._last_reward :, rows] = self._ends[:, rows]
        if self._recorders:
            begun = self._never.copy()
            begun[rows] = True
            self._record(begun)

    def _record(self, active: Bool[np.ndarray, " N"]) -> None:
        for recorder in self._recorders:
            recorder.record(self.state, active)

    def read_records(self, row: int) -> dict[str, Any]:
        """Return what the recorders kept of the present episode of a simulation, until it begins again."""
        return {name: value for each in self._recorders for name, value in each.read(self.state, row).items()}

    def command(
        self, actions: Float[np.ndarray, "N A"], active: Bool[np.ndarray, " N"] | None = None
    ) -> tuple[Float[np.ndarray, "N h"], Float[np.ndarray, "N tracks"]]:
        """Take actions; see `Commands.take`."""
        target, speed = self.commands.take(actions, active)
        if self.observer.has_track_odometry:
            self._has_driven[:] = True if active is None else active
        if self.reckoning is not None:
            self.reckoning.take(active)
        return target, speed

    def observe(self, physics: Physics) -> Float[np.ndarray, "N O"]:
        """Return noiseless observations, within their bounds."""
        if self.observer.has_odometry:
            self.observer.odometry[:, 0] = self.state.along[:, 0] - self._start_head
        if self.observer.has_track_odometry:
            self._integrate_track_odometry(physics)
        if self.observer.has_goal:
            self._find_goal()
        if self.reckoning is not None:
            self.reckoning.observe(physics)
        return self.observer.read(physics)

    def _find_goal(self) -> None:
        """Find the place to head for as the head sees it; zeros where a task has none."""
        state = self.state
        head = state.position[:, 0, :2]
        x, y = (np.where(np.isfinite(state.target), state.target, head) - head).T
        c, s = state.rotation[:, 0, 0], state.rotation[:, 0, 3]
        length = np.maximum(np.hypot(c, s), 1e-9)
        np.divide(x * c + y * s, length, out=self.observer.goal[:, 0])
        np.divide(y * c - x * s, length, out=self.observer.goal[:, 1])

    def _integrate_track_odometry(self, physics: Physics) -> None:
        """Add the way of the last tick, once: what the head's tracks ran, as steep as its pitch."""
        level = np.sqrt(np.maximum(1.0 - physics.rotation[:, 0, 6] ** 2, 0.0))
        way = self._dt * self.commands.compute_head_speed() * level
        self.observer.track_odometry[self._has_driven, 0] += way[self._has_driven]
        self._has_driven[:] = False

    def finish_tick(self, physics: Physics, active: Bool[np.ndarray, " N"] | None = None) -> Ticks:
        """Return how the control step ended whose physics has just been stepped, and its rewards."""
        if physics is not self._viewed or not self._is_live:
            self._view(physics)
        rates, qvel = self._rates, physics.qvel
        squares = np.vdot(qvel, qvel) if rates is None else rates.dot(rates)
        if squares < self._largest_squares:
            return self._finish(active, True)
        with np.errstate(all="ignore"):
            return self._finish(active, False)

    def _finish(self, active: Bool[np.ndarray, " N"] | None, is_sound: bool) -> Ticks:
        state = self.state
        state.advance(active, is_sound)
        has_ended = self._watch.look(active, is_sound)
        if self._recorders:
            self._record(~self._never if active is None else active)
        table, head, gained, time, rewards, given, terms, ends = self._tables[active is not None]
        head[...] = self._head
        np.subtract(state.progress, state.start_progress, gained)
        np.multiply(state.tick, self._tick_length, time)
        ends[...] = self._ends
        for function, factor, row in terms:
            np.multiply(function(state), factor, row)
        if has_ended or self._has_final:
            self._give_final_rewards(rewards, has_ended)
            given = rewards
        reward = add_rewards(given) if given else np.zeros(state.num)
        if not is_sound:
            np.copyto(head, state.start_mean, where=~state.is_sound)
        if active is not None:
            np.copyto(self.numbers, table, where=active)
            reward = np.where(active, reward, 0.0)
        watch = self._watch
        if has_ended:
            return Ticks(reward, watch.terminated, watch.truncated, True)
        return Ticks(reward, self._never, self._never, False)

    def _give_final_rewards(self, rewards: Sequence[np.ndarray], has_ended: bool) -> None:
        """Give what is given once in the simulations whose episodes have ended, and nothing in the others."""
        ended = self._watch.terminated | self._watch.truncated if has_ended else self._never
        for index, function, factor in self._final_rewards:
            rewards[index][:] = np.where(ended, function(self.state) * factor, 0.0)
        self._has_final = has_ended

    def describe(self, row: int) -> dict[str, float | bool]:
        """Return the `info` of one simulation."""
        numbers, flags = self._columns[row]
        return dict(zip(self.info_names, numbers.tolist() + flags.tolist(), strict=False))


def add_rewards(rewards: Sequence[np.ndarray]) -> np.ndarray:
    """Return the sum of rewards, of at least one, added in their order."""
    if len(rewards) == 1:
        return rewards[0].copy()
    total = np.add(rewards[0], rewards[1])
    for reward in rewards[2:]:
        np.add(total, reward, total)
    return total
