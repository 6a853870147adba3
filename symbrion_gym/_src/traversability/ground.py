"""The shape of the ground at places: slope, roughness and steps, and where walls stand on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.traversability.columns import SortedHeights, Spans
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.grid import Grid
from symbrion_gym._src.traversability.places import DIRECTIONS, Places

_LEAST_PLACES = 4
"""A plane is fitted through at least as many places."""
_FLATTEST = 1e-6
"""Places on a line have a smaller determinant of their spread, in cells to the power of 4."""


class Ground(NamedTuple):
    """The shape of the ground at places.

    Attributes:
        gradient: rise of the plane through a place and its neighbors along x and y; nan with fewer than 3 neighbors.
        slope: angle of that plane [rad]; nan likewise.
        roughness: standard deviation of the ground from that plane [m].
        rises: height of the ground at each neighbor above that at the place [m]; nan without a neighbor.
        steps: step on the way to each neighbor [m]: what of the rise is not explained by the slopes before and after.
    """

    gradient: Float[np.ndarray, "P 2"]
    slope: Float[np.ndarray, " P"]
    roughness: Float[np.ndarray, " P"]
    rises: Float[np.ndarray, "P 8"]
    steps: Float[np.ndarray, "P 8"]


def find_ground(grid: Grid, places: Places) -> Ground:
    """Return gradient, slope, roughness and steps at places."""
    rises = np.where(places.links >= 0, places.height[places.links] - places.height[:, None], np.nan)
    gradient, roughness = _fit_planes(rises, grid.cell)
    slope = np.arctan(np.hypot(*gradient.T))
    return Ground(gradient, slope, roughness, rises, _find_steps(places.links, rises))


def keep_upright(
    links: Int[np.ndarray, "P 8"], gradient: Float[np.ndarray, "P 2"], body: Footprint
) -> Int[np.ndarray, "P 8"]:
    """Return the links on which a body leans to its side by no more than it may, at either end; else -1."""
    ways = np.array(DIRECTIONS) / np.hypot(*np.transpose(DIRECTIONS))[:, None]
    aside = np.abs(np.nan_to_num(gradient) @ np.stack([-ways[:, 1], ways[:, 0]]))
    leans = np.maximum(aside, aside[links, np.arange(len(DIRECTIONS))]) > np.tan(body.max_roll)
    return np.where(leans, -1, links)


def find_walkable(
    grid: Grid, places: Places, ground: Ground, walls: SortedHeights, body: Footprint
) -> Int[np.ndarray, "P 8"]:
    """Return the links of places along which a body can drive as far as slope, step and walls let it; else -1."""
    is_walkable = ~(ground.slope > body.max_slope) & ~_is_in_wall(grid, places, ground, walls, body)
    lengths = grid.cell * np.hypot(*np.transpose(DIRECTIONS))
    is_open = is_walkable[:, None] & is_walkable[places.links] & (places.links >= 0)
    is_open &= ground.steps <= body.max_step
    is_open &= np.abs(ground.rises) <= lengths * np.tan(body.max_slope) + body.max_step
    return np.where(is_open, places.links, -1)


def _fit_planes(
    rises: Float[np.ndarray, "P 8"], cell: float
) -> tuple[Float[np.ndarray, "P 2"], Float[np.ndarray, " P"]]:
    """Return gradient and standard deviation of least-squares planes through places and their neighbors."""
    is_known = np.isfinite(rises)
    z = np.where(is_known, rises, 0.0)
    x, y = (np.where(is_known, values, 0.0) for values in np.transpose(DIRECTIONS).astype(np.float64))
    count = 1.0 + is_known.sum(axis=1)
    mean_x, mean_y, mean_z = (values.sum(axis=1) / count for values in (x, y, z))
    s_xx, s_yy, s_xy, s_xz, s_yz, s_zz = (
        (a * b).sum(axis=1) - count * mean_a * mean_b
        for a, b, mean_a, mean_b in (
            (x, x, mean_x, mean_x),
            (y, y, mean_y, mean_y),
            (x, y, mean_x, mean_y),
            (x, z, mean_x, mean_z),
            (y, z, mean_y, mean_z),
            (z, z, mean_z, mean_z),
        )
    )
    spread = s_xx * s_yy - s_xy**2
    is_plane = (count >= _LEAST_PLACES) & (spread > _FLATTEST)
    spread = np.where(is_plane, spread, 1.0)
    along_x, along_y = (s_xz * s_yy - s_yz * s_xy) / spread, (s_yz * s_xx - s_xz * s_xy) / spread
    rest = np.maximum(s_zz - along_x * s_xz - along_y * s_yz, 0.0)
    gradient = np.column_stack([along_x, along_y]) / cell
    return np.where(is_plane[:, None], gradient, np.nan), np.where(is_plane, np.sqrt(rest / count), np.nan)


def _find_steps(links: Int[np.ndarray, "P 8"], rises: Float[np.ndarray, "P 8"]) -> Float[np.ndarray, "P 8"]:
    """Return the distance of each rise from the range of the rises before and after it on the same line."""
    steps = np.full(rises.shape, np.nan)
    for k in range(8):
        before, after = -rises[:, (k + 4) % 8], np.where(links[:, k] >= 0, rises[links[:, k], k], np.nan)
        both = np.stack([before, after, np.where(np.isnan(before) & np.isnan(after), 0.0, np.nan)])
        low, high = np.nanmin(both, axis=0), np.nanmax(both, axis=0)
        steps[:, k] = np.maximum(np.maximum(low - rises[:, k], rises[:, k] - high), 0.0)
    return steps


def find_rims(
    grid: Grid,
    places: Places,
    links: Int[np.ndarray, "P 8"],
    spans: Spans,
    walls: SortedHeights,
    body: Footprint,
) -> Float[np.ndarray, " P"]:
    """Return the distance of places from walls and rims in the next cells [m]; inf where there are none.

    A wall fills its cell as far as is known, and so does ground that is too steep, so that it is half a cell away.
    Ground that ends may end anywhere in between, so that its distance is 0.
    """
    distance = np.full(len(links), np.inf)
    solid = SortedHeights(spans.cell, spans.high)
    low = np.append(spans.low[solid.order], np.inf)
    for k, (along_x, along_y) in enumerate(DIRECTIONS):
        rim = np.flatnonzero(links[:, k] < 0)
        cell = grid.find_neighbors(places.cell[rim], along_x, along_y)
        bottom, top = places.height[rim] + body.max_step, places.height[rim] + body.height
        above = solid.count_below(cell, bottom)
        is_wall = (np.append(solid.cells, -1)[above] == cell) & (low[above] < top)
        is_wall |= walls.count_below(cell, top) > walls.count_below(cell, bottom)
        is_filled = (is_wall & (cell >= 0)) | (places.links[rim, k] >= 0)
        distance[rim] = np.minimum(distance[rim], np.where(is_filled, grid.cell / 2, 0.0))
    return distance


def _is_in_wall(
    grid: Grid, places: Places, ground: Ground, walls: SortedHeights, body: Footprint
) -> Bool[np.ndarray, " P"]:
    """Return where a wall stands in the cell of a place, above the step that the body climbs."""
    uneven = np.tan(np.nan_to_num(ground.slope)) * grid.cell / np.sqrt(2)
    lowest = places.height + body.max_step + uneven
    first = walls.count_below(places.cell, lowest)
    return walls.count_below(places.cell, places.height + body.height) > first
