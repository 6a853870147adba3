"""Start and goal on the ground of an arena without a course: under ceilings, on the storey that is meant."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.quantities import format_extents
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import Place
from symbrion_gym._src.traversability.straight import (
    find_standing_place,
    find_straight_way,
    find_straight_way_from,
)

_STOREY = 0.25
"""A given z is that of ground no farther above or below than this [m]."""
_LIES_UNDER = 0.10
"""Ground this far below the highest surface lies under something [m]: contact and surface differ by less."""
_WALL = 0.30
"""What rises by more than this within `_SAMPLES` is a wall [m]: higher than steps and plateaus that snakes climb."""
_SAMPLES = 0.05
"""Spacing of heights along a way [m]."""
_LEAST_WAY = 0.3
"""A chosen way has at least this length beside that of the organism [m]."""
_BEYOND = 0.5
"""An organism is laid down on the ground up to this far beyond its ends [m]."""
_END_ROOM = 0.10
"""Room for the nose and the tail at the ends of a chosen way [m]: a module reaches 0.07 ahead of its center."""


class Ends(NamedTuple):
    """Start and goal of a straight way.

    Attributes:
        start: (x, y) of the head at the start [m].
        goal: (x, y) of the head at the goal [m].
        start_height: z of the ground at the start where something lies above it [m]; None where it is the highest.
    """

    start: Float[np.ndarray, " 2"]
    goal: Float[np.ndarray, " 2"]
    start_height: float | None = None


def find_ends(
    arena: Arena, organism: Organism, middle_way: Ends, start: Place | None, goal: Place | None
) -> Ends:
    """Return start and goal on the ground; what is not given is chosen.

    The way through the middle is kept where it is open to the sky and no wall stands on it; elsewhere, as in a room,
    about the longest straight way over walkable ground is chosen.
    """
    for name, place in (("start", start), ("goal", goal)):
        if place is not None:
            _check_inside(arena, name, place)
    footprint = Footprint.of(organism, arena.friction)
    ground = arena.traversability(replace(footprint, radius=footprint.width / 2))
    first = None if start is None else find_standing_place(ground, "start", start, arena.name, _STOREY)
    last = None if goal is None else find_standing_place(ground, "goal", goal, arena.name, _STOREY)
    is_open = _is_open(arena, ground, middle_way) if first is None or last is None else False
    length = (organism.num_modules - 1) * organism.scout.pitch
    if first is None and last is None:
        return middle_way if is_open else _choose_both(arena, ground, length)
    if goal is None and first is not None:
        goal = middle_way.goal if is_open else _find_far(ground, first, 0.0)
    elif start is None and last is not None:
        start = middle_way.start if is_open else _find_far(ground, last, length)
    return _make_ends(arena, ground, start, goal, length)


def _check_inside(arena: Arena, name: str, place: Place) -> None:
    """Refuse a place outside of the surface as seen from above, before the ground is mapped, which takes long."""
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)[:, :2]
    point = np.asarray(place, dtype=np.float64).ravel()[:2]
    if (point < low).any() or (point > high).any():
        raise ArenaError(
            f"the {name} {tuple(point.tolist())} lies outside of arena {arena.name!r}, which extends over "
            f"{format_extents(low.tolist(), high.tolist())}"
        )


def _is_open(arena: Arena, ground: TraversabilityMap, way: Ends) -> bool:
    """Return whether both ends lie on ground under the open sky and no wall stands between them."""
    count = int(np.ceil(np.linalg.norm(way.goal - way.start) / _SAMPLES)) + 1
    line = np.linspace(way.start, way.goal, count)
    heights = arena.height(line[:, 0], line[:, 1])
    if not np.isfinite(heights[[0, -1]]).all():
        return False
    for end in (0, -1):
        cell = ground.grid.find_cells(line[[end]])
        near = ground.sorted_heights.find_nearest(cell, heights[[end]])[0]
        if near < 0 or abs(ground.height[near] - heights[end]) > _LIES_UNDER:
            return False
    return not (np.diff(heights[np.isfinite(heights)]) > _WALL).any()


def _choose_both(arena: Arena, ground: TraversabilityMap, length: float) -> Ends:
    way = find_straight_way(ground, ground.region == 0)
    reach = 0.0 if way is None else float(np.linalg.norm((way[1] - way[0])[:2])) - 2 * _END_ROOM
    if way is None or reach < length + _LEAST_WAY:
        raise ArenaError(
            f"arena {arena.name!r} has no straight way of {length + _LEAST_WAY:.2f} m for this organism (the longest "
            f"has {max(reach, 0.0):.2f} m); give fewer modules, or start and goal"
        )
    back, end = way[0][:2], way[1][:2]
    along = (end - back) / (reach + 2 * _END_ROOM)
    first = _find_nearest(ground, back + along * (length + _END_ROOM))
    return _make_ends(arena, ground, first, end - along * _END_ROOM, length)


def _find_nearest(ground: TraversabilityMap, point: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 3"]:
    """Return the place of the largest region that is nearest to a point in plan [m]."""
    places = ground.positions[ground.region == 0]
    return places[int(np.argmin(np.linalg.norm(places[:, :2] - point, axis=1)))]


def _find_far(ground: TraversabilityMap, known: int, length: float) -> Float[np.ndarray, " 2"]:
    """Return a place as far as possible on a straight way from a known one, but for room for a length at its end."""
    is_usable = ground.is_drivable.copy()
    is_usable[known] = True
    far = find_straight_way_from(ground, is_usable, known)[:2]
    way = ground.positions[known, :2] - far
    reach = float(np.linalg.norm(way))
    return far + way * min((length + _END_ROOM) / max(reach, _SAMPLES), 0.5)


def _make_ends(
    arena: Arena, ground: TraversabilityMap, start: Place | None, goal: Place | None, length: float
) -> Ends:
    assert start is not None
    first = find_standing_place(ground, "start", start, arena.name, _STOREY)
    begin, end = (np.asarray(place, dtype=np.float64).ravel()[:2] for place in (start, goal))
    height = float(ground.height[first])
    return Ends(begin, end, height if _lies_under(arena, begin, end, height, length) else None)


def _lies_under(
    arena: Arena, begin: Float[np.ndarray, " 2"], end: Float[np.ndarray, " 2"], height: float, length: float
) -> bool:
    """Return whether something hangs above a straight organism that stands with its head at the start."""
    way = end - begin
    ahead = way / max(float(np.linalg.norm(way)), _SAMPLES)
    line = begin + np.arange(-length - _BEYOND, _BEYOND, _SAMPLES)[:, None] * ahead
    highest = arena.height(line[:, 0], line[:, 1])
    below = arena.elevation.height_below(line[:, 0], line[:, 1], height + _STOREY)
    hangs = (highest > height + _STOREY) & ~(highest - below <= _LIES_UNDER)
    is_below = abs(float(arena.height(begin[0], begin[1])) - height) > _LIES_UNDER
    return is_below or bool(hangs.any())
