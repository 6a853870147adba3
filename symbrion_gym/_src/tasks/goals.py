"""Goals along a straight way: to get all modules past its finish, strictly."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import grey_closing

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.gap import find_gap, find_ramp
from symbrion_gym._src.tasks.features.stairs import find_stairs, find_step
from symbrion_gym._src.tasks.features.way import Way
from symbrion_gym._src.tasks.route import Point, Route, Start, find_route, find_tail, make_route
from symbrion_gym._src.tasks.state import TaskState

OBSTACLES = ("stairs", "step", "ramp")
_SAMPLES = 0.02  # Spacing of the heights along the way [m]
_BRIDGE = 0.6  # A body may bridge gaps of this share of the distance from its first module to its last
_CLIMB = 1.2  # A body rears up or lowers itself over walls of this share of a module's height at most


def find_standing(state: TaskState, rows: Int[Any, " M"]) -> Bool[Any, " M"]:
    """Return in which of some simulations every module is upright and at ground height.

    The ground is looked for only where all the rest is fulfilled.
    """
    low, high = state.criteria.ground_band

    def is_on_ground(some: Int[Any, " K"]) -> Bool[Any, " K"]:
        height = state.compute_height(rows[some])
        return ((height > low) & (height < high)).all(axis=1)

    is_upright: Any = (state.up[rows] > state.criteria.upright).all(axis=1)
    return state.confirm(is_upright, is_on_ground)


def find_honest(state: TaskState) -> Bool[Any, " N"]:
    """Return whether each body is no farther from where it started than its tracks can have taken it, and never was.

    What counts is the way of the middle of its modules, in plan. On the way, a fall excuses a lead; see
    `TaskState.note_lead`.
    """
    return (state.way <= state.compute_pace()) & ~state.was_ahead


def find_honest_along(state: TaskState) -> Bool[Any, " N"]:
    """Return whether each body is no farther along the way than its tracks can have taken it, and never was."""
    farthest = state.start_mean + state.track_speed * state.time + state.criteria.speed_slack
    return (state.compute_mean_along() <= farthest) & ~state.was_ahead


def find_across(state: TaskState) -> Bool[Any, " N"]:
    """Return whether the corners of all modules are beyond the edge, half a module before the finish."""
    c, s = state.scene.route.direction
    rotation, criteria = state.rotation, state.criteria
    reach = criteria.corner * state.xp.abs(c * rotation[:, :, :3] + s * rotation[:, :, 3:6]).sum(axis=2)
    edge = state.finish - state.organism.scout.pitch / 2
    return (state.along - reach > edge[:, None]).all(axis=1)


@dataclass(frozen=True)
class PassFinish:
    """Get every module past the finish of a straight way: beyond the pit, or at a place."""

    is_straight: ClassVar[bool] = True  # Progress is the way that the tracks account for
    # (x, y) or (x, y, z) that the head has to reach [m]; None for the far side of the course or the pit
    place: Point | None = None

    def __post_init__(self) -> None:
        if self.place is not None and np.ndim(self.place) == 1:
            object.__setattr__(self, "place", tuple(float(each) for each in self.place))

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the way; see `symbrion_gym._src.tasks.route.find_route`."""
        route = find_route(arena, organism, start.place, self.place)
        if self.place is not None:
            _refuse_near_goal(route, organism, self.place)
        elif not isinstance(start.place, str) and route.pit is None:
            _refuse_start_beyond_gap(arena, organism, start.place)
        return route

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the mean position of the modules along the way, each counted up to the finish [m]."""
        return state.mean_to_finish

    def limits(self, state: TaskState) -> dict[str, np.ndarray]:
        return {"rear": state.finish}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether every module is past the finish with every corner, upright, on the ground and no faster than
        its tracks."""
        has_arrived = (state.rear > state.finish) & find_honest_along(state)
        has_arrived = state.confirm(has_arrived, lambda rows: find_across(state)[rows])
        return state.confirm(has_arrived, lambda rows: find_standing(state, rows))


def _refuse_near_goal(route: Route, organism: Organism, place: Point) -> None:
    """Refuse a goal that the body has nearly passed where it starts."""
    least, length = organism.scout.size[0], (organism.num_modules - 1) * organism.scout.pitch
    left = route.finish + length - route.start
    if left < least:
        raise TaskError(
            f"the goal {tuple(place)} is {max(left, 0.0):.2f} m ahead of the head at the start; give one at least "
            f"{least:.2f} m ahead, or a start farther back"
        )


def _refuse_start_beyond_gap(arena: Arena, organism: Organism, start: Point) -> None:
    """Refuse a given start beyond the pit of an arena, where crossing it is done already."""
    try:
        gap = find_gap(arena, organism)
    except TaskError:
        return
    x, y = start[:2]
    if x * np.cos(gap.way.heading) + y * np.sin(gap.way.heading) > gap.far:
        raise TaskError(
            f"the start ({x:g}, {y:g}) lies beyond the pit of arena {arena.name!r}, whose far edge is {gap.far:.2f} m "
            f"along the heading {np.degrees(gap.way.heading):.0f}°; start before its near edge, at {gap.near:.2f} m, "
            "or give a goal"
        )


@dataclass(frozen=True)
class BeyondGap(PassFinish):
    """Get every module across the first gap on the way."""

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the gap on the surface alone."""
        gap = find_gap(arena, organism)
        pit, finish = (gap.near, gap.far, gap.floor), gap.find_finish(organism)
        return make_route(arena, organism, gap.way, start, gap.start, finish, pit)


@dataclass(frozen=True)
class OnTop(PassFinish):
    """Get every module past the top of a step, of stairs or of a ramp.

    Raises:
        TaskError: there is no such kind.
    """

    obstacle: str = "any"  # "stairs", "step" or "ramp"; "any" for the first kind that is there, in this order

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("obstacle", self.obstacle, ("any", *OBSTACLES), TaskError)

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find what to climb on the surface alone."""
        kinds = OBSTACLES if self.obstacle == "any" else (self.obstacle,)
        for kind in kinds[:-1]:
            try:
                way, foot, top = _find_obstacle(kind, arena, organism)
                break
            except TaskError:
                continue
        else:
            way, foot, top = _find_obstacle(kinds[-1], arena, organism)
        return make_route(arena, organism, way, start, foot, top + organism.scout.pitch / 2)


def _find_obstacle(kind: str, arena: Arena, organism: Organism) -> tuple[Way, float, float]:
    """Return the way, the foot and the top of an obstacle [m]."""
    if kind == "stairs":
        stairs = find_stairs(arena, organism)
        return stairs.way, stairs.steps[0].edge, stairs.steps[-1].edge
    if kind == "step":
        step = find_step(arena, organism)
        return step.way, step.edge, step.edge
    ramp = find_ramp(arena)
    return ramp.way, ramp.foot, ramp.crest


@dataclass(frozen=True)
class FarEnd(PassFinish):
    """Get every module to the far end of the ground straight ahead: to its rim, or to a wall or drop on it.

    A gap narrower than 0.6 of the distance from the first module to the last is no end: the body may bridge it.

    Raises:
        TaskError: the share is not above 0 and up to 1.
    """

    share: float = 0.9  # share of the way to the far end that has to be traversed

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.share <= 1.0:
            raise TaskError(f"share must be above 0, up to 1, got {self.share!r}")

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find the straight way over the ground and where it ends."""
        route = find_route(replace(arena, course=None), organism, start.place, self.place)
        if self.place is not None:
            return replace(route, pit=None)
        reach = float(np.linalg.norm(np.ptp(np.asarray(arena.surface.bounds), axis=0)[:2]))
        s = np.arange(route.start, route.start + reach, _SAMPLES)
        wall, tail = _CLIMB * organism.scout.size[2], find_tail(organism)
        heights = np.nan_to_num(arena.height(*route.place(s)), nan=-np.inf)
        heights = grey_closing(heights, max(1, round(_BRIDGE * tail / _SAMPLES)))
        with np.errstate(invalid="ignore"):
            steps = np.abs(np.diff(heights))
        ends = np.flatnonzero(~(steps <= wall))
        end = s[ends[0]] if len(ends) else s[-1]
        room = end - organism.scout.arm_reach - tail - route.start
        return replace(route, finish=float(route.start - tail + self.share * max(room + tail, 0.0)), pit=None)
