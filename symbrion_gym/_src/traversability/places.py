"""Where something could stand: tops of what is solid, under a free height, where the surface looks up."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.traversability.columns import SortedHeights, Spans
from symbrion_gym._src.traversability.grid import Grid, find_crossings

DIRECTIONS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Steps to the eight neighbors of a cell, counterclockwise; the opposite of k is (k + 4) % 8."""
_STEEPEST_LINK = 2.0
"""Ground that rises by more than this per length (63 degrees), and by `_HIGHEST_LINK`, is not the same ground."""
_HIGHEST_LINK = 0.05  # Step that is still the same ground [m]: more than any body climbs
_LEAST_RISE = 0.2  # Faces whose normal rises or falls less are walls, which look neither up nor down


class Places(NamedTuple):
    """Places on the ground, sorted by cell, then height: several in a cell where there are several storeys."""

    cell: Int[np.ndarray, " P"]  # number of the cell of the grid
    height: Float[np.ndarray, " P"]  # z of the ground in its middle [m]
    clearance: Float[np.ndarray, " P"]  # free height above [m]; inf under the open sky
    # the place in each of the 8 neighboring cells on the same ground, as `DIRECTIONS`; -1 for none
    links: Int[np.ndarray, "P 8"]


def find_places(
    grid: Grid, spans: Spans, surface: trimesh.Trimesh, height: float, surface_distance: float
) -> Places:
    """Return the places where something of some height could stand."""
    is_free = spans.clearance >= height
    cell, top, clearance = spans.cell[is_free], spans.high[is_free], spans.clearance[is_free]
    is_ground = _looks_up(grid, cell, top, surface, surface_distance)
    cell, top, clearance = cell[is_ground], top[is_ground], clearance[is_ground]
    return Places(cell, top, clearance, _find_links(grid, SortedHeights(cell, top)))


def _looks_up(
    grid: Grid,
    cell: Int[np.ndarray, " N"],
    height: Float[np.ndarray, " N"],
    surface: trimesh.Trimesh,
    distance: float,
) -> Bool[np.ndarray, " N"]:
    """Return where the surface nearby looks up.

    Faces above and below vote, those in the neighboring cells too, with a weight that falls from 1 to 0 at the
    distance: so a table top counts although its underside was seen, and a fold in a ceiling does not.
    """
    corners = np.asarray(surface.triangles, dtype=np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rise = normals[:, 2] / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)
    is_level = np.abs(rise) > _LEAST_RISE
    found = find_crossings(grid, corners[is_level])
    seen = SortedHeights(found.cell, found.height)
    vote = np.sign(rise[is_level])[found.triangle[seen.order]]
    sums = [np.concatenate([[0.0], np.cumsum(values)]) for values in (vote, vote * seen.heights)]
    reach = max(distance, _STEEPEST_LINK * grid.cell / 2)
    total = np.zeros(len(cell))
    for along_x, along_y in ((0, 0), *DIRECTIONS):
        near = grid.find_neighbors(cell, along_x, along_y)
        ends = [seen.count_below(near, height + shift) for shift in (-reach, 0.0, reach)]
        (below, z_below), (above, z_above) = (
            [values[end] - values[start] for values in sums] for start, end in pairwise(ends)
        )
        weight = below + above + (z_below - height * below - z_above + height * above) / reach
        total += np.where(near >= 0, weight, 0.0)
    return total > 0


def _find_links(grid: Grid, places: SortedHeights) -> Int[np.ndarray, "P 8"]:
    """Return the nearest place in height in each neighboring cell, where each is the nearest of the other."""
    links = np.full((len(places.cells), len(DIRECTIONS)), -1)
    for k, (along_x, along_y) in enumerate(DIRECTIONS):
        near = places.find_nearest(grid.find_neighbors(places.cells, along_x, along_y), places.heights)
        most = _STEEPEST_LINK * grid.cell * np.hypot(along_x, along_y) + _HIGHEST_LINK
        is_same = (near >= 0) & (np.abs(places.heights[near] - places.heights) <= most)
        links[:, k] = np.where(is_same, near, -1)
    return keep_mutual(links)


def keep_mutual(links: Int[np.ndarray, "P 8"]) -> Int[np.ndarray, "P 8"]:
    """Return links without those that the other end does not return."""
    own = np.arange(len(links))
    back = np.stack([links[links[:, k], (k + 4) % 8] for k in range(8)], axis=1) if len(links) else links
    return np.where((links >= 0) & (back == own[:, None]), links, -1)
