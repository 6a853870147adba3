"""Episodes of N simulations: commands in, rewards and endings out. Single and vector environment share it.

All is computed as arrays over the simulations, one simulation included, so that every row comes out alike whatever N
is, bit for bit. In most ticks nothing happens: `symbrion_gym._src.tasks.watch` knows it from a few measurements, and
terminations, goal and the rewards at the end are not even called.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.environment.config import count_tracks
from symbrion_gym._src.environment.observation import DeadReckoning, Observer, find_goal, measure_way
from symbrion_gym._src.environment.world import Physics, World, make_slice
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.tasks.state import MEASURES, TaskState, Views, check_finite, check_function
from symbrion_gym._src.tasks.terms import BASE_FLAGS
from symbrion_gym._src.tasks.watch import Reasons, Watch

_LOWEST = MEASURES.index("lowest")  # Heights of the lowest modules, and the least z of an up axis after them
_SOUND = 0.98  # Share of the square of the largest rate at which the sum of all squares leaves no doubt


class Commands:
    """From actions to targets of the hinges' servos and speeds of the tracks, of arrays of NumPy or JAX."""

    def __init__(self, world: World, num: int = 1) -> None:
        config = world.config
        self.num_tracks = count_tracks(config.track_control, world.num_modules)
        self.num_actions = world.num_hinges + self.num_tracks
        self.num_hinges, self._is_skid = world.num_hinges, config.track_control == "skid"
        # Limits have a row for each simulation on the host: they are applied faster than by broadcasting.
        self._highest = np.ones((num, self.num_actions))
        self._lowest = -self._highest
        self._range = np.tile(world.servo_range, (num, 1))
        self._turn = np.full((num, self.num_hinges), world.organism.scout.hinge_speed * config.dt)
        self._back = -self._turn

    def take(
        self, actions: Float[Any, "N A"], target: Float[Any, "N h"], xp: Any
    ) -> tuple[Float[Any, "N A"], Float[Any, "N h"]]:
        """Return actions clipped to ±1, and the targets of the servos, which move at their speed."""
        action = xp.minimum(xp.maximum(actions, self._lowest), self._highest)
        hinges = action[:, : self.num_hinges] if self.num_tracks else action
        turn = hinges * self._range - target
        return action, target + xp.minimum(xp.maximum(turn, self._back), self._turn)

    def compute_track_speed(self, speed: Float[Any, "N 1"], action: Float[Any, "N A"]) -> Float[Any, "N T"]:
        """Return commanded track speeds [m/s], one, or one for each module or side."""
        return speed * action[:, self.num_hinges :] if self.num_tracks else speed

    def compute_head_speed(self, track_speed: Float[Any, "N T"]) -> Float[Any, " N"]:
        """Return the commanded speed of the head's tracks [m/s], the mean of its sides."""
        return track_speed[:, :2].mean(axis=1) if self._is_skid else track_speed[:, 0]

    def refuse_infinite(
        self, actions: Float[np.ndarray, "N A"], active: Bool[np.ndarray, " N"] | None
    ) -> None:
        """Refuse what is no number in the simulations that are stepped."""
        wrong = ~np.isfinite(actions)
        if active is not None:
            wrong &= active[:, None]
        if not wrong.any():
            return
        row, column = (int(each) for each in np.argwhere(wrong)[0])
        where = f" of simulation {row}" if len(actions) > 1 else ""
        track = column - self.num_hinges
        what = f"hinge {column}" if track < 0 else f"track speed {track}"
        raise OptionError(
            f"action[{column}]{where} ({what}) is {actions[row, column]}; a number from -1 to 1 is needed"
        )


class Ticks(NamedTuple):
    """How a tick ended in every simulation; nothing in those that stood still."""

    reward: Float[np.ndarray, " N"]  # reward of the tick
    terminated: Bool[np.ndarray, " N"]  # whether the episode ended by what happened
    truncated: Bool[np.ndarray, " N"]  # whether it ended by its time
    has_ended: bool  # whether any episode ended


class Episodes:
    """The memory of N episodes, and how a tick (a control step) changes it."""

    def __init__(self, world: World, num: int, max_ticks: int | None = None) -> None:
        task, dt = world.task, world.config.dt
        self.world, self._dt = world, dt
        self.commands = Commands(world, num)
        self.target = np.zeros((num, world.num_hinges))  # commanded angles of the servos [rad]
        self.action = np.zeros((num, self.commands.num_actions))  # the last action, after clipping
        self.track_speed = np.zeros((num, 1))  # at an action of 1 [m/s]
        self.observer = Observer(world, num, self.commands.num_actions)
        self._own = self.observer.own
        self._own |= {"previous_action": self.action, "hinge_target": self.target}
        self._has_odometry, self._has_goal = "odometry" in self._own, "goal" in self._own
        is_reckoned = "goal_direction" in self._own
        self.reckoning = DeadReckoning(world) if is_reckoned else None
        self.believed = np.zeros((num, 3))  # poses of the heads by dead reckoning [m, rad]
        self.headed = np.zeros(num, dtype=np.int64)  # numbers of the places that bodies believe to head for
        self.track_odometry = self._own.get("track_odometry", np.zeros((num, 1)))
        self._integrates = is_reckoned or "track_odometry" in self._own
        self._has_driven = np.zeros(num, dtype=bool)
        self.state = TaskState(world.scene, task.goal, num, dt, self.action)
        self._watch = Watch(task, self.state, np.inf if max_ticks is None else max_ticks)
        self.reasons = Reasons(task)
        self.reason = np.zeros(num, dtype=np.int64)  # numbers of the words of `reasons`
        self._largest_squares = _SOUND * self.state.criteria.max_rate**2
        rewards = tuple(f"reward_{term.name}" for term in task.rewards)
        self.number_names = ("x_position", "progress", "time", *rewards, "lowest_module", "least_upright")
        self.flag_names = BASE_FLAGS + tuple(term.name for term in task.terminations)
        self.info_names = self.number_names + self.flag_names
        self.flags = self._watch.flags  # `[flags, N]` of `info` at the last tick or reset of each
        self.numbers = np.zeros((len(self.number_names), num))  # `[numbers, N]` likewise
        self._head, self._gained, self._time = self.numbers[:3]
        self._gains, self._lows = list(self.numbers[3:-2]), self.numbers[-2:]
        self._tick_length = np.full(num, dt)
        terms = [
            (
                check_function(f"reward {term.name!r}", term.function),
                np.full(num, term.weight * (dt if term.per_second else 1.0)),
                row,
            )
            for term, row in zip(task.rewards, self._gains, strict=True)
        ]
        is_final = [term.at_end for term in task.rewards]
        self._rewards = [term for term, at_end in zip(terms, is_final, strict=True) if not at_end]
        self._final_rewards = [term for term, at_end in zip(terms, is_final, strict=True) if at_end]
        self._given = [row for _, _, row in self._rewards]
        self._has_final = False
        self._start_head = np.zeros(num)
        self._servos, self._dofs = make_slice(world.hinge_servos), make_slice(world.hinge_dof)
        self._is_live = world.is_sliced and isinstance(self._servos, slice) and isinstance(self._dofs, slice)
        self._viewed: Physics | None = None
        self._rates: np.ndarray | None = None
        self._ends = self.state.measures[_LOWEST : _LOWEST + 2]
        self._columns = list(zip(self.numbers.T, self.flags.T, strict=True))
        self._never = np.zeros(num, dtype=bool)
        self._recorders = world.config.recorders

    def _view(self, physics: Physics) -> None:
        """Let the state read from the physics; once, where its views stay valid while it goes on."""
        if physics is self._viewed and self._is_live:
            return
        self._viewed = physics
        qvel, force = physics.qvel, physics.actuator_force
        self._rates = qvel.reshape(-1) if qvel.flags.c_contiguous else None
        self.state.bind(
            Views(physics.position, physics.rotation, qvel, qvel[:, self._dofs], force[:, self._servos])
        )

    def begin(self, physics: Physics, rows: list[int], speeds: Sequence[float]) -> None:
        """Start episodes from the present physics: hinges are held as they are and the tracks run forward."""
        self._view(physics)
        state, hinges = self.state, self.commands.num_hinges
        self.target[rows] = physics.qpos[rows][:, self.world.hinge_qpos]
        self.action[rows, :hinges] = np.clip(self.target[rows] / self.world.servo_range, -1.0, 1.0)
        self.action[rows, hinges:] = 1.0
        self.track_speed[rows, 0] = speeds
        self.track_odometry[rows] = self.world.scene.start_on_map
        if self.reckoning is not None:
            self.believed[rows], self.headed[rows] = self.reckoning.start, 0
            self._find_direction(rows)
        state.begin(rows, speeds)
        self._watch.begin(rows)
        self._has_driven[rows] = False
        self.reason[rows] = 0
        self.numbers[:, rows] = 0.0
        self._start_head[rows] = self._head[rows] = state.along[rows, 0]
        self._lows[:, rows] = self._ends[:, rows]
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
        """Take actions; return the targets of the servos and the speeds of the tracks."""
        if not isfinite(np.vdot(actions, actions)):
            self.commands.refuse_infinite(actions, active)
        if active is None:
            self.action[...], self.target[...] = self.commands.take(actions, self.target, np)
        else:
            actions = np.where(active[:, None], actions, self.action)
            self.action[...], target = self.commands.take(actions, self.target, np)
            np.copyto(self.target, target, where=active[:, None])
        if self._integrates:
            self._has_driven[:] = True if active is None else active
        return self.target, self.commands.compute_track_speed(self.track_speed, self.action)

    def observe(self, physics: Physics) -> Float[np.ndarray, "N O"]:
        """Return noiseless observations, within their bounds."""
        if self._has_odometry:
            self._own["odometry"][:, 0] = self.state.along[:, 0] - self._start_head
        if self._has_goal:
            self._own["goal"][...] = find_goal(self.state)
        for sensor in self.observer.sensors:
            values = sensor.read(self.state)
            check_finite(f"sensor {sensor.name!r}", values, self.state)
            self._own[sensor.name][...] = values
        if self._integrates and self._has_driven.any():
            self._integrate(physics)
        return self.observer.read(physics)

    def _integrate(self, physics: Physics) -> None:
        """Add the way of the last tick to what bodies believe, once."""
        driven, rotation = self._has_driven, physics.rotation
        speed = self.commands.compute_track_speed(self.track_speed, self.action)
        way = measure_way(rotation, self.commands.compute_head_speed(speed), self._dt, np)
        self.track_odometry[driven, 0] += way[driven]
        if self.reckoning is not None:
            moved = self.reckoning.move(self.believed, rotation, speed * self._dt, np)
            self.believed[driven] = moved[driven]
            self._find_direction(np.flatnonzero(driven))
        self._has_driven[:] = False

    def _find_direction(self, rows: Any) -> None:
        assert self.reckoning is not None
        found = self.reckoning.pass_places(self.believed[rows], self.headed[rows], np)
        self.headed[rows], self._own["goal_direction"][rows] = found

    def finish_tick(self, physics: Physics, active: Bool[np.ndarray, " N"] | None = None) -> Ticks:
        """Return how the control step ended whose physics has just been stepped, and its rewards."""
        self._view(physics)
        rates, qvel = self._rates, physics.qvel
        squares = np.vdot(qvel, qvel) if rates is None else rates.dot(rates)
        if squares < self._largest_squares:
            return self._finish(active, True)
        with np.errstate(all="ignore"):
            return self._finish(active, False)

    def _finish(self, active: Bool[np.ndarray, " N"] | None, is_sound: bool) -> Ticks:
        state, watch = self.state, self._watch
        state.advance(active, is_sound)
        has_ended = watch.look(active, is_sound)
        if self._recorders:
            self._record(~self._never if active is None else active)
        kept = None if active is None else self.numbers.copy()
        self._head[...] = state.along[:, 0]
        np.subtract(state.progress, state.start_progress, self._gained)
        np.multiply(state.tick, self._tick_length, self._time)
        self._lows[...] = self._ends
        for function, factor, row in self._rewards:
            np.multiply(function(state), factor, row)
        given = self._given
        if has_ended or self._has_final:
            self._give_final_rewards(has_ended)
            given = self._gains
        reward = add_rewards(given) if given else np.zeros(state.num)
        if not is_sound:
            np.copyto(self._head, state.start_mean, where=~state.is_sound)
        if active is not None:
            np.copyto(self.numbers, kept, where=~active)  # pyright: ignore[reportArgumentType]
            reward = np.where(active, reward, 0.0)
        if has_ended:
            self.reason[:] = self.reasons.find(self.flags, watch.is_late, np)
            return Ticks(reward, watch.terminated, watch.truncated, True)
        return Ticks(reward, self._never, self._never, False)

    def _give_final_rewards(self, has_ended: bool) -> None:
        """Give what is given once in the simulations whose episodes have ended, and nothing in the others."""
        ended = self._watch.terminated | self._watch.truncated if has_ended else self._never
        for function, factor, row in self._final_rewards:
            row[:] = np.where(ended, function(self.state) * factor, 0.0)
        self._has_final = has_ended

    def describe(self, row: int) -> dict[str, float | bool | str]:
        """Return the `info` of one simulation."""
        numbers, flags = self._columns[row]
        info = dict(zip(self.info_names, numbers.tolist() + flags.tolist(), strict=False))
        info["reason"] = str(self.reasons.words[self.reason[row]])
        return info


def add_rewards(rewards: Sequence[Any]) -> Any:
    """Return the sum of rewards, of at least one, added in their order, in an array of its own."""
    return sum(rewards[2:], rewards[0] + rewards[1]) if len(rewards) > 1 else +rewards[0]
