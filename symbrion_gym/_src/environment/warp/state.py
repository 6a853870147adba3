"""What lasts from tick to tick of an episode, and what the terms of a task see on a device, as arrays of JAX."""

from collections.abc import Callable
from copy import copy
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.route import SuccessCriteria
from symbrion_gym._src.tasks.state import Scene

_EDGE_TOLERANCE = 1e-5
"""How far outside a triangle (barycentric) a point still counts as inside, in single precision."""


class DeviceGround:
    """The surface of a scene as tables on a device: what `Scene.find_ground` finds, in single precision."""

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

    def _find_cell(self, offset: Float[jax.Array, " P"], count: int) -> Int[jax.Array, " P"]:
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
    """What lasts from tick to tick of N episodes, of NumPy on the host, of JAX on a device."""

    target: Any  # `[N, h]` commanded angles of the servos [rad]
    action: Any  # `[N, A]` the last action, after clipping
    track_speed: Any  # `[N]` speed of the tracks at an action of 1 [m/s]
    track_odometry: Any  # `[N, 1]` position of the head by its tracks [m]
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


class DeviceState:
    """The state of a task in N simulations on a device, under `jax.jit`; all of them are in one scene.

    Attributes and methods are those of `TaskState`.
    """

    xp: Any = jnp

    def __init__(self, world: World, num: int) -> None:
        """Begin with what no episode changes."""
        self.scene, self._ground, self._goal = world.scene, DeviceGround(world.scene), world.task.goal
        self._dofs, self._servos = world.hinge_dof, world.hinge_servos
        self.num, self.dt = num, world.config.dt
        self.criteria = SuccessCriteria.of(world.organism.scout)
        self.arena, self.organism, self.route = world.arena, world.organism, world.route
        limits = self.route.finish, self.route.half_width, self.route.lowest
        self.finish, self.half_width, self.deepest = (np.full(num, each, dtype=np.float32) for each in limits)

    def look(self, episode: Episode, physics: Any) -> "DeviceState":
        """Return the state of episodes after a tick of the physics, with the action of this tick."""
        state = copy(self)
        state._measure(episode, physics)
        return state

    def _measure(self, episode: Episode, physics: Any) -> None:
        self.position, self.rotation, self.qvel = physics.position, physics.rotation, physics.qvel
        self.hinge_rate, self.up = self.qvel[:, self._dofs], self.rotation[:, :, 8]
        self.torque = physics.actuator_force[:, self._servos]
        self.action, self.track_speed = episode.action, episode.track_speed
        self.start_position, self.start_mean = episode.start_position, episode.start_mean
        self.start_progress, self.start_way = episode.start_progress, episode.start_way
        self.previous_progress, self.tick = episode.progress, episode.tick + 1.0
        self.time, self.middle = self.tick * self.dt, self.position.mean(axis=1)
        self.memory = dict(episode.memory)
        self.success = self.failed = self.ended = jnp.zeros(self.num, dtype=bool)
        self.is_sound = (jnp.abs(self.qvel) < self.criteria.max_rate).all(axis=1)
        x, y, z = (self.position[:, :, i] for i in range(3))
        (c, s), is_along_x = self.route.direction, self.scene.is_along_x
        self.along = x if is_along_x else c * x + s * y
        self.left = y if is_along_x else c * y - s * x - self.route.lateral
        self.local = jnp.stack([self.along, self.left, z], axis=2)
        self.rear, self.lowest, self.least_up, self.least_left, self.least_right = (
            self._trust(each.min(axis=1)) for each in (self.along, z, self.up, self.left, -self.left)
        )
        self.power = self._trust(jnp.abs(self.torque * self.hinge_rate).sum(axis=1))
        self.mean_to_finish = jnp.minimum(self.along, self.finish[:, None]).mean(axis=1)
        progress = self._goal.progress(self)  # pyright: ignore[reportArgumentType]
        if getattr(self._goal, "is_straight", False):
            self.way = self._trust(progress)
        else:
            x, y = (self.middle - self.start_position.mean(axis=1))[:, :2].T
            self.way = self._trust(jnp.hypot(x, y))
        self.progress = self._trust(progress, self.previous_progress)
        lead = self.way - self.compute_pace()
        self.was_ahead = episode.was_ahead | (
            lead > self.criteria.fall_lead * (z.max(axis=1) - z.mean(axis=1))
        )

    def compute_pace(self) -> Any:
        """Return how far each body can have come by its tracks, with the slack that the criteria leave [m]."""
        return self.start_way + self.track_speed * self.time + self.criteria.speed_slack

    def compute_mean_along(self) -> Any:
        """Return the mean position of the modules along the way [m]."""
        return self.along.mean(axis=1)

    def _trust(self, value: Any, other: Any = 0.0) -> Any:
        """Return a value where the simulation is numerically stable."""
        return jnp.where(self.is_sound, value, other)

    def remember(self, name: str, initial: Any) -> Any:
        """Return what a term remembers; it was begun on the host, with the episode."""
        del initial
        if name not in self.memory:
            raise TaskError(f"a term remembers {name!r} in some ticks alone; call remember() in every tick")
        return self.memory[name]

    def keep(self, name: str, values: Any, where: Bool[Any, " N"]) -> None:
        """Change what a term remembers in some simulations."""
        before: Any = self.memory[name]
        self.memory[name] = select(where, values, before).astype(before.dtype)

    def may_hold(self, mask: Bool[Any, " N"]) -> bool:
        """Return True: looking would wait for the device."""
        del mask
        return True

    def confirm(self, mask: Any, find: Callable[[Any], Any]) -> Any:
        """Return where something is so and something else as well, which is computed for all or for none."""
        rows = jnp.arange(len(mask))
        return jax.lax.cond(mask.any(), lambda: mask & find(rows), lambda: mask)

    def compute_height(self, rows: Int[Any, " M"]) -> Any:
        """Return the height of the modules above the ground in some simulations [m]; NaN where there is none."""
        places = self.position[rows]
        x, y, z = places.reshape(-1, 3).T
        return (z - self._ground.find_ground(x, y, z)).reshape(places.shape[:2])

    @property
    def height(self) -> Any:
        """Height of each module's center above the ground [m]; NaN where there is none."""
        return self.compute_height(jnp.arange(self.num))

    @property
    def target(self) -> Any:
        """Place (x, y) that each body should head for [m]."""
        find = getattr(self._goal, "find_target", None)
        if find is not None:
            return find(self)
        place = self.route.place(self.route.finish)
        return jnp.tile(jnp.asarray(place, dtype=jnp.float32), (self.num, 1))


def select(mask: Bool[Any, " N"], one: Any, other: Any) -> Any:
    """Return the rows of trees of arrays where a mask holds, and those of others elsewhere."""

    def choose(first: Any, second: Any) -> Any:
        return jnp.where(mask.reshape(mask.shape + (1,) * (second.ndim - 1)), first, second)

    return jax.tree.map(choose, one, other)
