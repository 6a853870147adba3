"""Where a body believes it is, and the goal from there: dead reckoning from what its tracks were told and its tilt.

Functions of arrays take `xp`, NumPy on the host and `jax.numpy` on a device.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.robot.tracks import find_driven_wheels
from symbrion_gym._src.tasks.reach import ReachPlaces
from symbrion_gym._src.tasks.state import add_up

if TYPE_CHECKING:
    from symbrion_gym._src.environment.world import World
    from symbrion_gym._src.robot.organism import Organism

_LEAST_LEVEL = 0.2
"""Cosine of the pitch that is assumed of steeper modules: near the vertical a heading would turn at any rate."""
_FAR = 100.0  # Goals that are at no place lie straight ahead, this far away [m]


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
            self._places, self._radii = goal.list_places(route, organism.scout.size[0])
        else:
            self._places = np.array([route.place(min(route.finish, route.start + _FAR))])
            self._radii = np.zeros(1)
        self._radii[-1] = -1.0  # the last place is never passed

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
        places, radii = xp.asarray(self._places), xp.asarray(self._radii)
        c, s = xp.cos(pose[:, 2]), xp.sin(pose[:, 2])
        ahead, left = self._middle
        x, y = (places[headed] - pose[:, :2]).T
        away = xp.hypot(x + c * ahead - s * left, y + s * ahead + c * left)
        headed = headed + (away <= radii[headed])
        x, y = (places[headed] - pose[:, :2]).T
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
