"""What the terms of a task see on a device: the quantities of `TaskState` as arrays of JAX, under `jax.jit`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.route import SuccessCriteria
from symbrion_gym._src.tasks.state import Scene

_EDGE_TOLERANCE = 1e-5
"""How far outside a triangle (barycentric) a point still counts as inside, in single precision."""


class DeviceGround:
    """The surface of a scene as tables on a device: what `Scene.find_ground` finds, in single precision.

    Args:
        scene: arena and way.
    """

    def __init__(self, scene: Scene) -> None:
        grid = scene.arena.elevation.export_grid()
        self._has_storeys = scene.route.start_height is not None
        self._origin, self._cell = np.asarray(grid.origin, dtype=np.float32), float(grid.cell)
        self._shape = grid.shape
        self._most = int(np.diff(grid.starts).max(initial=0))
        self._starts = np.asarray(grid.starts, dtype=np.int32)
        # One triangle more, so that a cell without one has something to look up.
        self._triangles = np.append(grid.triangles, 0).astype(np.int32)
        self._table = np.asarray(grid.table if len(grid.table) else np.ones((1, 10)), dtype=np.float32)

    def find_ground(
        self, x: Float[jax.Array, " P"], y: Float[jax.Array, " P"], z: Float[jax.Array, " P"]
    ) -> Float[jax.Array, " P"]:
        """Return the height of the ground, NaN where there is none [m]; see `Scene.find_ground`."""
        starts, triangles, table = map(jnp.asarray, (self._starts, self._triangles, self._table))
        row = self._find_cell(x - self._origin[0], self._shape[0])
        column = self._find_cell(y - self._origin[1], self._shape[1])
        cell = row * self._shape[1] + column
        first, last = starts[cell], starts[cell + 1]

        def look(slot: jax.Array, highest: jax.Array) -> jax.Array:
            number = first + slot
            entry = table[triangles[jnp.minimum(number, len(self._triangles) - 1)]]
            height = _compute_height_in(entry, x, y)
            is_seen = (number < last) & (height <= z) if self._has_storeys else number < last
            return jnp.maximum(highest, jnp.where(is_seen, height, -jnp.inf))

        height = jax.lax.fori_loop(0, self._most, look, jnp.full(x.shape, -jnp.inf, dtype=x.dtype))
        return jnp.where(jnp.isneginf(height), jnp.nan, height)

    def _find_cell(self, offset: Float[jax.Array, " P"], count: int) -> jax.Array:
        """Return the cells along an axis; those of places that are not finite are the first."""
        number = jnp.where(jnp.isfinite(offset), jnp.floor(offset / self._cell), 0.0)
        return jnp.clip(number, 0, count - 1).astype(jnp.int32)


def _compute_height_in(
    entry: Float[jax.Array, "P 10"], x: Float[jax.Array, " P"], y: Float[jax.Array, " P"]
) -> Float[jax.Array, " P"]:
    """Return the height of each triangle at its point, -inf outside of it (barycentric coordinates)."""
    corner_x, corner_y, z, b_x, b_y, c_x, c_y, b_z, c_z, area = entry.T
    to_x, to_y = x - corner_x, y - corner_y
    weight_b = (to_x * c_y - to_y * c_x) / area
    weight_c = (b_x * to_y - b_y * to_x) / area
    weight_a = 1.0 - weight_b - weight_c
    is_inside = jnp.minimum(jnp.minimum(weight_a, weight_b), weight_c) >= -_EDGE_TOLERANCE
    return jnp.where(is_inside, weight_a * z + weight_b * b_z + weight_c * c_z, -jnp.inf)


class Episode(NamedTuple):
    """What lasts from tick to tick of N episodes. Every field has N rows: of NumPy
    on the host, of JAX on a device.
    """

    target: Any  # `[N, h]` commanded angles of the servos [rad]
    action: Any  # `[N, A]` the last action, after clipping
    track_speed: Any  # `[N]` speed of the tracks at an action of 1 [m/s]
    track_odometry: Any  # `[N]` position of the head by its tracks [m]
    believed: Any  # `[N, 3]` pose of the head by dead reckoning [m, rad]
    headed: Any  # `[N]` number of the place that the body believes to head for
    start_head: Any  # `[N]` position of the head along the way at the start [m]
    start_position: Any  # `[N, n, 3]` positions at the start [m]
    start_mean: Any  # `[N]` mean position along the way at the start [m]
    start_progress: Any  # `[N]` progress at the start
    start_way: Any  # `[N]` way at the start [m]
    progress: Any  # `[N]` progress at the last tick
    tick: Any  # `[N]` ticks since the start
    was_ahead: Any  # `[N]` whether the body was ever farther ahead of its tracks than a fall explains
    held: Any  # `[N]` for how many ticks it has arrived
    memory: dict[str, Any]  # what terms remember, name -> `[N, ...]`
    numbers: Any  # `[N, K]` numbers of `info`
    flags: Any  # `[N, F]` flags of `info`
    observation: Any  # `[N, O]` the last observation


class Course(NamedTuple):
    """What all simulations have in common."""

    scene: Scene  # arena and way
    goal: Any  # goal of the task
    ground: DeviceGround  # heights of the surface
    num: int  # number of simulations
    dt: float  # length of a tick [s]
    criteria: SuccessCriteria  # limits of standing, rolling over and so on


class DeviceState:
    """The state of a task in N simulations; see `TaskState` for the attributes and `HostArrays` for the methods.

    Args:
        course: what the simulations have in common.
        episode: what lasts, with the action of this tick.
        position: centers of the modules [m].
        rotation: their rotation matrices, row by row.
        qvel: generalized velocities.
        hinge_rate: [rad/s].
        torque: of the hinges [N m].
    """

    xp: Any = jnp

    def __init__(
        self,
        course: Course,
        episode: Episode,
        position: Float[jax.Array, "N n 3"],
        rotation: Float[jax.Array, "N n 9"],
        qvel: Float[jax.Array, "N nv"],
        hinge_rate: Float[jax.Array, "N h"],
        torque: Float[jax.Array, "N h"],
    ) -> None:
        self._course, route = course, course.scene.route
        self.position, self.rotation, self.qvel = position, rotation, qvel
        self.hinge_rate, self.torque, self.up = hinge_rate, torque, rotation[:, :, 8]
        self.num, self.dt, self.criteria = course.num, course.dt, course.criteria
        self.action, self.track_speed = episode.action, episode.track_speed
        self.start_position, self.start_mean = episode.start_position, episode.start_mean
        self.start_progress, self.start_way = episode.start_progress, episode.start_way
        self.was_ahead = episode.was_ahead
        self.previous_progress, self.tick = episode.progress, episode.tick + 1.0
        self.memory = dict(episode.memory)
        self.scenes = [course.scene] * course.num
        self.finish, self.half_width, self.deepest = (
            jnp.full(course.num, value, dtype=position.dtype)
            for value in (route.finish, route.half_width, route.lowest)
        )
        self.success = self.failed = jnp.zeros(course.num, dtype=bool)
        self._measure()

    def _measure(self) -> None:
        self.is_sound = (jnp.abs(self.qvel) < self.criteria.max_rate).all(axis=1)
        x, y, z = (self.position[:, :, i] for i in range(3))
        (c, s), lateral = self._course.scene.route.direction, self._course.scene.route.lateral
        is_along_x = self._course.scene.is_along_x
        self.along = x if is_along_x else c * x + s * y
        self.left = y if is_along_x else c * y - s * x - lateral
        self.local = jnp.stack([self.along, self.left, z], axis=2)
        self.rear, self.lowest = self._find_least(self.along), self._find_least(z)
        self.least_left, self.least_right = self._find_least(self.left), self._find_least(-self.left)
        self.least_up = self._find_least(self.up)
        self.power = self._trust(jnp.abs(self.torque * self.hinge_rate).sum(axis=1))
        self.mean_to_finish = jnp.minimum(self.along, self.finish[:, None]).mean(axis=1)
        progress = self._course.goal.progress(self)
        if getattr(self._course.goal, "is_straight", False):
            self.way = self._trust(progress)
        else:
            x, y = (self.middle - self.start_position.mean(axis=1))[:, :2].T
            self.way = self._trust(jnp.hypot(x, y))
        self.progress = self._trust(progress, self.previous_progress)
        self._note_lead()

    def _trust(self, value: jax.Array, other: Any = 0.0) -> jax.Array:
        """Return a value where the simulation is numerically stable."""
        return jnp.where(self.is_sound, value, other)

    def _find_least(self, values: Float[jax.Array, "N n"]) -> Float[jax.Array, " N"]:
        return self._trust(values.min(axis=1))

    def _note_lead(self) -> None:
        """Remember the bodies that are farther ahead of their tracks than a fall explains."""
        height = self.position[:, :, 2]
        hang = height.max(axis=1) - height.mean(axis=1)
        self.was_ahead |= self.way > self.compute_pace() + self.criteria.fall_lead * hang

    def compute_pace(self) -> Float[jax.Array, " N"]:
        """Return how far each body can have come by its tracks, with the slack that the criteria leave [m]."""
        return self.start_way + self.track_speed * self.time + self.criteria.speed_slack

    def remember(self, name: str, initial: Any) -> jax.Array:
        """Return what a term remembers; it was begun on the host, with the episode."""
        del initial
        if name not in self.memory:
            raise TaskError(f"a term remembers {name!r} in some ticks alone; call remember() in every tick")
        return self.memory[name]

    def keep(self, name: str, values: jax.Array, where: Bool[jax.Array, " N"]) -> None:
        """Change what a term remembers in some simulations."""
        before = self.memory[name]
        mask = where.reshape(where.shape + (1,) * (before.ndim - 1))
        self.memory[name] = jnp.where(mask, values, before).astype(before.dtype)

    def group(self, mask: Bool[jax.Array, " N"]) -> Iterator[tuple[Scene, Int[jax.Array, " N"]]]:
        """Yield the scene of all simulations, with all of them."""
        del mask
        yield self._course.scene, jnp.arange(self.num)

    def write(self, name: str, place: Any, values: Any, where: Bool[jax.Array, " N"]) -> None:
        """Change entries of what a term remembers, in the simulations where `where` holds."""
        before, rows = self.memory[name], place[0] if isinstance(place, tuple) else place
        after = jnp.where(where[rows], values, before[place]).astype(before.dtype)
        self.memory[name] = before.at[place].set(after, unique_indices=True)

    def may_hold(self, mask: Bool[jax.Array, " N"]) -> bool:
        """Return True: looking would wait for the device."""
        del mask
        return True

    def confirm(
        self,
        mask: Bool[jax.Array, " M"],
        find: Callable[[Int[jax.Array, " M"]], Bool[jax.Array, " M"]],
    ) -> Bool[jax.Array, " M"]:
        """Return where something is so and something else as well, which is computed for all or for none."""
        rows = jnp.arange(len(mask))
        return jax.lax.cond(mask.any(), lambda: mask & find(rows), lambda: mask)

    def compute_height(self, rows: Int[jax.Array, " M"]) -> Float[jax.Array, "M n"]:
        """Return the height of the modules above the ground in some simulations [m]; NaN where there is none."""
        places = self.position[rows]
        x, y, z = places.reshape(-1, 3).T
        return (z - self._course.ground.find_ground(x, y, z)).reshape(places.shape[:2])

    def compute_mean_along(self) -> Float[jax.Array, " N"]:
        """Return the mean position of the modules along the way [m]."""
        return self.along.mean(axis=1)

    @property
    def time(self) -> Float[jax.Array, " N"]:
        """Time since the start [s]."""
        return self.tick * self.dt

    @property
    def height(self) -> Float[jax.Array, "N n"]:
        """Height of each module's center above the ground [m]; NaN where there is none."""
        return self.compute_height(jnp.arange(self.num))

    @property
    def middle(self) -> Float[jax.Array, "N 3"]:
        """Mean position of the modules [m]."""
        return self.position.mean(axis=1)

    @property
    def target(self) -> Float[Any, "N 2"]:
        """Place (x, y) that each body should head for [m]."""
        find = getattr(self._course.goal, "find_target", None)
        if find is not None:
            return find(self)
        route = self._course.scene.route
        (c, s), far = route.direction, route.finish
        place = c * far - s * route.lateral, s * far + c * route.lateral
        return np.tile(np.asarray(place, dtype=np.float32), (self.num, 1))

    @property
    def organism(self) -> Any:
        """Organism of all simulations."""
        return self._course.scene.organism
