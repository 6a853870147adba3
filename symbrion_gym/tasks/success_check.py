"""The strict test of success, and everything else that ends an episode.

Success means that EVERY module lies beyond the finish, at ground height and upright, for 0.3 s, that none
ever rolled over on the way, and that the body was not faster than its tracks. A test of the tail alone is
cheated at once by somersaults and by folding the body through itself.
"""

from __future__ import annotations

from functools import reduce
from operator import add, mul
from typing import NamedTuple

import numpy as np
import trimesh

from symbrion_gym.environment.world import Physics, World

HOLD_TIME = 0.3
"""How long the body must have arrived [s]."""
UPRIGHT = 0.5
"""Smallest z component of the up axis of an upright module."""
ROLLED_OVER = -0.3
"""Below this z component of its up axis a module has rolled over."""
GROUND_BAND = (0.02, 0.075)
"""Height of a module's centre above the ground that counts as standing on it [m]."""
SPEED_SLACK = 0.05
"""What a body may be ahead of its tracks' path, for falling forwards [m]."""
LARGEST_SPEED = 50.0
"""A coordinate faster than this [m/s or rad/s] means that the simulation has diverged."""
_CORNER = 0.05
"""Half the edge of what of a module must be beyond the far edge however it is turned [m]."""
_STRIP = 0.05
"""Width of the strips across x whose greatest heights are known [m]."""
_HAIR = 1e-6
"""Triangles reach this much farther than they are in finding what is above a place [m]."""
_TOUCH_BAND = 0.01
"""A module this close to the floor of the pit [m] touches it."""


class Body(NamedTuple):
    """Views of what is measured of one simulation.

    Attributes:
        rates: `[nv]` velocities of its coordinates.
        places: `[3, n]` x, y and z of the modules [m].
        up: `[n]` z components of their up axes.
        torque: `[h]` of the hinges [N m].
        hinge_rate: `[h]` [rad/s].
    """

    rates: np.ndarray
    places: np.ndarray
    up: np.ndarray
    torque: np.ndarray
    hinge_rate: np.ndarray


class Measures(NamedTuple):
    """What is measured of one simulation at a tick.

    Attributes:
        head: how far along the route the head is [m].
        mean: how far the modules are in the mean [m].
        is_across: whether all of them are beyond the finish.
        progress: how far they are in the mean, none counted farther than the finish [m].
        aside: largest distance of a module from the middle of the route [m].
        lowest: height of the lowest module [m].
        uprightness: smallest z component of the modules' up axes.
        power: sum over the hinges of the absolute power [W].
        is_sound: whether the numbers are still physics.
    """

    head: float
    mean: float
    is_across: bool
    progress: float
    aside: float
    lowest: float
    uprightness: float
    power: float
    is_sound: bool


_UNSOUND = Measures(0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0, 0.0, False)


class Judge:
    """Measures simulations and tells what ends an episode; it remembers nothing.

    Attributes:
        finish: how far along the route the goal is [m].
        start: where the robot takes itself to start, from the middle of the pit on its map, where there is one [m].
        is_plain: whether the route runs along x, in the middle.
        share: of one module in a mean.
        hold_ticks: for how many ticks the body must have arrived.
        is_abyss: whether the floor of the pit ends an episode.
        farthest_aside: from the middle of the route that is still in the arena [m].
        lowest: height that is [m].
    """

    def __init__(self, world: World) -> None:
        self._arena, self._route = world.arena, world.route
        self._direction = world.route.direction
        self._strips, self._ceiling = find_ceiling(world.arena.surface)
        self.finish = world.route.finish
        near, far, _ = world.map_route.pit or (0.0, 0.0, 0.0)
        self.start = world.map_route.start - (near + far) / 2
        self._edge = self.finish - world.organism.scout.pitch / 2
        self.is_plain = world.route.heading == 0.0 and world.route.lateral == 0.0
        self._half = world.organism.scout.size[2] / 2
        self.share = 1.0 / world.num_modules
        self.hold_ticks = max(1, int(np.ceil(HOLD_TIME / world.config.dt - 1e-9)))
        self.is_abyss = world.config.abyss and world.route.pit is not None
        self.farthest_aside, self.lowest = world.route.half_width, world.route.lowest

    def measure(self, body: Body) -> Measures:
        """Measure one simulation; plain numbers are faster than small arrays."""
        rates = body.rates
        if not rates.dot(rates) < LARGEST_SPEED and not (np.abs(rates) < LARGEST_SPEED).all():
            return _UNSOUND
        along, across, heights = body.places.tolist()
        if not self.is_plain:
            c, s = self._direction
            offset, places = self._route.lateral, list(zip(along, across, strict=True))
            along = [c * x + s * y for x, y in places]
            across = [c * y - s * x - offset for x, y in places]
        finish, share = self.finish, self.share
        mean = progress = reduce(add, along) * share
        is_across = False
        if not max(along) < finish:
            is_across = min(along) > finish
            progress = reduce(add, [s if s < finish else finish for s in along]) * share
        powers = map(abs, map(mul, body.torque.tolist(), body.hinge_rate.tolist()))
        return Measures(
            along[0],
            mean,
            is_across,
            progress,
            max(max(across), -min(across)),
            min(heights),
            min(body.up.tolist()),
            reduce(add, powers, 0.0),
            True,
        )

    def find_distance(self, position: np.ndarray) -> np.ndarray:
        """Return how far along the route each module is, `[N, n]` [m]."""
        if self.is_plain:
            return position[:, :, 0]
        c, s = self._direction
        return c * position[:, :, 0] + s * position[:, :, 1]

    def find_places(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far along the route and how far left of its middle places `[n, 3]` are, `[n]` each [m]."""
        (c, s), x, y = self._direction, position[:, 0], position[:, 1]
        return (x, y) if self.is_plain else (c * x + s * y, c * y - s * x - self._route.lateral)

    def find_limits(self) -> tuple[float, float]:
        """Return how far aside and how low a module can be while nothing has happened [m]."""
        lowest = self.lowest
        if self.is_abyss and self._route.pit is not None:
            lowest = max(lowest, self._route.pit[2] + _TOUCH_BAND + 1.5 * self._half)
        return self.farthest_aside, lowest

    def is_standing(self, physics: Physics, row: int) -> bool:
        """Return whether every module of one simulation is upright, at ground height and wholly across.

        A module that is too high above the highest ground anywhere in its strip needs no search for the ground.
        """
        position, rotation = physics.position[row], physics.rotation[row]
        c, s = self._direction
        reach = _CORNER * np.abs(c * rotation[:, :3] + s * rotation[:, 3:6]).sum(axis=1)
        is_across = self.find_distance(position[None])[0] - reach > self._edge
        if not (is_across & (rotation[:, 8] > UPRIGHT)).all():
            return False
        x, y, z = position.T
        ceiling = self._ceiling[np.searchsorted(self._strips, x)]
        if (z - ceiling >= GROUND_BAND[1]).any():
            return False
        above = z - self._arena.height(x, y)
        return bool(((above > GROUND_BAND[0]) & (above < GROUND_BAND[1])).all())

    def has_touched_pit(self, physics: Physics, row: int) -> bool:
        """Return whether a module of one simulation touches the floor of the pit."""
        near, far, floor = self._route.pit or (0.0, 0.0, 0.0)
        distance = self.find_distance(physics.position[row][None])[0]
        reach = self._half * np.abs(physics.rotation[row, :, 6:9:2]).sum(axis=1)
        is_down = physics.position[row, :, 2] - reach < floor + _TOUCH_BAND
        return bool((is_down & (distance > near) & (distance < far)).any())


def find_ceiling(surface: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """Return x where strips end, `[S]` [m], and the greatest height of the surface in each, `[S + 1]` [m]."""
    x, height = surface.triangles[:, :, 0], surface.triangles[:, :, 2].max(axis=1) + _HAIR
    ends = np.arange(x.min() - _STRIP, x.max() + _STRIP, _STRIP)
    first, last = np.searchsorted(ends, x.min(axis=1) - _HAIR), np.searchsorted(ends, x.max(axis=1) + _HAIR)
    ceiling = np.full(len(ends) + 1, -np.inf)
    for step in range((last - first).max() + 1):
        np.maximum.at(ceiling, np.minimum(first + step, last), height)
    return ends, ceiling
