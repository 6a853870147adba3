"""The goal of reaching a place, or several in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import compute_size, find_honest, find_standing
from symbrion_gym._src.tasks.paths import MAX_CORNERS, PathRoute, find_path
from symbrion_gym._src.tasks.route import Point, Route
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.state import TaskState

_ROOM = 0.5
"""At the start a body is farther from its goal than counts as there, by at least this share of a module's length."""
_PASSING = 2.5  # A corner of the path is passed within this many lengths of a module


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
        least = self._find_least(organism)
        if self.distance is not None and self.distance < least:
            raise TaskError(
                f"the distance {self.distance:g} m is too short, as within {self._measure_tolerance(organism):.2f} m "
                f"the place counts as reached; give at least {least:.2f} m, or a smaller tolerance"
            )
        path = find_path(arena, organism, start, self.places, self.distance)
        self._refuse_near_places(path, organism)
        return path

    def _measure_tolerance(self, organism: Organism) -> float:
        return organism.scout.size[0] if self.tolerance is None else self.tolerance

    def _find_least(self, organism: Organism) -> float:
        """Return how far from the middle of the body the goal has to be at the start [m]."""
        return self._measure_tolerance(organism) + _ROOM * organism.scout.size[0]

    def _refuse_near_places(self, path: PathRoute, organism: Organism) -> None:
        least, tolerance = self._find_least(organism), self._measure_tolerance(organism)
        middle = np.mean([(pose.x, pose.y) for pose in organism.compute_poses()], axis=0)
        start = np.array(path.place(path.start + middle[0], middle[1]))
        places = np.array(
            [corner for corner, exact in zip(path.corners, path.is_place, strict=True) if exact]
        )
        away = float(np.linalg.norm(places - start, axis=1).max())
        if away < least:
            x, y = places[-1].tolist()
            raise TaskError(
                f"the goal ({x:.2f}, {y:.2f}) is {away:.2f} m from the middle of the body at the start, and counts as "
                f"reached within {tolerance:.2f} m; give one at least {least:.2f} m away, or a smaller tolerance"
            )

    def list_places(
        self, route: Route, length: float
    ) -> tuple[Float[np.ndarray, "C 2"], Float[np.ndarray, " C"]]:
        """Return the corners and places of a way in turn, and how near each is passed [m]."""
        path, tolerance = _read_path(route), length if self.tolerance is None else self.tolerance
        loose = max(_PASSING * length, tolerance)
        return np.array(path.corners), np.array([tolerance if exact else loose for exact in path.is_place])

    def _find_tolerance(self, state: TaskState) -> float:
        return self._measure_tolerance(state.organism)

    def find_target(self, state: TaskState) -> Float[Any, "N 2"]:
        """Return (x, y) of the corner or place that each body heads for [m]."""
        corners, _, _ = self._recall(state)
        number = state.remember("reach_number", 0)
        return corners[np.arange(state.num), number]

    def distance_left(self, state: TaskState) -> Float[Any, " N"]:
        """Return the way from the middle of each body along the path to its end [m]; corners that were passed count."""
        corners, rest, radius = self._recall(state)
        number, rows = state.remember("reach_number", 0), np.arange(state.num)
        gap = state.xp.hypot(*(corners[rows, number] - state.middle[:, :2]).T)
        passes = (gap <= radius[rows, number]) & (rest[rows, number] > 0.0)
        if state.may_hold(passes):
            state.keep("reach_number", number + 1, passes)
            number = state.remember("reach_number", 0)
            gap = state.xp.hypot(*(corners[rows, number] - state.middle[:, :2]).T)
        return gap + rest[rows, number]

    def distance_to_goal(self, state: TaskState) -> Float[Any, " N"]:
        """Return the way that is left [m]."""
        return -state.progress

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the way that is left, below 0 [m]."""
        return -self.distance_left(state)

    def limits(self, state: TaskState) -> dict[str, float]:
        """Return the limits within which no body has arrived."""
        return {"progress": -self._find_tolerance(state)}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether the middle is at the last place, every module about it, upright and on the ground."""
        corners, _, _ = self._recall(state)
        tolerance = self._find_tolerance(state)

        def is_about(rows: Int[Any, " M"]) -> Bool[Any, " M"]:
            offset = state.position[rows, :, :2] - corners[rows, -1][:, None]
            away = state.xp.linalg.norm(offset, axis=2).max(axis=1)
            return (away <= tolerance + compute_size(state)) & find_standing(state, rows)

        has_arrived = (state.progress >= -tolerance) & find_honest(state)
        return state.confirm(has_arrived, is_about)

    def _list_radii(self, state: TaskState) -> Float[np.ndarray, "N C"]:
        length = state.organism.scout.size[0]
        return np.array(
            [_repeat_last(self.list_places(scene.route, length)[1].tolist()) for scene in state.scenes]
        )

    def _recall(self, state: TaskState) -> tuple[Any, Any, Any]:
        """Return corners `[N, C, 2]`, the way from each to the end [m] `[N, C]`, and how near they are passed [m]."""
        return (
            state.remember("reach_corners", _list_corners),
            state.remember("reach_rest", lambda state: _measure_rest(_list_corners(state))),
            state.remember("reach_radius", self._list_radii),
        )


def _list_corners(state: TaskState) -> Float[np.ndarray, "N C 2"]:
    """Return the corners of each path; the last is repeated to `MAX_CORNERS`."""
    return np.array([_repeat_last(_read_path(scene.route).corners) for scene in state.scenes])


def _read_path(route: Route) -> PathRoute:
    if not isinstance(route, PathRoute):
        raise TaskError(
            "this goal needs a route with corners, as `symbrion_gym._src.tasks.paths.find_path` makes it"
        )
    return route


def _repeat_last(values: Sequence[Any]) -> list[Any]:
    """Return as many values for every path, so that simulations with others fit into one array."""
    return [*values, *[values[-1]] * (MAX_CORNERS - len(values))]


def _measure_rest(corners: Float[np.ndarray, "N C 2"]) -> Float[np.ndarray, "N C"]:
    legs = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    rest = np.zeros(corners.shape[:2])
    rest[:, :-1] = np.cumsum(legs[:, ::-1], axis=1)[:, ::-1]
    return rest
