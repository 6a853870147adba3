"""Goals at known objects of an arena: to stand before one and face it, and to dock at one."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.placed_objects import PlacedObject, find_object
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import compute_size, find_honest, find_standing
from symbrion_gym._src.tasks.paths import MAX_CORNERS, PathRoute, find_path
from symbrion_gym._src.tasks.reach import ReachPlaces
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.state import TaskState

_STEP = 0.04  # Places before an object are tried this far apart [m]
_NEAREST = 0.03  # The first of them leaves this much room between object and front dock [m]


@dataclass(frozen=True)
class ObjectRoute(PathRoute):
    """A path to the front of an object."""

    face: tuple[float, float] = (0.0, 0.0)  # (x, y) of the middle of its front [m]
    front: tuple[float, float] = (1.0, 0.0)  # (x, y) of the direction in which the front points, of length 1


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

    def find(self, arena: Arena, organism: Organism, start: Start) -> PathRoute:
        """Find the path to the nearest place before the object that can be driven to."""
        each = find_object(arena.objects, self.site)
        return _find_front_path(arena, organism, start, each, self.places, self.site)

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether the body is at the place, the head near the object and turned to it."""
        has_arrived = super().has_arrived(state)
        face, _ = _find_fronts(state)
        offset, xp = face - state.position[:, 0, :2], state.xp
        away = xp.linalg.norm(offset, axis=1)
        ahead = state.rotation[:, 0, 0:4:3]
        along = (offset * ahead).sum(axis=1)
        size = xp.maximum(away * xp.linalg.norm(ahead, axis=1), 1e-9)
        return (
            has_arrived & (along >= np.cos(self.max_angle) * size) & (away <= compute_length(state.organism))
        )


@dataclass(frozen=True)
class DockAtObject(ReachObject):
    """Bring the front dock of the head to the front of an object, aligned with it.

    The tolerance is that of the dock, ahead and to the side.

    Attributes:
        tolerance: distance of the dock from the middle of the front [m]; None for 3 cm.
        max_angle: largest angle between the head and the front of the object [rad].
    """

    max_angle: float = float(np.deg2rad(10.0))

    def find(self, arena: Arena, organism: Organism, start: Start) -> PathRoute:
        """Find the path to a place before the object, and from there straight on until the dock meets its front."""
        route = super().find(arena, organism, start)
        assert isinstance(route, ObjectRoute)
        last = np.array(route.face) + np.array(route.front) * (_compute_ahead(organism))
        given = {each.name: getattr(route, each.name) for each in fields(route)}
        if len(route.corners) >= MAX_CORNERS:
            raise ArenaError(f"the path to {self.site!r} has too many corners; give a start that is nearer")
        given["corners"] = (*route.corners, (float(last[0]), float(last[1])))
        given["is_place"] = (*route.is_place[:-1], False, True)
        return ObjectRoute(**given)

    def find_tolerance(self) -> float:
        """Return the tolerance of the dock [m]."""
        return 0.03 if self.tolerance is None else self.tolerance

    def limits(self, state: TaskState) -> dict[str, float]:
        """Return the limits within which no body has docked: its middle is within its size of the end of the path."""
        size = 2 * compute_size(state) + state.organism.scout.arm_reach
        return {"progress": -(self.find_tolerance() + size)}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether the dock is at the front, aligned, every module upright and on the ground."""
        face, front = _find_fronts(state)
        xp, ahead = state.xp, state.rotation[:, 0, 0:4:3]
        offset = state.position[:, 0, :2] + state.organism.scout.arm_reach * ahead - face
        gap = (offset * front).sum(axis=1)
        side = offset[:, 0] * front[:, 1] - offset[:, 1] * front[:, 0]
        facing = -(ahead * front).sum(axis=1) / xp.maximum(xp.linalg.norm(ahead, axis=1), 1e-9)
        near = xp.maximum(xp.abs(gap), xp.abs(side)) <= self.find_tolerance()
        has_arrived = near & (facing >= np.cos(self.max_angle)) & find_honest(state)
        return state.confirm(has_arrived, lambda rows: find_standing(state, rows))


def compute_length(organism: Organism) -> float:
    """Return the length of a straight body, from the tail to its front dock [m]."""
    x = [pose.x for pose in organism.compute_poses()]
    return float(max(x) - min(x)) + organism.scout.dock_reach + organism.scout.arm_reach


def _find_front_path(
    arena: Arena, organism: Organism, start: Start, each: PlacedObject, places: tuple, site: str
) -> ObjectRoute:
    """Return the path to the place nearest to the front of an object that can be driven to."""
    face = each.position[:2] + each.reach * each.front
    error: ArenaError | None = None
    for gap in np.arange(_NEAREST, compute_length(organism), _STEP):
        middle = face + each.front * (_compute_ahead(organism) + gap)
        try:
            path = find_path(arena, organism, start, (*places, tuple(middle.tolist())), None)
        except ArenaError as problem:
            error = error or problem
            continue
        given = {each.name: getattr(path, each.name) for each in fields(path)}
        return ObjectRoute(
            **given,
            face=(float(face[0]), float(face[1])),
            front=(float(each.front[0]), float(each.front[1])),
        )
    raise ArenaError(f"no way to the front of {site!r}: {error}")


def _compute_ahead(organism: Organism) -> float:
    """Return how far the front dock of a straight body is ahead of its middle [m]."""
    x = [pose.x for pose in organism.compute_poses()]
    return organism.scout.arm_reach + x[0] - float(np.mean(x))


def _find_fronts(state: TaskState) -> tuple[Float[Any, "N 2"], Float[Any, "N 2"]]:
    """Return the middle of the front [m] and its direction, of the object of each simulation."""
    face, front = state.remember("object_face", _list_faces), state.remember("object_front", _list_directions)
    return face, front


def _list_faces(state: TaskState) -> Float[np.ndarray, "N 2"]:
    return np.array([_read_route(scene.route).face for scene in state.scenes])


def _list_directions(state: TaskState) -> Float[np.ndarray, "N 2"]:
    return np.array([_read_route(scene.route).front for scene in state.scenes])


def _read_route(route: object) -> ObjectRoute:
    if not isinstance(route, ObjectRoute):
        raise TaskError("this goal needs a route to an object, as `ReachObject.find` makes it")
    return route
