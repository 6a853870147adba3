"""Straight ways on a map of ground, for bodies that do not steer."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym.traversability.drivable import TraversabilityMap

_NUM_DIRECTIONS = 36
"""Ways through a place are tried in as many directions, 5 degrees apart."""


def find_nearest_level(
    ground: TraversabilityMap, places: Float[np.ndarray, "N 2"], heights: Float[np.ndarray, " N"]
) -> Int[np.ndarray, " N"]:
    """Return the place at each (x, y) whose ground is nearest in height; -1 where there is no ground."""
    return ground.sorted_heights.find_nearest(ground.grid.find_cells(places), heights)


def find_straight_way(
    ground: TraversabilityMap, room: float, is_usable: Bool[np.ndarray, " P"], num_anchors: int = 32
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]] | None:
    """Return the ends of about the longest straight way over usable places; None where there is none.

    Args:
        ground: the map.
        room: least length of the way [m].
        is_usable: places that the way may cross.
        num_anchors: number of places through which ways are tried, in 36 directions each.
    """
    usable = np.flatnonzero(is_usable)
    if not len(usable):
        return None
    anchors = usable[_spread(ground.positions[usable, :2], num_anchors)]
    angles = np.arange(_NUM_DIRECTIONS) * np.pi / _NUM_DIRECTIONS
    anchor, angle = np.repeat(anchors, len(angles)), np.tile(angles, len(anchors))
    forth = _march(ground, is_usable, anchor, angle)
    back = _march(ground, is_usable, anchor, angle + np.pi)
    length = np.linalg.norm(forth - back, axis=1)
    best = int(np.argmax(np.round(length, 9)))
    return (back[best], forth[best]) if length[best] >= room else None


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
