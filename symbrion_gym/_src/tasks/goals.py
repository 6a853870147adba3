"""Goals along a straight way: to get all modules past its finish."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.gap import GapSearch
from symbrion_gym._src.tasks.route import Point, Route, RouteMargins, find_route, refuse_start_beyond_gap
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.state import TaskState


def find_standing(state: TaskState, rows: Int[Any, " M"]) -> Bool[Any, " M"]:
    """Return in which of some simulations every module is upright and at ground height.

    The ground is looked for only where all the rest is fulfilled.
    """
    low, high = state.criteria.ground_band

    def is_on_ground(some: Int[Any, " K"]) -> Bool[Any, " K"]:
        height = state.compute_height(rows[some])
        return ((height > low) & (height < high)).all(axis=1)

    stands: Any = (state.up[rows] > state.criteria.upright).all(axis=1)
    stands = state.confirm(stands, lambda some: state.find_low(rows[some], high))
    return state.confirm(stands, is_on_ground)


def find_honest(state: TaskState) -> Bool[Any, " N"]:
    """Return whether each body is no farther from where it started than its tracks can have taken it, and never was.

    What counts is the way of the middle of its modules, in plan. On the way, a fall excuses a lead; see
    `TaskState.note_lead`.
    """
    way = state.xp.hypot(*(state.middle - state.start_position.mean(axis=1))[:, :2].T)
    return (way <= state.track_speed * state.time + state.criteria.speed_slack) & ~state.was_ahead


def find_honest_along(state: TaskState) -> Bool[Any, " N"]:
    """Return whether each body is no farther along the way than its tracks can have taken it, and never was."""
    farthest = state.start_mean + state.track_speed * state.time + state.criteria.speed_slack
    return (state.compute_mean_along() <= farthest) & ~state.was_ahead


def compute_size(state: TaskState) -> float:
    """Return the distance of the farthest module from the middle of the body when it lies straight [m]."""
    places = np.array([(pose.x, pose.y) for pose in state.organism.compute_poses()])
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())


@dataclass(frozen=True)
class PassFinish:
    """Get every module past the finish of a straight way: beyond the pit, or at a place."""

    is_straight: ClassVar[bool] = True  # Progress is the way that the tracks account for
    # (x, y) or (x, y, z) that the head has to reach [m]; None for the far side of the course or the pit
    place: Point | None = None
    margins: RouteMargins | None = None  # distances of the way from ramp, pit and rim; None for the defaults
    pit_search: GapSearch | None = None  # what counts as a pit; None for the defaults

    def __post_init__(self) -> None:
        if self.place is not None and np.ndim(self.place) == 1:
            object.__setattr__(self, "place", tuple(float(each) for each in self.place))

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the way; see `symbrion_gym._src.tasks.route.find_route`."""
        route = find_route(arena, organism, start.place, self.place, self.margins, self.pit_search)
        if self.place is not None:
            _refuse_near_goal(route, organism, self.place)
        elif not isinstance(start.place, str) and route.pit is None:
            refuse_start_beyond_gap(arena, organism, start.place, self.pit_search)
        return route

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the mean position of the modules along the way, each counted up to the finish [m]."""
        return state.mean_to_finish

    def limits(self, state: TaskState) -> dict[str, np.ndarray]:
        """Return the limits within which no body has arrived."""
        return {"rear": state.finish}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether every module is wholly beyond the finish, upright and on the ground."""
        return pass_strictly(state)


def _refuse_near_goal(route: Route, organism: Organism, place: Point) -> None:
    """Refuse a goal that the body has nearly passed where it starts."""
    least, length = organism.scout.size[0], (organism.num_modules - 1) * organism.scout.pitch
    left = route.finish + length - route.start
    if left < least:
        raise TaskError(
            f"the goal {tuple(place)} is {max(left, 0.0):.2f} m ahead of the head at the start; give one at least "
            f"{least:.2f} m ahead, or a start farther back"
        )


def pass_strictly(state: TaskState) -> Bool[Any, " N"]:
    """Return whether every module is past the finish with every corner, upright, on the ground and no faster than its
    tracks."""
    has_arrived = (state.rear > state.finish) & find_honest_along(state)
    has_arrived = state.confirm(has_arrived, lambda rows: find_across(state)[rows])
    return state.confirm(has_arrived, lambda rows: find_standing(state, rows))


def find_across(state: TaskState) -> Bool[Any, " N"]:
    """Return whether the corners of all modules are beyond the edge, half a module before the finish."""
    c, s = np.array([scene.route.direction for scene in state.scenes]).T[:, :, None, None]
    rotation, criteria = state.rotation, state.criteria
    reach = criteria.corner * state.xp.abs(c * rotation[:, :, :3] + s * rotation[:, :, 3:6]).sum(axis=2)
    edge = state.finish - state.organism.scout.pitch / 2
    beyond = state.along - reach > edge[:, None]
    return beyond.all(axis=1)
