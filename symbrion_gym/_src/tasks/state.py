"""The state of a task in N simulations: what terms read, computed at most once a tick, as arrays over all of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.route import Route, SuccessCriteria

UPPER_MEASURES = ("progress", "way", "tick", "rear")
LOWER_MEASURES = ("least_left", "lowest", "least_up", "least_right")
MEASURES = UPPER_MEASURES + LOWER_MEASURES
"""What is measured of every simulation in every tick: progress; the way that its tracks have to account for [m]; ticks
since the start; of the modules the position least far along the way, least far to the left of its middle, the lowest
height [m], the least z of an up axis, and the position least far to the right [m]. A term may name limits: upper ones
of the first four, lower ones of the others."""
_REAR = MEASURES.index("rear")
_find_least = np.minimum.reduceat
_add_up = np.add.accumulate
Initial: TypeAlias = "float | np.ndarray | Callable[[TaskState], np.ndarray]"


@dataclass(frozen=True, eq=False)
class Scene:
    """An arena with the way of a task through it, and who is in it: what a simulation takes place in."""

    arena: Arena  # arena of the simulation
    organism: Organism  # organism in it
    route: Route  # the way to go
    map_route: Route  # the way on the robot's map, which `stretch` does not change

    @property
    def is_along_x(self) -> bool:
        """Whether the way runs along x, in the middle."""
        return self.route.heading == 0.0 and self.route.lateral == 0.0

    @property
    def start_on_map(self) -> float:
        """Start on the robot's map, from the middle of the pit, if there is one [m]."""
        near, far, _ = self.map_route.pit or (0.0, 0.0, 0.0)
        return self.map_route.start - (near + far) / 2

    def find_ground(
        self, x: Float[np.ndarray, " P"], y: Float[np.ndarray, " P"], z: Float[np.ndarray, " P"]
    ) -> Float[np.ndarray, " P"]:
        """Return the height of the ground: the surface, or below a ceiling its highest part beneath the places [m]."""
        if self.route.start_height is None:
            return self.arena.height(x, y)
        return self.arena.elevation.height_below(x, y, z)


class Views(NamedTuple):
    """What is read of the physics of N simulations."""

    position: Float[np.ndarray, "N n 3"]  # centers of the modules [m], one physics step behind
    rotation: Float[np.ndarray, "N n 9"]  # their rotation matrices, row by row, likewise
    qvel: Float[np.ndarray, "N nv"]  # generalized velocities
    hinge_rate: Float[np.ndarray, "N h"]  # [rad/s]
    torque: Float[np.ndarray, "N h"]  # of the hinges [N m], one physics step behind


class TaskState:
    """What the terms of a task see. Rows are simulations; one is a row like any other.

    A term that uses operators, methods of arrays, the functions of `xp`, `may_hold`, `confirm` and `keep` runs on a
    device as well, on a `DeviceState` (`symbrion_gym._src.environment.warp.state`). There all simulations are computed
    at once: whatever looks at values (`if`, `np.flatnonzero`) belongs into these methods.

    Attributes:
        position: `[N, n, 3]` centers of the modules [m].
        rotation: `[N, n, 9]` their rotation matrices, row by row.
        up: `[N, n]` z of their up axes.
        along: `[N, n]` how far along the way each module is [m].
        left: `[N, n]` how far left of the way's middle each module is [m].
        qvel: `[N, nv]` generalized velocities.
        hinge_rate: `[N, h]` [rad/s].
        torque: `[N, h]` torque of the hinges [N m].
        action: `[N, A]` the last action, after clipping.
        measures: `[8, N]` values of `MEASURES`.
        progress: `[N]` progress by the goal.
        previous_progress: `[N]` that of the tick before.
        start_progress: `[N]` that at the start.
        start_position: `[N, n, 3]` positions at the start [m].
        start_mean: `[N]` mean position of the modules along the way at the start [m].
        way: `[N]` progress along a straight way; else the distance of the middle of the body from its start, in plan
            [m].
        start_way: `[N]` that at the start.
        was_ahead: `[N]` whether the body was at any time farther ahead of its tracks than a fall explains.
        tick: `[N]` ticks since the start.
        rear: `[N]` position of the last module along the way [m].
        least_left: `[N]` how far to the left of the way's middle the module is that is least so [m].
        least_right: `[N]` how far to the right the module is that is least so [m].
        lowest: `[N]` height of the lowest module [m].
        least_up: `[N]` least z of an up axis.
        is_sound: `[N]` whether the simulation is numerically stable.
        success: `[N]` whether the task is done; known to rewards.
        failed: `[N]` whether it failed; known to rewards.
        ended: `[N]` whether the episode has ended; known to rewards.
        track_speed: `[N]` speed of the tracks in this episode [m/s].
        dt: length of a tick [s].
        finish: `[N]` position along the way beyond which the goal lies [m].
        half_width: `[N]` distance to the side of the way at which the arena ends [m].
        deepest: `[N]` height below which a module has fallen off [m].
        criteria: limits of standing, rolling over and so on.
        power: `[N]` sum over the hinges of the absolute power [W].
        mean_to_finish: `[N]` mean position of the modules along the way, each counted up to the finish [m].
        memory: what terms remember, name -> `[N, ...]`; see `remember`.
        scene: arena and way of all simulations.
    """

    xp: Any = np  # namespace of the arrays, here NumPy

    def __init__(
        self, scene: Scene, goal: Any, num: int, dt: float, action: Float[np.ndarray, "N A"]
    ) -> None:
        count = scene.organism.num_modules
        self.num, self.dt, self.action, self._goal = num, dt, action, goal
        self.criteria = SuccessCriteria.of(scene.organism.scout)
        self._compute_progress = check_function(f"progress of {type(goal).__name__}", goal.progress)
        self._is_straight = getattr(goal, "is_straight", False)
        self.scene, route = scene, scene.route
        self.measures = np.zeros((len(MEASURES), num))
        self.progress, self.way, self.tick, self.rear = self.measures[: _REAR + 1]
        self.least_left, self.lowest, self.least_up, self.least_right = self.measures[_REAR + 1 :]
        self._progress_and_way, self._least = self.measures[:2], self.measures[_REAR:]
        # Of each module how far along and left of the way, its height, the z of its up axis, and how far right.
        places = np.zeros((5, count, num))
        self._places, self._firsts = places.reshape(5 * count, num), np.arange(0, 5 * count, count)
        self._coordinates = places[:3].transpose(2, 1, 0)
        self._ahead, self._beside, _, up, self._right = places
        self._up = up.T
        self._share, self._ones, self.mean_to_finish = np.full(num, 1.0 / count), np.ones(num), np.zeros(num)
        self.previous_progress, self.start_progress, self.start_way, self.start_mean = np.zeros((4, num))
        limits = route.finish, route.half_width, route.lowest
        self.finish, self.half_width, self.deepest = (np.full(num, each, dtype=float) for each in limits)
        self.start_position, self._turned = np.zeros((2, num, count, 3))
        self.track_speed, self._finish_of_each = np.zeros(num), np.full((count, num), route.finish)
        self.is_sound = np.ones(num, dtype=bool)
        self.success, self.failed, self.ended, self.was_ahead = np.zeros((4, num), dtype=bool)
        self.memory: dict[str, np.ndarray] = {}
        self._initial: dict[str, Initial] = {}
        self._cache: dict[str, Any] = {}
        self._direction = np.empty((3, num, 1))
        self._direction[:, :, 0] = np.array([*route.direction, route.lateral])[:, None]
        self._was_sound = True

    def bind(self, views: Views) -> None:
        """Read from the physics of this moment, or from views of it that stay valid as it goes on."""
        self.position, self.rotation, self.qvel, self.hinge_rate, self.torque = views
        self.up = self.rotation[:, :, 8]
        hinges, modules = self.torque.shape[1], self.position.shape[1]
        self._torques, self._hinge_rates = self.torque.T, self.hinge_rate.T
        self._addends, self._sums = np.zeros((2, 2, max(hinges, modules), self.num))
        self._clipped, self._powers = self._addends[0, :modules], self._addends[1, :hinges]
        self._to_finish, self.power = self._sums[0, modules - 1], self._sums[1, -1]
        self._local = self.position if self.scene.is_along_x else self._turned
        self.along, self.left = self._local[:, :, 0], self._local[:, :, 1]

    def begin(self, rows: list[int], track_speed: Sequence[float]) -> None:
        """Start episodes in some simulations, from the present physics."""
        self.track_speed[rows] = track_speed
        self.tick[rows] = 0.0
        for flags in (self.success, self.failed, self.ended, self.was_ahead):
            flags[rows] = False
        self.is_sound[rows] = True
        self.start_position[rows] = self.position[rows]
        progress = self.progress.copy()
        self._forget(rows)
        self.measure()
        progress[rows] = self.progress[rows]
        self.progress[:] = progress
        self.previous_progress[rows] = self.start_progress[rows] = progress[rows]
        self.start_way[rows] = self.way[rows]
        self.start_mean[rows] = self.compute_mean_along()[rows]
        self._forget(rows)

    def _forget(self, rows: Sequence[int]) -> None:
        for name, initial in self._initial.items():
            self.memory[name][rows] = initial(self)[rows] if callable(initial) else initial

    def advance(self, active: Bool[np.ndarray, " N"] | None, is_sound: bool) -> None:
        """Measure after a tick of the physics."""
        self.previous_progress[...] = self.progress
        tick = self.tick
        np.add(tick, self._ones if active is None else active, tick)
        self.measure()
        if not (is_sound and self._was_sound):
            self._distrust()

    def _distrust(self) -> None:
        """Find unstable simulations; nothing of them is kept."""
        self.is_sound[:] = (np.abs(self.qvel) < self.criteria.max_rate).all(axis=1)
        self._was_sound = bool(self.is_sound.all())
        unsound = ~self.is_sound
        tick, progress = self.tick[unsound], self.previous_progress[unsound]
        self.measures[:, unsound] = 0.0
        self.tick[unsound], self.progress[unsound] = tick, progress
        self.power[unsound] = 0.0

    def measure(self) -> None:
        """Measure the modules; what was computed of the last tick is forgotten."""
        if self._cache:
            self._cache.clear()
        if not self.scene.is_along_x:
            (c, s, lateral), x, y = self._direction, self.position[:, :, 0], self.position[:, :, 1]
            self._turned[:, :, 0] = c * x + s * y
            self._turned[:, :, 1] = c * y - s * x - lateral
            self._turned[:, :, 2] = self.position[:, :, 2]
        self._coordinates[...] = self._local
        self._up[...] = self.up
        np.negative(self._beside, self._right)
        _find_least(self._places, self._firsts, 0, None, self._least)
        np.minimum(self._ahead, self._finish_of_each, out=self._clipped)
        powers = self._powers
        np.multiply(self._torques, self._hinge_rates, powers)
        np.absolute(powers, powers)
        _add_up(self._addends, 1, None, self._sums)  # one after the other, whatever N is
        np.multiply(self._to_finish, self._share, self.mean_to_finish)
        if self._is_straight:
            self._progress_and_way[...] = self._compute_progress(self)
        else:
            self.progress[...] = self._compute_progress(self)
            x, y = (self.middle - self.start_position.mean(axis=1))[:, :2].T
            np.hypot(x, y, self.way)

    def compute_pace(self) -> Float[np.ndarray, " N"]:
        """Return how far each body can have come by its tracks, with the slack that the criteria leave [m]."""
        return self.start_way + self.track_speed * self.time + self.criteria.speed_slack

    def note_lead(self) -> Float[np.ndarray, " N"]:
        """Remember the bodies that are farther ahead of their tracks than a fall explains; return the way at which
        each is to be looked at again [m].

        Beyond the way of its tracks a body slides, pulled by what hangs: where modules have followed the head over an
        edge, their mean is h below the highest of the body, and this loss of height pays for the work of friction over
        h / mu at most, where mu is the friction.
        """
        pace = self.compute_pace()
        if np.count_nonzero(self.way > pace):
            height = self.position[:, :, 2]
            hang = height.max(axis=1) - add_up(height) * (1.0 / height.shape[1])
            self.was_ahead |= self.way > pace + self.criteria.fall_lead * hang
        pace[self.was_ahead] = np.inf
        return pace

    def remember(self, name: str, initial: Initial) -> np.ndarray:
        """Return an array `[N, ...]` that a term may change; in each simulation it begins again with the episode."""
        if name not in self.memory:
            value = initial(self) if callable(initial) else np.asarray(initial)
            shape = value.shape if callable(initial) else (self.num, *value.shape)
            self.memory[name] = np.array(np.broadcast_to(value, shape))
            self._initial[name] = initial
        return self.memory[name]

    def may_hold(self, mask: Bool[np.ndarray, " N"]) -> bool:
        """Return whether something is so in any simulation; on a device True, as looking would take time."""
        return bool(np.count_nonzero(mask))

    def confirm(
        self, mask: Bool[np.ndarray, " M"], find: Callable[[Int[np.ndarray, " K"]], Bool[np.ndarray, " K"]]
    ) -> Bool[np.ndarray, " M"]:
        """Return where something is so and something else as well, which is looked for only there."""
        rows = np.flatnonzero(mask)
        if len(rows):
            mask[rows] = find(rows)
        return mask

    def keep(self, name: str, values: np.ndarray, where: Bool[np.ndarray, " N"]) -> None:
        """Change what a term remembers in some simulations; see `remember`."""
        np.copyto(self.memory[name], values, where=where)

    @property
    def time(self) -> Float[np.ndarray, " N"]:
        """Time since the start [s]."""
        return self.tick * self.dt

    @property
    def height(self) -> Float[np.ndarray, "N n"]:
        """Height of each module's center above the ground [m]; NaN where there is none."""
        if "height" not in self._cache:
            self._cache["height"] = self.compute_height(np.arange(self.num))
        return self._cache["height"]

    @property
    def middle(self) -> Float[np.ndarray, "N 3"]:
        """Mean position of the modules [m]."""
        if "middle" not in self._cache:
            self._cache["middle"] = self.position.mean(axis=1)
        return self._cache["middle"]

    @property
    def target(self) -> Float[np.ndarray, "N 2"]:
        """Place (x, y) that each body should head for [m]: the goal's own, or the finish in the middle of the way."""
        find = getattr(self._goal, "find_target", None)
        if find is not None:
            return find(self)
        c, s, lateral = self._direction[:, :, 0]
        return np.column_stack([c * self.finish - s * lateral, s * self.finish + c * lateral])

    @property
    def organism(self) -> Organism:
        """Organism of all simulations."""
        return self.scene.organism

    def compute_mean_along(self) -> Float[np.ndarray, " N"]:
        """Return the mean position of the modules along the way [m]."""
        return add_up(self.along) * (1.0 / self.along.shape[1])

    def compute_height(self, rows: Int[np.ndarray, " M"]) -> Float[np.ndarray, "M n"]:
        """Return `height` of some simulations alone, as looking for the ground is slow."""
        x, y, z = self.position[rows].reshape(-1, 3).T
        return (z - self.scene.find_ground(x, y, z)).reshape(len(rows), -1)


_OURS = f"{__name__.partition('.')[0]}."
"""Functions of this package return what they should, and are called without a check, which saves time."""


def check_function(what: str, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function of a task as it is, or with a check of what it returns if a user wrote it."""
    plain = getattr(function, "__func__", function)
    named = plain if hasattr(plain, "__qualname__") else type(plain).__call__
    if str(getattr(named, "__module__", "")).startswith(_OURS):
        return function

    def call(state: TaskState) -> Any:
        try:
            value = function(state)
        except AttributeError as error:
            if error.obj is state:
                check_choice(what, error.name, [each for each in dir(state) if each[0] != "_"], TaskError)
            raise
        shape, is_number = np.shape(value), np.asarray(value).dtype.kind in "biuf"
        if shape != (state.num,) or not is_number:
            found = f"an array of shape {shape}" if is_number else f"{value!r}"
            raise TaskError(
                f"{what} returned {found}; one number or truth value for each of {state.num} simulations, an array of "
                f"shape ({state.num},), is needed"
            )
        check_finite(what, value, state)
        return value

    return call


def check_finite(what: str, values: Any, state: TaskState) -> None:
    """Refuse what is not finite, but of unstable simulations."""
    if not np.isfinite(np.asarray(values)[state.is_sound]).all():
        raise TaskError(f"{what} returned {values!r}, which is not finite; mend its function")


def add_up(values: Float[Any, "N n"]) -> Float[Any, " N"]:
    """Return the sums of rows, added one value after the other: the same bits whatever N is."""
    if not isinstance(values, np.ndarray):
        return values.sum(axis=1)  # of a device
    return np.add.accumulate(values, axis=1)[:, -1] if values.shape[1] else np.zeros(len(values))
