"""The strict success check, and everything else that ends an episode.

Success means that EVERY module lies beyond the finish, at ground height and upright, for 0.3 s, that none
ever rolled over on the way, and that the organism was not faster than its tracks. A check of the tail alone is
exploited at once by somersaults and by folding the organism through itself.

Here is the check that the environment makes at each tick. A champion is judged by trials of it in the exact arena
(`evolution.judge`), and a success is audited by a second, independent check (`symbrion_gym.tasks.audit`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add, mul
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction.range_checks import check_not_negative, check_positive
from symbrion_gym.errors import OptionError

if TYPE_CHECKING:
    import trimesh

    from symbrion_gym.arenas.arena import Arena
    from symbrion_gym.robot.organism import Organism
    from symbrion_gym.tasks.route import Route

_STRIP = 0.05
"""Width of the strips across x whose greatest heights are known [m]; it changes the time alone."""
_TRIANGLE_MARGIN = 1e-6
"""Triangles reach this much farther than they are when the ground of a strip is sought [m]: rounding."""
_LARGEST_REACH = 1.5
"""A turned module reaches at most the root of 2 half edges below its center; with room to spare."""


@dataclass(frozen=True)
class SuccessCriteria:
    """Limits of a success, and of what ends an episode.

    Wider limits admit what a person would not call a crossing; `symbrion_gym.tasks.audit` finds such cases.

    Attributes:
        hold_time: time for which the organism must stay beyond the finish [s]: one that flies past or tips back does
            not count.
        upright: smallest z component of the up axis of an upright module: leaning by 60 degrees.
        rolled_over: below this z component of its up axis a module has rolled over; below 0, so that one on its
            side on the way may still right itself.
        ground_band: height of a module's center above the ground that counts as standing on it [m]: half a module's
            height is 0.0525, one stacked on another is above 0.1.
        speed_slack: distance that an organism may be ahead of the path of its tracks, for falling forwards [m].
        corner: half the edge of the cube in a module that must be beyond the far edge however it is turned [m].
        touch_band: a module this close to the floor of the pit touches it [m].
        max_rate: a coordinate faster than this [m/s or rad/s] means that the simulation has diverged; nothing
            in an arena is.

    Raises:
        OptionError: a number is out of range.
    """

    hold_time: float = 0.3
    upright: float = 0.5
    rolled_over: float = -0.3
    ground_band: tuple[float, float] = (0.02, 0.075)
    speed_slack: float = 0.05
    corner: float = 0.05
    touch_band: float = 0.01
    max_rate: float = 50.0

    def __post_init__(self) -> None:
        check_not_negative(self, ("hold_time", "speed_slack", "corner", "touch_band"), OptionError)
        check_positive(self, ("max_rate",), OptionError)
        for name in ("upright", "rolled_over"):
            if not -1.0 <= getattr(self, name) <= 1.0:
                raise OptionError(f"SuccessCriteria: {name} must lie in [-1, 1], got {getattr(self, name)!r}")
        low, high = self.ground_band
        if not low < high:
            raise OptionError(f"SuccessCriteria: ground_band must be (low, high), got {self.ground_band!r}")


class OrganismState(NamedTuple):
    """Views of what is measured of one simulation.

    Attributes:
        rates: velocities of its coordinates.
        positions: x, y and z of the modules [m].
        up: z components of their up axes.
        torque: torque of the hinges [N m].
        hinge_rate: [rad/s].
    """

    rates: Float[np.ndarray, " nv"]
    positions: Float[np.ndarray, "3 n"]
    up: Float[np.ndarray, " n"]
    torque: Float[np.ndarray, " h"]
    hinge_rate: Float[np.ndarray, " h"]


class Measures(NamedTuple):
    """What is measured of one simulation at a tick.

    Attributes:
        head: position of the head along the route [m].
        mean: mean position of the modules along the route [m].
        is_across: whether all of them are beyond the finish.
        progress: mean of these positions, each counted up to the finish [m].
        lateral: largest distance of a module from the middle of the route [m].
        lowest: height of the lowest module [m].
        uprightness: smallest z component of the modules' up axes.
        power: sum over the hinges of the absolute power [W].
        is_sound: whether the simulation is numerically stable.
    """

    head: float
    mean: float
    is_across: bool
    progress: float
    lateral: float
    lowest: float
    uprightness: float
    power: float
    is_sound: bool


_UNSOUND = Measures(0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0, 0.0, False)


class SuccessCheck:
    """Measures simulations and finds what ends an episode; it has no state.

    Attributes:
        criteria: limits of a success.
        finish: position of the finish along the route [m].
        start: start on the robot's map, from the middle of the pit, if there is one [m].
        is_along_x: whether the route runs along x, in the middle.
        share: weight of one module in a mean.
        hold_ticks: number of ticks (control steps) for which the organism must stay beyond the finish.
        is_bottomless: whether touching the floor of the pit ends an episode.
        max_lateral: largest distance from the middle of the route that is still in the arena [m].
        lowest: smallest height that is still in the arena [m].
    """

    def __init__(
        self,
        arena: Arena,
        organism: Organism,
        route: Route,
        map_route: Route,
        dt: float,
        bottomless: bool = False,
        criteria: SuccessCriteria | None = None,
    ) -> None:
        """Prepare the check of one arena and organism.

        Args:
            arena: arena of the simulations.
            organism: organism to check.
            route: way to the finish.
            map_route: the same way on the robot's map.
            dt: length of a control step (tick) [s].
            bottomless: whether touching the floor of the pit ends an episode.
            criteria: limits of a success; None for the defaults.
        """
        self.criteria = criteria or SuccessCriteria()
        self._arena, self._route = arena, route
        self._direction = route.direction
        self._max_rate = self.criteria.max_rate
        self._strips, self._ceiling = find_ceiling(arena.surface)
        self.finish = route.finish
        near, far, _ = map_route.pit or (0.0, 0.0, 0.0)
        self.start = map_route.start - (near + far) / 2
        self._edge = self.finish - organism.scout.pitch / 2
        self.is_along_x = route.heading == 0.0 and route.lateral == 0.0
        self._half = organism.scout.size[2] / 2
        self.share = 1.0 / organism.num_modules
        self.hold_ticks = max(1, int(np.ceil(self.criteria.hold_time / dt - 1e-9)))  # but for rounding
        self.is_bottomless = bottomless and route.pit is not None
        self.max_lateral, self.lowest = route.half_width, route.lowest

    def measure(self, state: OrganismState) -> Measures:
        """Measure one simulation; plain numbers are faster than small arrays."""
        rates, max_rate = state.rates, self._max_rate
        if not rates.dot(rates) < max_rate and not (np.abs(rates) < max_rate).all():
            return _UNSOUND
        along, across, heights = state.positions.tolist()
        if not self.is_along_x:
            c, s = self._direction
            offset, positions = self._route.lateral, list(zip(along, across, strict=True))
            along = [c * x + s * y for x, y in positions]
            across = [c * y - s * x - offset for x, y in positions]
        finish, share = self.finish, self.share
        mean = progress = reduce(add, along) * share
        is_across = False
        if not max(along) < finish:
            is_across = min(along) > finish
            progress = reduce(add, [s if s < finish else finish for s in along]) * share
        powers = map(abs, map(mul, state.torque.tolist(), state.hinge_rate.tolist()))
        return Measures(
            along[0],
            mean,
            is_across,
            progress,
            max(max(across), -min(across)),
            min(heights),
            min(state.up.tolist()),
            reduce(add, powers, 0.0),
            True,
        )

    def find_distance(self, position: Float[np.ndarray, "N n 3"]) -> Float[np.ndarray, "N n"]:
        """Return how far along the route each module is [m]."""
        if self.is_along_x:
            return position[:, :, 0]
        c, s = self._direction
        return c * position[:, :, 0] + s * position[:, :, 1]

    def find_coordinates(
        self, position: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return how far along the route and how far left of its middle positions are [m]."""
        (c, s), x, y = self._direction, position[:, 0], position[:, 1]
        return (x, y) if self.is_along_x else (c * x + s * y, c * y - s * x - self._route.lateral)

    def find_limits(self) -> tuple[float, float]:
        """Return how far to the side and how low a module can be while nothing has happened [m]."""
        lowest = self.lowest
        if self.is_bottomless and self._route.pit is not None:
            touched = self._route.pit[2] + self.criteria.touch_band
            lowest = max(lowest, touched + _LARGEST_REACH * self._half)
        return self.max_lateral, lowest

    def is_standing(self, position: Float[np.ndarray, "n 3"], rotation: Float[np.ndarray, "n 9"]) -> bool:
        """Return whether every module of one simulation is upright, at ground height and wholly across.

        A module that is too high above the highest ground anywhere in its strip needs no search for the ground.

        Args:
            position: centers of the modules [m].
            rotation: their rotation matrices, row by row.
        """
        criteria, (c, s) = self.criteria, self._direction
        reach = criteria.corner * np.abs(c * rotation[:, :3] + s * rotation[:, 3:6]).sum(axis=1)
        is_across = self.find_distance(position[None])[0] - reach > self._edge
        if not (is_across & (rotation[:, 8] > criteria.upright)).all():
            return False
        low, high = criteria.ground_band
        x, y, z = position.T
        ceiling = self._ceiling[np.searchsorted(self._strips, x)]
        if (z - ceiling >= high).any():
            return False
        above = z - self._find_ground(x, y, z)
        return bool(((above > low) & (above < high)).all())

    def _find_ground(
        self, x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"], z: Float[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Return the height of the ground: the surface, or below a ceiling its highest part beneath the modules."""
        if self._route.start_height is None:
            return self._arena.height(x, y)
        return self._arena.elevation.height_below(x, y, z)

    def has_touched_pit(self, position: Float[np.ndarray, "n 3"], rotation: Float[np.ndarray, "n 9"]) -> bool:
        """Return whether a module of one simulation touches the floor of the pit; arguments as `is_standing`."""
        near, far, floor = self._route.pit or (0.0, 0.0, 0.0)
        distance = self.find_distance(position[None])[0]
        reach = self._half * np.abs(rotation[:, 6:9:2]).sum(axis=1)
        is_down = position[:, 2] - reach < floor + self.criteria.touch_band
        return bool((is_down & (distance > near) & (distance < far)).any())


def find_ceiling(surface: trimesh.Trimesh) -> tuple[Float[np.ndarray, " S"], Float[np.ndarray, " S+1"]]:
    """Return x where strips end [m], and the greatest height of the surface in each strip [m]."""
    x, height = surface.triangles[:, :, 0], surface.triangles[:, :, 2].max(axis=1) + _TRIANGLE_MARGIN
    ends = np.arange(x.min() - _STRIP, x.max() + _STRIP, _STRIP)
    first = np.searchsorted(ends, x.min(axis=1) - _TRIANGLE_MARGIN)
    last = np.searchsorted(ends, x.max(axis=1) + _TRIANGLE_MARGIN)
    ceiling = np.full(len(ends) + 1, -np.inf)
    for step in range((last - first).max() + 1):
        np.maximum.at(ceiling, np.minimum(first + step, last), height)
    return ends, ceiling
