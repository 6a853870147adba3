"""Routes on a map of drivable ground: start, goal and the path between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import compute_hold

Point = Float[np.ndarray, " 3"]  # [m]
Numbers = Int[np.ndarray, " N"]  # Of places of a map; -1 for none
Usable = Bool[np.ndarray, " P"]  # Of each place of a map, whether it may be used
Place = Sequence[float] | np.ndarray  # (x, y), or (x, y, z) where there are several storeys [m]
FindSeen = Callable[[Float[np.ndarray, "N 3"]], Bool[np.ndarray, " N"]]  # Whether the scanner saw places [m]

_SLIPPERY = 0.9  # Ground with less than this share of the largest friction is slippery
_AMPLE_ROOM = 2.0
"""Ends are chosen so many times the body's reach from walls, or in the half with the most room."""
_ROOM = 0.1  # Straight ways keep off walls and rims by so much more than the body needs, where they can [m]
_LEVEL = 0.5  # ... and where slopes are this share of the largest side slope, or in the half with the least.
_WALL_COST = 3.0  # Ground at the reach from walls costs this many times more per length than with ample room
_NUM_ENDS = 4000  # Places of which start and goal are chosen at most, evenly spread
STOREY = 0.25  # A given z is that of ground no farther above or below than this [m]; half a storey is more
_LOOK_AHEAD = 0.3  # The start heads for the path this far ahead [m]
_MAX_LENGTH = 10.0  # A route whose start and goal are chosen is no longer [m]: a module drives 10 m in 100 s
_SLOPE_COST = 3.0
"""Ground as steep as the body climbs costs this many times more per length than level ground; less slope costs less, by
its square. Slippery ground that is steeper than tracks hold on it costs still more."""
_SLIP_COST = 6.0
"""Likewise ground without friction, against the least slippery; what is between, in proportion."""
_NUM_DIRECTIONS = 36  # Ways through a place are tried in as many directions, 5 degrees apart
_NUM_ANCHORS = 32  # Places through which straight ways are tried


@dataclass(frozen=True, eq=False)
class DrivingRoute:
    """A way over drivable ground, for the middle of a body."""

    start: tuple[float, float, float]  # (x, y, z) on the ground [m]
    goal: tuple[float, float, float]  # (x, y, z) on the ground [m]
    heading: float  # direction in which the path begins [rad]
    path: Float[np.ndarray, "W 3"]  # points on the ground from start to goal, about a cell apart [m]
    length: float  # length of the path [m]
    clearance: float  # smallest distance of the path from walls, rims and ground that is too steep [m]
    region: int  # number of the region on the map


def find_driving_route(
    ground: TraversabilityMap,
    start: Place | None = None,
    goal: Place | None = None,
    name: str = "arena",
    max_length: float | None = None,
    find_seen: FindSeen | None = None,
    friction: Float[np.ndarray, " P"] | None = None,
) -> DrivingRoute:
    """Find a route over drivable ground; what is not given is chosen.

    Without start and goal, they are two places of the largest region that are far apart, with room around them.
    """
    if not ground.num_regions:
        raise ArenaError(
            f"arena {name!r} has no drivable ground for a body of {ground.footprint.length:.2f} x "
            f"{ground.footprint.width:.2f} m; give a smaller body or one that climbs more, or, if the scan has another "
            "axis up than z, say so where it is read (--up y, up='y')"
        )
    if max_length is not None and not max_length > 0.0:
        raise ArenaError(f"max_length must be above 0, got {max_length!r}")
    if start is not None and goal is not None and np.array_equal(start, goal):
        raise ArenaError(f"start and goal are the same place {goal!r}; move one of them")
    first = None if start is None else _find_drivable(ground, "start", start, name, None)
    region = None if first is None else int(ground.region[first])
    last = None if goal is None else _find_drivable(ground, "goal", goal, name, region)
    region = int(ground.region[last]) if last is not None else region or 0
    friction = np.ones(len(ground.cell)) if friction is None else friction
    graph = _make_cost_graph(ground, friction)
    first, last = _choose_ends(ground, region, first, last, max_length or _MAX_LENGTH, find_seen, friction)
    before = dijkstra(graph, indices=first, return_predecessors=True)[1]
    path = [last]
    while path[-1] != first:
        path.append(int(before[path[-1]]))
    path = np.array(path[::-1])
    points = ground.positions[path]
    for index, given in ((0, start), (-1, goal)):
        if given is not None:
            points[index, :2] = np.asarray(given, dtype=np.float64)[:2]
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    ahead = points[min(np.searchsorted(travelled, _LOOK_AHEAD), len(points) - 1)] - points[0]
    (start_x, start_y, start_z), (goal_x, goal_y, goal_z) = points[[0, -1]].tolist()
    return DrivingRoute(
        start=(start_x, start_y, start_z),
        goal=(goal_x, goal_y, goal_z),
        heading=float(np.arctan2(ahead[1], ahead[0])),
        path=points,
        length=float(travelled[-1]),
        clearance=float(ground.wall_distance[path].min()),
        region=region,
    )


def _find_drivable(ground: TraversabilityMap, what: str, place: Place, name: str, region: int | None) -> int:
    """Return the number of the drivable place at (x, y) or (x, y, z)."""
    point = read_place(what, place)
    usable = np.flatnonzero(ground.is_drivable if region is None else ground.region == region)
    offset = ground.positions[usable] - np.append(point, 0.0)[:3]
    flat = np.abs(offset[:, :2]).max(axis=1)
    is_near = flat <= ground.grid.cell / 2 * (1 + 1e-9)
    if len(point) == 3:
        is_near &= np.abs(offset[:, 2]) <= STOREY
    near = usable[is_near]
    keys = (np.linalg.norm(offset, axis=1),) if len(point) == 3 else (flat, ground.region[usable])
    if len(near):
        return int(near[np.lexsort([key[is_near] for key in keys])[0]])
    distance = np.linalg.norm(offset[:, : len(point)], axis=1)
    nearest = _show(ground.positions[usable[np.argmin(distance)]], 2)
    why = "has no drivable ground" if region is None else "is not connected to the start"
    raise ArenaError(
        f"the {what} {_show(point)} {why} in arena {name!r}; the nearest possible place is {nearest}"
    )


def read_place(what: str, place: Place) -> Float[np.ndarray, " d"]:
    """Return (x, y) or (x, y, z) [m] as an array."""
    try:
        point = np.asarray(place, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        point = np.zeros(0)
    if len(point) not in (2, 3) or not np.isfinite(point).all():
        raise ArenaError(f"{what} must be a place (x, y) or (x, y, z) in meters, got {place!r}")
    return point


def _show(point: Float[np.ndarray, " d"], digits: int = 3) -> str:
    return str(tuple(np.round(point, digits).tolist()))


def _make_cost_graph(ground: TraversabilityMap, friction: Float[np.ndarray, " P"]) -> csr_matrix:
    """Return the graph of drivable places; its lengths are longer near walls, on slopes and on slippery ground."""
    graph = ground.graph.tocoo()
    ample = _AMPLE_ROOM * max(ground.footprint.reach, ground.grid.cell)
    nearness = np.clip(1.0 - (ground.wall_distance - ground.footprint.reach) / ample, 0.0, 1.0)
    slope, is_slippery = np.nan_to_num(ground.slope), _select_slippery(friction)
    steepness = np.clip(slope / ground.footprint.max_slope, 0.0, 1.0) ** 2
    steepness = np.where(is_slippery, np.maximum(steepness, (slope / compute_hold(friction)) ** 2), steepness)
    slip = 1.0 - friction / friction.max(initial=0.0)
    cost = _WALL_COST * nearness + _SLOPE_COST * steepness + _SLIP_COST * slip
    factor = 1.0 + (cost[graph.row] + cost[graph.col]) / 2
    return csr_matrix((graph.data * factor, (graph.row, graph.col)), graph.shape)


def _select_slippery(friction: Float[np.ndarray, " P"]) -> Usable:
    """Return which places have clearly less friction than the least slippery one."""
    return friction < _SLIPPERY * friction.max(initial=0.0)


def _choose_ends(
    ground: TraversabilityMap,
    region: int,
    first: int | None,
    last: int | None,
    max_length: float,
    find_seen: FindSeen | None,
    friction: Float[np.ndarray, " P"],
) -> tuple[int, int]:
    """Return start and goal; what is missing is chosen far from the other, with room on level ground around it."""
    if first is not None and last is not None:
        return first, last
    is_firm = (ground.region == region) & ~_select_slippery(friction)
    roomy = _select_good_ends(ground, is_firm if is_firm.any() else ground.region == region, find_seen)
    if first is None and last is None:
        middle = roomy[np.argmax(ground.wall_distance[roomy])]
        first = _find_far(ground.graph, int(middle), roomy, np.inf)
    known = first if first is not None else last
    assert known is not None
    other = _find_far(ground.graph, known, roomy, max_length)
    if other == known:
        raise ArenaError(
            f"the drivable region at {_show(ground.positions[known])} has only {ground.region_areas[region]:.2f} m², "
            "too little for a route; give a smaller body or one that climbs more"
        )
    return (known, other) if first is not None else (other, known)


def _select_good_ends(ground: TraversabilityMap, inside: Usable, find_seen: FindSeen | None) -> Numbers:
    """Return places with room around them, on level ground, that the scanner saw, as far as there are such."""
    reach, most = ground.footprint.reach, np.median(ground.wall_distance[inside])
    is_good = inside & (ground.wall_distance >= min(_AMPLE_ROOM * reach, most))
    slope = np.nan_to_num(ground.slope)
    for _ in range(int(np.ceil(reach / ground.grid.cell))):  # the steepest under a body that turns here
        near = np.where(ground.links >= 0, slope[ground.links], 0.0)
        slope = np.maximum(slope, near.max(axis=1, initial=0.0))
    is_good &= slope <= max(_LEVEL * ground.footprint.max_roll, np.median(slope[is_good]))
    good = np.flatnonzero(is_good)
    good = good[np.unique(np.linspace(0, len(good) - 1, min(len(good), _NUM_ENDS)).astype(np.int64))]
    is_seen = find_seen(ground.positions[good]) if find_seen is not None else np.zeros(len(good), dtype=bool)
    return good[is_seen] if is_seen.any() else good


def _find_far(graph: csr_matrix, start: int, candidates: Numbers, most: float) -> int:
    """Return the candidate that is farthest from the start by length of the way, up to a length; else the nearest."""
    distance = dijkstra(graph, indices=start)[candidates]
    return int(candidates[np.argmax(np.where(distance <= most, distance, -distance))])


def find_nearest_level(
    ground: TraversabilityMap, places: Float[np.ndarray, "N 2"], heights: Float[np.ndarray, " N"]
) -> Numbers:
    """Return the place at each (x, y) whose ground is nearest in height; -1 where there is no ground."""
    return ground.sorted_heights.find_nearest(ground.grid.compute_cells(places), heights)


def find_standing_place(ground: TraversabilityMap, what: str, place: Place, name: str) -> int:
    """Return the number of the place on the ground at (x, y) or (x, y, z), drivable or not.

    Without z, of several storeys it is that in the largest region, else the highest.
    """
    point = read_place(what, place)
    if not len(ground.cell):
        raise ArenaError(f"arena {name!r} has no ground to stand on; give a {what} in another arena")
    offset = ground.positions[:, : len(point)] - point
    is_near = np.abs(offset[:, :2]).max(axis=1) <= ground.grid.cell
    if len(point) == 3:
        is_near &= np.abs(offset[:, 2]) <= STOREY
    near = np.flatnonzero(is_near)
    if not len(near):
        possible = np.flatnonzero(ground.is_drivable | ~ground.is_drivable.any())
        nearest = ground.positions[possible[np.argmin(np.linalg.norm(offset[possible], axis=1))]]
        raise ArenaError(
            f"the {what} {_show(point)} lies off the ground of arena {name!r}; the nearest possible place is "
            f"{_show(nearest, 2)}"
        )
    flat = np.linalg.norm(offset[near, :2], axis=1)
    if len(point) == 3:
        return int(near[np.lexsort((flat, np.abs(offset[near, 2]) // ground.grid.cell))[0]])
    region = np.where(ground.region[near] < 0, ground.num_regions, ground.region[near])
    storeys = np.where(ground.region[near] < 0, -ground.height[near], 0.0)
    return int(near[np.lexsort((flat, storeys, region))[0]])


def find_straight_way(ground: TraversabilityMap, least: float = 0.0) -> tuple[Point, Point] | None:
    """Return both ends of about the longest straight way in the largest region, to larger x; None where there is none.

    It keeps off walls and rims by 10 cm more than the body needs where that leaves half of the length, and `least` [m].
    """
    inside = ground.region == 0
    room = ground.footprint.reach + _ROOM
    longest, roomy = (_find_longest(ground, inside & (ground.wall_distance >= each)) for each in (0.0, room))
    if longest is None or roomy is None:
        return longest
    short, long = (float(np.linalg.norm((end - begin)[:2])) for begin, end in (roomy, longest))
    return roomy if short >= max(least, long / 2) else longest


def _find_longest(ground: TraversabilityMap, is_usable: Usable) -> tuple[Point, Point] | None:
    """Return both ends of about the longest straight way over usable places, to larger x; None where there is none."""
    usable = np.flatnonzero(is_usable)
    if not len(usable):
        return None
    anchors = usable[_spread(ground.positions[usable, :2])]
    angles = (np.arange(_NUM_DIRECTIONS) - _NUM_DIRECTIONS // 2 + 1) * np.pi / _NUM_DIRECTIONS
    anchor, angle = np.repeat(anchors, len(angles)), np.tile(angles, len(anchors))
    forth = _march(ground, is_usable, anchor, angle)
    back = _march(ground, is_usable, anchor, angle + np.pi)
    best = int(np.argmax(np.round(np.linalg.norm((forth - back)[:, :2], axis=1), 6)))
    return back[best], forth[best]


def find_straight_way_from(ground: TraversabilityMap, is_usable: Usable, start: int) -> Point:
    """Return the end of the longest straight way over usable places from a place; the place itself for none."""
    angles = np.arange(2 * _NUM_DIRECTIONS) * np.pi / _NUM_DIRECTIONS
    ends = _march(ground, is_usable, np.full(len(angles), start), angles)
    reached = np.linalg.norm((ends - ground.positions[start])[:, :2], axis=1)
    return ends[int(np.argmax(np.round(reached, 6)))]


def _spread(places: Float[np.ndarray, "N 2"]) -> Int[np.ndarray, " A"]:
    """Return numbers of places that are far from each other, beginning with the one nearest to the mean."""
    chosen = [int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    gap = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < min(_NUM_ANCHORS, len(places)):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.array(chosen)


def _march(
    ground: TraversabilityMap,
    is_usable: Usable,
    anchors: Int[np.ndarray, " R"],
    angles: Float[np.ndarray, " R"],
) -> Float[np.ndarray, "R 3"]:
    """Return the last places on straight lines from anchors while all places on the way are linked and usable."""
    step = ground.grid.cell / 2 * np.column_stack([np.cos(angles), np.sin(angles)])
    end, here = ground.positions[anchors], anchors.copy()
    active = np.arange(len(anchors))
    while len(active):
        place = end[active, :2] + step[active]
        number = find_nearest_level(ground, place, end[active, 2])
        is_linked = (number == here[active]) | (ground.links[here[active]] == number[:, None]).any(axis=1)
        goes_on = (number >= 0) & is_linked & is_usable[number]
        active, place, number = active[goes_on], place[goes_on], number[goes_on]
        end[active] = np.column_stack([place, ground.height[number]])
        here[active] = number
    return end
