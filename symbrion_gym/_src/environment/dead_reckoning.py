"""Where a body believes it is, and the goal from there: dead reckoning from what its tracks were told and its tilt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.robot.tracks import find_driven_wheels
from symbrion_gym._src.tasks.reach import ReachPlaces
from symbrion_gym._src.tasks.state import add_up

if TYPE_CHECKING:
    from symbrion_gym._src.environment.commands import Commands
    from symbrion_gym._src.environment.world import Physics, World
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.tasks.state import Scene

LEAST_LEVEL = 0.2
"""Cosine of the pitch that is assumed of steeper modules: near the vertical a heading would turn at any rate."""
FAR = 100.0  # Goals that are at no place lie straight ahead, this far away [m]


class DeadReckoning:
    """The poses that N bodies believe to have, from the start on their map, and the direction of the goal from there.

    A body knows the way on its map from a nominal start; by how much it was put down differently, it does not know.
    From then on it adds up what its tracks were told to run, as level as each module's accelerometer says: of all
    rigid motions in the plane, the one from which the tracks' contacts slip least (least squares). For one module this
    halves the rate of turn without slip. Slip beyond that, falls and pushes are not noticed: the error grows.

    Args:
        world: world of the simulations.
        commands: what was commanded last.
        direction: `[N, 2]` written by `observe`: bearing of the goal, positive to the left of the head [rad], and its
            distance [m].

    References:
        Mandow, Martínez, Morales, Blanco, García-Cerezo and González (2007), Experimental kinematics for wheeled skid-
        steer mobile robots, IROS: speeds of the body as a constant linear function of those of the tracks.
    """

    def __init__(self, world: World, commands: Commands, direction: Float[np.ndarray, "N 2"]) -> None:
        num = len(direction)
        self._commands, self._direction, self._dt = commands, direction, world.config.dt
        self._goal = world.task.goal
        self._ahead, self._left, self._turn = find_motion(world.organism)
        self._middle = find_middle(world.organism)
        self._pose = np.zeros((num, 3))
        self._places: list[Float[np.ndarray, "C 2"]] = [np.zeros((1, 2))] * num
        self._radii: list[Float[np.ndarray, " C"]] = [np.zeros(1)] * num
        self._number = np.zeros(num, dtype=np.int64)
        self._target, self._radius = (
            np.zeros((num, 2)),
            np.full(num, -1.0),
        )  # nothing is passed before the start
        self._has_driven = np.zeros(num, dtype=bool)

    @property
    def pose(self) -> Float[np.ndarray, "N 3"]:
        """Estimated x, y [m] and heading [rad] of each head."""
        return self._pose

    @property
    def number(self) -> Int[np.ndarray, " N"]:
        """Number of the place that each body believes to head for."""
        return self._number

    def begin(self, rows: Sequence[int], scenes: Sequence[Scene]) -> None:
        """Start episodes in some simulations, at the start on the map."""
        for row, scene in zip(rows, scenes, strict=True):
            route = scene.map_route
            self._pose[row] = *route.place(route.start), route.heading
            self._places[row], self._radii[row] = list_places(self._goal, scene)
            self._number[row] = 0
            self._has_driven[row] = False
            self._head_for(row, 0)

    def _head_for(self, row: int, number: int) -> None:
        self._number[row] = number
        self._target[row], self._radius[row] = self._places[row][number], self._radii[row][number]

    def take(self, active: Bool[np.ndarray, " N"] | None) -> None:
        """Note that the tracks of some simulations ran for a tick; None for all."""
        self._has_driven[:] = True if active is None else active

    def observe(self, physics: Physics) -> None:
        """Add the way of the last tick, once, and write where the goal is."""
        rows = np.flatnonzero(self._has_driven)
        if len(rows):
            self._integrate(physics, rows)
            self._has_driven[:] = False
        heading = self._pose[:, 2]
        c, s = np.cos(heading), np.sin(heading)
        ahead, left = self._middle
        to_x, to_y = (self._target - self._pose[:, :2]).T
        off_x, off_y = to_x + c * ahead - s * left, to_y + s * ahead + c * left
        for row in np.flatnonzero(np.hypot(off_x, off_y) <= self._radius):
            self._head_for(int(row), int(self._number[row]) + 1)
        to_x, to_y = (self._target - self._pose[:, :2]).T
        self._direction[:, 0] = np.arctan2(c * to_y - s * to_x, c * to_x + s * to_y)
        self._direction[:, 1] = np.hypot(to_x, to_y)

    def _integrate(self, physics: Physics, rows: Int[np.ndarray, " R"]) -> None:
        """Move the estimated poses by the way of a tick."""
        rotation = physics.rotation[rows]
        level = np.sqrt(np.maximum(1.0 - rotation[:, :, 6] ** 2, LEAST_LEVEL**2))
        speed = self._commands.compute_track_speed()[rows]
        run = np.repeat(speed * self._dt, len(self._ahead) // speed.shape[1], axis=1)
        way = run * np.repeat(level, 2, axis=1)
        ahead, left, turn = add_up(way * self._ahead), add_up(way * self._left), add_up(run * self._turn)
        turn = turn * rotation[:, 0, 8] / level[:, 0] ** 2
        heading = self._pose[rows, 2] + 0.5 * turn
        c, s = np.cos(heading), np.sin(heading)
        self._pose[rows, 0] += c * ahead - s * left
        self._pose[rows, 1] += s * ahead + c * left
        self._pose[rows, 2] += turn


def list_places(goal: Any, scene: Scene) -> tuple[Float[np.ndarray, "C 2"], Float[np.ndarray, " C"]]:
    """Return the places to head for in turn on the map, and how near each is passed [m]; the last one never is."""
    route = scene.map_route
    if not isinstance(goal, ReachPlaces):
        return np.array([route.place(min(route.finish, route.start + FAR))]), np.full(1, -1.0)
    places, radii = goal.list_places(route, scene.organism.scout.size[0])
    radii[-1] = -1.0
    return places, radii


def find_middle(organism: Organism) -> tuple[float, float]:
    """Return how far ahead and to the left of its middle the head of a straight body is [m]."""
    poses = organism.compute_poses()
    return -float(np.mean([pose.x for pose in poses])), -float(np.mean([pose.y for pose in poses]))


def find_motion(
    organism: Organism,
) -> tuple[Float[np.ndarray, " T"], Float[np.ndarray, " T"], Float[np.ndarray, " T"]]:
    """Return what each track of a straight body adds to the motion of its head: ahead, left, and turn [rad/m].

    Tracks are those of module after module, the left before the right. Each touches level ground with its two ends.
    """
    lowest = find_driven_wheels(organism.scout)
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
