"""Straight ways on a map of ground, for bodies that do not steer."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.routes import Place, read_place

_NUM_DIRECTIONS = 36
"""Ways through a place are tried in as many directions, 5 degrees apart."""


def find_nearest_level(
    ground: TraversabilityMap, places: Float[np.ndarray, "N 2"], heights: Float[np.ndarray, " N"]
) -> Int[np.ndarray, " N"]:
    """Return the place at each (x, y) whose ground is nearest in height; -1 where there is no ground."""
    return ground.sorted_heights.find_nearest(ground.grid.find_cells(places), heights)


def find_standing_place(ground: TraversabilityMap, what: str, place: Place, name: str, storey: float) -> int:
    """Return the number of the place on the ground at (x, y) or (x, y, z), drivable or not.

    Without z, of several storeys it is that in the largest region, else the highest.
    """
    point = read_place(what, place)
    if not len(ground.cell):
        raise ArenaError(f"arena {name!r} has no ground to stand on; give a {what} in another arena")
    offset = ground.positions[:, : len(point)] - point
    is_near = np.abs(offset[:, :2]).max(axis=1) <= ground.grid.cell
    if len(point) == 3:
        is_near &= np.abs(offset[:, 2]) <= storey
    near = np.flatnonzero(is_near)
    if not len(near):
        possible = np.flatnonzero(ground.is_drivable | ~ground.is_drivable.any())
        nearest = ground.positions[possible[np.argmin(np.linalg.norm(offset[possible], axis=1))]]
        raise ArenaError(
            f"the {what} {tuple(point.tolist())} lies off the ground of arena {name!r}; the nearest possible place is "
            f"{tuple(np.round(nearest, 2).tolist())}"
        )
    flat = np.linalg.norm(offset[near, :2], axis=1)
    if len(point) == 3:
        return int(near[np.lexsort((flat, np.abs(offset[near, 2]) // ground.grid.cell))[0]])
    region = np.where(ground.region[near] < 0, ground.num_regions, ground.region[near])
    storeys = np.where(ground.region[near] < 0, -ground.height[near], 0.0)
    return int(near[np.lexsort((flat, storeys, region))[0]])


def find_straight_way(
    ground: TraversabilityMap, is_usable: Bool[np.ndarray, " P"], num_anchors: int = 32
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]] | None:
    """Return both ends of about the longest straight way over usable places, to larger x; None where there is none."""
    usable = np.flatnonzero(is_usable)
    if not len(usable):
        return None
    anchors = usable[_spread(ground.positions[usable, :2], num_anchors)]
    angles = (np.arange(_NUM_DIRECTIONS) - _NUM_DIRECTIONS // 2 + 1) * np.pi / _NUM_DIRECTIONS
    anchor, angle = np.repeat(anchors, len(angles)), np.tile(angles, len(anchors))
    forth = _march(ground, is_usable, anchor, angle)
    back = _march(ground, is_usable, anchor, angle + np.pi)
    best = int(np.argmax(np.round(np.linalg.norm((forth - back)[:, :2], axis=1), 6)))
    return back[best], forth[best]


def find_straight_way_from(
    ground: TraversabilityMap, is_usable: Bool[np.ndarray, " P"], start: int
) -> Float[np.ndarray, " 3"]:
    """Return the end of the longest straight way over usable places from a place; the place itself for none."""
    angles = np.arange(2 * _NUM_DIRECTIONS) * np.pi / _NUM_DIRECTIONS
    ends = _march(ground, is_usable, np.full(len(angles), start), angles)
    reached = np.linalg.norm((ends - ground.positions[start])[:, :2], axis=1)
    return ends[int(np.argmax(np.round(reached, 6)))]


def _spread(places: Float[np.ndarray, "N 2"], count: int) -> Int[np.ndarray, " A"]:
    """Return numbers of places that are far from each other, beginning with the one nearest to the mean."""
    chosen = [int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    gap = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < min(count, len(places)):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.array(chosen)


def _march(
    ground: TraversabilityMap,
    is_usable: Bool[np.ndarray, " P"],
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
