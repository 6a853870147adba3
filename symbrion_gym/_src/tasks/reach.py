"""Goals at places on drivable ground: to reach several in turn, and to stand before a known object."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.placed_objects import find_object
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import find_honest, find_standing
from symbrion_gym._src.tasks.paths import MAX_CORNERS, PathRoute, find_path
from symbrion_gym._src.tasks.route import Point, Route, Start
from symbrion_gym._src.tasks.state import TaskState

_ROOM = 0.5
"""At the start a body is farther from its goal than counts as there, by at least this share of a module's length."""
_TINY = 1e-12  # A leg of no length has no direction; its square [m²]
_PASSING = 0.5, 2.5
"""A corner of the path is passed by who is as near to the way from it to the next corner as there is room all along
that way, but at least and at most so many lengths of a module: from there nothing stands between body and corner."""


@dataclass(frozen=True)
class ReachPlaces:
    """Bring the middle of the body to places in turn, the last with every module about it.

    Raises:
        TaskError: a distance is not above 0.
    """

    places: tuple[Point, ...] = ()  # (x, y) or (x, y, z) of each [m]; none to choose one on the map
    # length of the path to a place that is chosen [m]; None for as far as possible
    distance: float | None = None
    # distance of the middle from a place that has been reached [m]; None for the length of a module
    tolerance: float | None = None

    def __post_init__(self) -> None:
        given = [name for name in ("distance", "tolerance") if getattr(self, name) is not None]
        check_positive(self, given, TaskError)
        object.__setattr__(self, "places", tuple(tuple(map(float, place)) for place in self.places))

    def find(self, arena: Arena, organism: Organism, start: Start) -> PathRoute:
        """Find the path on the map; see `symbrion_gym._src.tasks.paths.find_path`."""
        tolerance = self.find_tolerance(organism)
        least = tolerance + _ROOM * organism.scout.size[0]
        if self.distance is not None and self.distance < least:
            raise TaskError(
                f"the distance {self.distance:g} m is too short, as within {tolerance:.2f} m the place counts as "
                f"reached; give at least {least:.2f} m, or a smaller tolerance"
            )
        path = find_path(arena, organism, start, self.places, self.distance)
        middle = np.mean([(pose.x, pose.y) for pose in organism.compute_poses()], axis=0)
        begin = np.array(path.place(path.start + middle[0], middle[1]))
        places = np.array(path.corners)[list(path.is_place)]
        away = float(np.linalg.norm(places - begin, axis=1).max())
        if away < least:
            x, y = places[-1].tolist()
            raise TaskError(
                f"the goal ({x:.2f}, {y:.2f}) is {away:.2f} m from the middle of the body at the start, and counts as "
                f"reached within {tolerance:.2f} m; give one at least {least:.2f} m away, or a smaller tolerance"
            )
        return path

    def find_tolerance(self, organism: Organism) -> float:
        """Return how near a place is reached [m]."""
        return organism.scout.size[0] if self.tolerance is None else self.tolerance

    def list_legs(self, route: Route, length: float) -> Float[np.ndarray, "C 5"]:
        """Return the corners and places of a way in turn (x, y), the way from each that also passes it (0, 0 at a
        place), and how near it is passed [m], by a module's length."""
        assert isinstance(route, PathRoute)
        corners, is_place = np.array(route.corners), np.array(route.is_place)
        ways = np.append(np.diff(corners, axis=0), [[0.0, 0.0]], axis=0) * ~is_place[:, None]
        tolerance = length if self.tolerance is None else self.tolerance
        room = np.clip(route.room, *np.multiply(_PASSING, length))
        return np.column_stack([corners, ways, np.where(is_place, tolerance, room)])

    def _recall(self, state: TaskState) -> tuple[Any, Any, Any]:
        """Return legs `[N, C, 5]`, the way from each corner to the end `[N, C]` [m], and the number of the corner that
        each body heads for."""
        path = state.remember("reach_path", self._list_paths)
        return path[:, :, :5], path[:, :, 5], state.remember("reach_number", 0)

    def _list_paths(self, state: TaskState) -> Float[np.ndarray, "N C 6"]:
        """Return the path of each simulation, the last corner repeated to `MAX_CORNERS`."""
        legs = self.list_legs(state.scene.route, state.organism.scout.size[0])
        path = np.zeros((MAX_CORNERS, 6))
        path[:, :5] = legs[np.minimum(np.arange(MAX_CORNERS), len(legs) - 1)]
        lengths = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)
        path[:-1, 5] = np.cumsum(lengths[::-1])[::-1]
        return np.tile(path, (state.num, 1, 1))

    def find_target(self, state: TaskState) -> Float[Any, "N 2"]:
        """Return (x, y) of the corner or place that each body heads for [m]."""
        legs, _, number = self._recall(state)
        return legs[np.arange(state.num), number, :2]

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the way from the middle of each body along the path to its end, below 0 [m]; corners that were passed
        count."""
        legs, rest, number = self._recall(state)
        rows, middle = np.arange(state.num), state.middle[:, :2]
        passes = find_passing(legs[rows, number], middle, state.xp) & (rest[rows, number] > 0.0)
        if state.may_hold(passes):
            state.keep("reach_number", number + 1, passes)
            number = state.remember("reach_number", 0)
        return -(state.xp.hypot(*(legs[rows, number, :2] - middle).T) + rest[rows, number])

    def limits(self, state: TaskState) -> dict[str, float]:
        return {"progress": -self.find_tolerance(state.organism)}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether the middle is at the last place, every module about it, upright and on the ground."""
        legs, tolerance = self._recall(state)[0], self.find_tolerance(state.organism)

        def is_about(rows: Int[Any, " M"]) -> Bool[Any, " M"]:
            # How far the farthest module is from the middle when the body lies straight [m].
            modules = np.array([(pose.x, pose.y) for pose in state.organism.compute_poses()])
            size = float(np.linalg.norm(modules - modules.mean(axis=0), axis=1).max())
            offset = state.position[rows, :, :2] - legs[rows, -1, None, :2]
            away = state.xp.linalg.norm(offset, axis=2).max(axis=1)
            return (away <= tolerance + size) & find_standing(state, rows)

        has_arrived = (state.progress >= -tolerance) & find_honest(state)
        return state.confirm(has_arrived, is_about)


def find_passing(legs: Float[Any, "N 5"], middle: Float[Any, "N 2"], xp: Any) -> Bool[Any, " N"]:
    """Return which bodies are near enough to a leg of their way, as `ReachPlaces.list_legs` returns it."""
    offset, way = middle - legs[:, :2], legs[:, 2:4]
    share = (offset * way).sum(axis=1) / xp.maximum((way**2).sum(axis=1), _TINY)
    return xp.hypot(*(offset - xp.clip(share, 0.0, 1.0)[:, None] * way).T) <= legs[:, 4]


_STEP = 0.04  # Places before an object are tried this far apart [m]
_NEAREST = 0.03  # The first of them leaves this much room between object and front dock [m]


@dataclass(frozen=True, kw_only=True)
class ObjectRoute(PathRoute):
    """A path to the front of an object."""

    face: tuple[float, float]  # (x, y) of the middle of its front [m]


@dataclass(frozen=True)
class ReachObject(ReachPlaces):
    """Bring the body before an object, the head within a body length of its front and turned to it.

    Raises:
        TaskError: a number is not above 0, or there is no name.
    """

    site: str = ""  # name of the object's site, as `object_socket_0`, or of its kind where there is one of it
    # largest angle between the head and the direction of the object [rad]
    max_angle: float = float(np.deg2rad(45.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, ("max_angle",), TaskError)
        if not isinstance(self.site, str) or not self.site:
            raise TaskError(f"an object is named as object_socket_0, got {self.site!r}")

    def find(self, arena: Arena, organism: Organism, start: Start) -> ObjectRoute:
        """Find the path to the place nearest to the front of the object that can be driven to."""
        each = find_object(arena.objects, self.site)
        face = each.position[:2] + each.reach * each.front
        x = [pose.x for pose in organism.compute_poses()]
        ahead = organism.scout.arm_reach + x[0] - float(np.mean(x))  # of the front dock, from the middle [m]
        error: ArenaError | None = None
        for gap in np.arange(_NEAREST, compute_length(organism), _STEP):
            place = face + each.front * (ahead + gap)
            try:
                path = find_path(arena, organism, start, (*self.places, tuple(place.tolist())))
            except ArenaError as problem:
                error = error or problem
                continue
            return ObjectRoute(**vars(path), face=(float(face[0]), float(face[1])))
        raise ArenaError(f"no way to the front of {self.site!r}: {error}")

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether the body is at the place, the head near the object and turned to it."""
        fronts, xp = state.remember("object_front", _list_fronts), state.xp
        offset = fronts - state.position[:, 0, :2]
        away = xp.linalg.norm(offset, axis=1)
        ahead = state.rotation[:, 0, 0:4:3]
        along = (offset * ahead).sum(axis=1)
        size = xp.maximum(away * xp.linalg.norm(ahead, axis=1), 1e-9)
        faces = (along >= np.cos(self.max_angle) * size) & (away <= compute_length(state.organism))
        return super().has_arrived(state) & faces


def compute_length(organism: Organism) -> float:
    """Return the length of a straight body, from the tail to its front dock [m]."""
    x = [pose.x for pose in organism.compute_poses()]
    return float(max(x) - min(x)) + organism.scout.dock_reach + organism.scout.arm_reach


def _list_fronts(state: TaskState) -> Float[np.ndarray, "N 2"]:
    """Return the middle of the front of the object of each simulation [m]."""
    route: Any = state.scene.route
    return np.tile(route.face, (state.num, 1))
