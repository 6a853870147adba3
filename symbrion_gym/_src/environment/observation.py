"""What the organism senses, and where it believes to be: the layout of the observation, and how it is read.

Functions of arrays take `xp`, NumPy on the host and `jax.numpy` on a device.
"""

from collections.abc import Mapping
from math import isnan, pi
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.environment.world import Physics, World, make_slice
from symbrion_gym._src.robot.organism import MEASURED, Organism
from symbrion_gym._src.robot.scout import find_road_wheels
from symbrion_gym._src.robot.scout_constants import SensorNoise
from symbrion_gym._src.tasks.reach import ReachPlaces, find_passing
from symbrion_gym._src.tasks.state import add_up

_LARGEST_RATE = 20.0  # Bound of the hinges' rates [rad/s], beyond what their servos reach
_LARGEST_DISTANCE = 100.0  # Bound of distances along the route [m], beyond any arena
_ANGLE_MARGIN = 1.1  # Hinges give a little beyond their range under load: factor on its bounds
_FORCE_MARGIN = 5
"""Docks never tear: factor on the force that they hold, for the bounds of what they may read."""
_LEAST_LEVEL = 0.2
"""Cosine of the pitch that is assumed of steeper modules: near the vertical a heading would turn at any rate."""
_NEARER = 0.7
"""A body turns to the next place when it believes to be this share of the distance from it that counts as there: an
error of its belief by a few centimeters shall not make it miss the place."""
_FAR = 100.0  # Goals that are at no place lie straight ahead, this far away [m]


def _find_bounds(
    world: World, num_actions: int
) -> dict[str, tuple[int, float | np.ndarray, float | np.ndarray]]:
    """Return name -> size, smallest and largest value of each part of an observation."""
    n, h, scout = world.num_modules, world.num_hinges, world.organism.scout
    angle, docks = world.servo_range, len(world.organism.hinges)
    return {
        "hinge_angle": (h, -_ANGLE_MARGIN * angle, _ANGLE_MARGIN * angle),
        "hinge_rate": (h, -_LARGEST_RATE, _LARGEST_RATE),
        "pitch": (n, -pi / 2, pi / 2),
        "roll": (n, -pi, pi),
        "acceleration": (6 * n, -scout.acceleration_range, scout.acceleration_range),
        "ir": (2 * len(world.organism.free_sides), 0.0, scout.ir_range),
        "contact": (n, 0.0, scout.contact_range),
        "previous_action": (num_actions, -1.0, 1.0),
        "hinge_target": (h, -angle, angle),
        "dock_force": (3 * docks, -_FORCE_MARGIN * scout.dock_force, _FORCE_MARGIN * scout.dock_force),
        "odometry": (1, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
        "track_odometry": (1, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
        "laser": (scout.laser_beams, 0.0, scout.laser_range),
        "goal": (2, -_LARGEST_DISTANCE, _LARGEST_DISTANCE),
        "goal_direction": (2, np.array([-pi, 0.0]), np.array([pi, _LARGEST_DISTANCE])),
    }


class Observer:
    """Reads observations of N simulations, on the host in place, on a device as a function."""

    def __init__(self, world: World, num: int, num_actions: int) -> None:
        bounds = _find_bounds(world, num_actions)
        self.sensors = [each for each in world.config.sensors if not isinstance(each, str)]  # of a user's own
        bounds |= {each.name: (each.size, np.array(each.low), np.array(each.high)) for each in self.sensors}
        parts = {name: bounds[name] for name in world.config.sensor_names}
        deviations = world.config.sensor_noise or SensorNoise()
        self.structure: dict[str, slice] = {}  # name -> slice of the observation
        self.size = 0
        for name, (size, _, _) in parts.items():
            self.structure[name] = slice(self.size, self.size + size)
            self.size += size
        self.low = np.concatenate([np.full(size, low) for size, low, _ in parts.values()])
        self.high = np.concatenate([np.full(size, high) for size, _, high in parts.values()])
        self.noise = world.config.noise * np.concatenate(
            [np.full(size, getattr(deviations, name, 0.0)) for name, (size, _, _) in parts.items()]
        )
        self._sources = self._list_sources(world)
        # What is no reading of the physics, name -> `[N, size]`; the caller keeps it up to date.
        self.own = {name: np.zeros((num, size)) for name, (size, _, _) in parts.items()}
        self._rays = [self.structure[name] for name in ("ir", "laser") if name in parts]
        self._raw_low, self._raw_high = (np.tile(bound, (num, 1)) for bound in (self.low, self.high))
        pitch = self.structure.get("pitch", slice(0, 0))
        self._raw_low[:, pitch], self._raw_high[:, pitch] = -1.0, 1.0  # its sine
        self._is_live = all(isinstance(ids, slice) for _, ids in self._sources)
        self._physics: Physics | None = None

    def _list_sources(self, world: World) -> list[tuple[str, slice | np.ndarray]]:
        """Return (source, ids) for each part of the observation, neighbors among MuJoCo's sensors as one."""
        ids = {"hinge_angle": world.hinge_qpos, "hinge_rate": world.hinge_dof}
        sources: list[tuple[str, slice | np.ndarray]] = []
        start = 0
        for name, part in self.structure.items():
            if name not in MEASURED:
                sources.append((name, make_slice(ids[name]) if name in ids else slice(0)))
                continue
            first, start = start, start + part.stop - part.start
            if sources and sources[-1][0] == "measured":
                first = sources.pop()[1].start  # pyright: ignore[reportAttributeAccessIssue]
            sources.append(("measured", slice(first, start)))
        return sources

    def list_parts(self, physics: Any, own: Mapping[str, Any]) -> list[Any]:
        """Return what an observation is joined from, as views of the physics where its ids follow each other."""
        parts = []
        for name, ids in self._sources:
            if name == "measured":
                parts.append(physics.sensordata[:, ids])
            elif name == "hinge_angle":
                parts.append(physics.qpos[:, ids])
            elif name == "hinge_rate":
                parts.append(physics.qvel[:, ids])
            else:
                parts.append(physics.rotation[:, :, 6] if name == "pitch" else own[name])
        return parts

    def limit(self, raw: Float[Any, "N size"], xp: Any) -> Float[Any, "N size"]:
        """Return observations within their bounds, of arrays of a device; see `read`."""
        is_ray, is_pitch = np.zeros((2, self.size), dtype=bool)
        for part in self._rays:
            is_ray[part] = True
        is_pitch[self.structure.get("pitch", slice(0, 0))] = True
        raw = xp.where(xp.isnan(raw), 0.0, raw)
        raw = xp.where(is_ray & (raw < 0.0), _LARGEST_DISTANCE, raw)
        low, high = self._raw_low[0].astype(np.float32), self._raw_high[0].astype(np.float32)
        raw = xp.clip(raw, low, high)
        return xp.where(is_pitch, xp.arcsin(xp.clip(raw, -1.0, 1.0)), raw)

    def read(self, physics: Physics) -> Float[np.ndarray, "N size"]:
        """Return noiseless observations, within their bounds; not a number becomes 0.

        A ray that hits nothing reads -1, and in an observation as far as it reaches.
        """
        if physics is not self._physics or not self._is_live:
            self._bind(physics)
        raw, flat = self._raw, self._flat
        for up, roll in self._rolls:
            np.arctan2(*up, roll)
        np.concatenate(self._parts, -1, raw)
        if isnan(flat.dot(flat)):
            np.copyto(raw, 0.0, where=np.isnan(raw))
        for ranges in self._ranges:
            np.copyto(ranges, _LARGEST_DISTANCE, where=ranges < 0.0)
        np.maximum(raw, self._low, out=raw)
        np.minimum(raw, self._high, out=raw)
        for pitch in self._pitches:
            np.arcsin(pitch, pitch)
        return self._rows.copy()

    def _bind(self, physics: Physics) -> None:
        """Look up what parts are read from and written to, as views that stay while the physics goes on.

        One simulation is read along one axis, which is faster than two.
        """
        rows = 0 if len(physics.qpos) == 1 else slice(None)
        self._physics = physics
        self._low, self._high = self._raw_low[rows], self._raw_high[rows]
        self._raw = np.empty_like(self._low)
        self._flat, self._rows = self._raw.reshape(-1), self._raw.reshape(self._raw_low.shape)
        self._parts = [part[rows] for part in self.list_parts(physics, self.own)]
        up = physics.rotation[rows, :, 7], physics.rotation[rows, :, 8]
        self._rolls = [(up, self.own["roll"][rows])] if "roll" in self.structure else []
        self._ranges = [self._raw[..., part] for part in self._rays]
        self._pitches = [self._raw[..., part] for name, part in self.structure.items() if name == "pitch"]

    def add_noise(
        self, observation: Float[np.ndarray, " size"], rng: np.random.Generator
    ) -> Float[np.ndarray, " size"]:
        """Return one observation with sensor noise, within its bounds."""
        noisy = observation + self.noise * rng.standard_normal(self.size)
        return np.clip(noisy, self.low, self.high)


class DeadReckoning:
    """How N bodies move the poses that they believe to have, and the direction of the goal from there.

    A body knows the way on its map from a nominal start; by how much it was put down differently, it does not know.
    From then on it adds up what its tracks were told to run, as level as each module's accelerometer says: of all
    rigid motions in the plane, the one from which the tracks' contacts slip least (least squares). For one module this
    halves the rate of turn without slip. Slip beyond that, falls and pushes are not noticed: the error grows.

    References:
        Mandow, Martínez, Morales, Blanco, García-Cerezo and González (2007), Experimental kinematics for wheeled skid-
        steer mobile robots, IROS: speeds of the body as a constant linear function of those of the tracks.
    """

    def __init__(self, world: World) -> None:
        route, organism, goal = world.map_route, world.organism, world.task.goal
        self._ahead, self._left, self._turn = find_motion(organism)
        poses = organism.compute_poses()
        # How far ahead and to the left of the middle of the straight body its head is [m].
        self._middle = (
            -float(np.mean([pose.x for pose in poses])),
            -float(np.mean([pose.y for pose in poses])),
        )
        self.start = np.array([*route.place(route.start), route.heading])  # on the map [m, rad]
        if isinstance(goal, ReachPlaces):
            self._legs = goal.list_legs(route, organism.scout.size[0])
            self._legs[:, 4] *= np.where(route.is_place, _NEARER, 1.0)
        else:
            self._legs = np.array([[*route.place(min(route.finish, route.start + _FAR)), 0.0, 0.0, 0.0]])
        self._legs[-1, 4] = -1.0  # the last place is never passed

    def move(
        self, pose: Float[Any, "N 3"], rotation: Float[Any, "N n 9"], way: Float[Any, "N tracks"], xp: Any
    ) -> Float[Any, "N 3"]:
        """Return the believed poses after the tracks were told to run a way [m]."""
        level = xp.sqrt(xp.maximum(1.0 - rotation[:, :, 6] ** 2, _LEAST_LEVEL**2))
        run = way.repeat(len(self._ahead) // way.shape[1], axis=1)
        leveled = run * level.repeat(2, axis=1)
        ahead, left = add_up(leveled * self._ahead), add_up(leveled * self._left)
        turn = add_up(run * self._turn) * rotation[:, 0, 8] / level[:, 0] ** 2
        heading = pose[:, 2] + 0.5 * turn
        c, s = xp.cos(heading), xp.sin(heading)
        return pose + xp.stack([c * ahead - s * left, s * ahead + c * left, turn], axis=1)

    def pass_places(
        self, pose: Float[Any, "N 3"], headed: Int[Any, " N"], xp: Any
    ) -> tuple[Int[Any, " N"], Float[Any, "N 2"]]:
        """Return the number of the place that each body heads for, and its bearing [rad] and distance [m]."""
        legs = xp.asarray(self._legs)
        c, s = xp.cos(pose[:, 2]), xp.sin(pose[:, 2])
        ahead, left = self._middle
        middle = pose[:, :2] - xp.stack([c * ahead - s * left, s * ahead + c * left], axis=1)
        headed = headed + find_passing(legs[headed], middle, xp)
        x, y = (legs[headed, :2] - pose[:, :2]).T
        direction = xp.stack([xp.arctan2(c * y - s * x, c * x + s * y), xp.hypot(x, y)], axis=1)
        return headed, direction


def measure_way(
    rotation: Float[Any, "N n 9"], speed: Float[Any, " N"], dt: float, xp: Any
) -> Float[Any, " N"]:
    """Return how far the head drives in a tick: what its tracks run, as steep as its pitch [m]."""
    return dt * speed * xp.sqrt(xp.maximum(1.0 - rotation[:, 0, 6] ** 2, 0.0))


def find_goal(state: Any) -> Float[Any, "N 2"]:
    """Return the place to head for, ahead of the head and to its left [m]; zeros where a task has none."""
    xp, target, head = state.xp, state.target, state.position[:, 0, :2]
    x, y = (xp.where(xp.isfinite(target), target, head) - head).T
    c, s = state.rotation[:, 0, 0], state.rotation[:, 0, 3]
    length = xp.maximum(xp.hypot(c, s), 1e-9)
    return xp.stack([(x * c + y * s) / length, (y * c - x * s) / length], axis=1)


def find_motion(
    organism: Organism,
) -> tuple[Float[np.ndarray, " T"], Float[np.ndarray, " T"], Float[np.ndarray, " T"]]:
    """Return what each track of a straight body adds to the motion of its head: ahead, left, and turn [rad/m].

    Tracks are those of module after module, the left before the right. Each touches level ground with its two ends.
    """
    lowest = find_road_wheels(organism.scout)
    bottom = min(z for _, _, z in lowest)
    x = np.array([place[0] for place in lowest if place[2] == bottom])
    y = max(place[1] for place in lowest)
    ends = np.array([(end, side) for side in (y, -y) for end in (x.min(), x.max())])
    places, looks = [], []
    for pose in organism.compute_poses():
        c, s = np.cos(pose.heading), np.sin(pose.heading)
        places.append(np.array([pose.x, pose.y]) + ends @ np.array([[c, s], [-s, c]]))
        looks.append(np.tile([c, s], (len(ends), 1)))
    place, look = np.concatenate(places), np.concatenate(looks)
    center = place.mean(axis=0)
    x, y = (place - center).T
    turn = (x * look[:, 1] - y * look[:, 0]) / (x**2 + y**2).sum()
    ahead = look[:, 0] / len(place) + turn * center[1]
    left = look[:, 1] / len(place) - turn * center[0]
    sums = [each.reshape(-1, 2).sum(axis=1) for each in (ahead, left, turn)]
    return sums[0], sums[1], sums[2]
