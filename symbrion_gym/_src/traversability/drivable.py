"""The map of where a body can drive: places under a free height where the surface looks up, and links between them."""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.traversability.columns import (
    Cells,
    Grid,
    Heights,
    SortedHeights,
    Spans,
    find_crossings,
    find_spans,
    find_walls,
    make_grid,
)
from symbrion_gym._src.traversability.footprint import Footprint

DIRECTIONS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
"""Steps to the eight neighbors of a cell, counterclockwise; the opposite of k is (k + 4) % 8."""
_LENGTHS = np.hypot(*DIRECTIONS.T)  # Of these steps, in cells
_MAX_CELLS = 1_000_000  # Cells are wider where there would be more; these take about 10 s and 1 GB
_SURFACE_DISTANCE = 0.10
"""Ground has surface that looks up within this distance above or below [m]: contact geometry is about 0.06 thick, so
that the upper side of a ceiling that was seen from below alone does not count."""
_MAX_DISTANCE = 1.0  # Distances from walls are known up to this [m]
_STEEPEST_LINK = 2.0  # Ground that rises by more than this per length (63 degrees) is not the same ground
_HIGHEST_LINK = 0.05  # ... and by more than this [m]: a step higher than any body climbs.
_LEAST_RISE = 0.2  # Faces whose normal rises or falls less are walls, which look neither up nor down
_LEAST_PLACES = 4  # A plane is fitted through at least as many places
_FLATTEST = 1e-6  # Places on a line have a smaller determinant of their spread, in cells to the power of 4

logger = logging.getLogger(__name__)

Links = Int[np.ndarray, "P 8"]  # A place in each of the 8 neighboring cells, as `DIRECTIONS`; -1 for none


class Places(NamedTuple):
    """Places on the ground, sorted by cell, then height: several in a cell where there are several storeys."""

    cell: Int[np.ndarray, " P"]  # number of the cell of the grid
    height: Float[np.ndarray, " P"]  # z of the ground in its middle [m]
    clearance: Float[np.ndarray, " P"]  # free height above [m]; inf under the open sky
    links: Links  # on the same ground


@dataclass(frozen=True, eq=False)
class TraversabilityMap:
    """Where a body can drive: places on the ground, several in a cell where there are several storeys.

    Places are sorted by cell, then height.
    """

    footprint: Footprint  # what the body needs
    grid: Grid  # the cells
    cell: Int[np.ndarray, " P"]  # number of the cell of each place
    height: Float[np.ndarray, " P"]  # z of the ground in the middle of the cell [m]
    clearance: Float[np.ndarray, " P"]  # free height above [m]; inf under the open sky
    # slope of the ground over 3 x 3 cells [rad]; nan where there are too few neighbors
    slope: Float[np.ndarray, " P"]
    step: Float[np.ndarray, " P"]  # highest step to a neighbor on the same ground [m]; nan without one
    # distance from the nearest wall, rim or ground that is too steep [m], up to 1 m; 0 on such ground itself
    wall_distance: Float[np.ndarray, " P"]
    # whether the middle of the body can be here: it keeps `footprint.reach` from walls
    is_drivable: Bool[np.ndarray, " P"]
    # number of the connected drivable region, the largest is 0; -1 where it is not drivable
    region: Int[np.ndarray, " P"]
    links: Links  # that the body can drive to without leaning too far to its side

    @property
    def num_regions(self) -> int:
        """Number of connected drivable regions."""
        return int(self.region.max(initial=-1)) + 1

    @cached_property
    def region_areas(self) -> Float[np.ndarray, " R"]:
        """Area of each region in plan [m²], the largest first."""
        return np.bincount(self.region[self.is_drivable], minlength=self.num_regions) * self.grid.cell**2

    @cached_property
    def level(self) -> Int[np.ndarray, " P"]:
        """Number of each place among those of its cell, the lowest first."""
        return np.arange(len(self.cell)) - np.searchsorted(self.cell, self.cell)

    @cached_property
    def positions(self) -> Float[np.ndarray, "P 3"]:
        """Places as points in the world [m]."""
        return np.column_stack([self.grid.compute_centers(self.cell), self.height])

    @cached_property
    def sorted_heights(self) -> SortedHeights:
        """The places, for searches by cell and height."""
        return SortedHeights(self.cell, self.height)

    @cached_property
    def graph(self) -> csr_matrix:
        """Links between drivable places as a graph of lengths [m]."""
        return _make_graph(self.grid, self.links, self.height, self.is_drivable)

    def as_dict(self) -> dict[str, Any]:
        """Return a summary, for JSON."""
        return {
            "footprint": asdict(self.footprint),
            "cell": self.grid.cell,
            "num_places": len(self.cell),
            "num_levels": int(self.level.max(initial=-1)) + 1,
            "ground_area": len(self.cell) * self.grid.cell**2,
            "drivable_area": float(self.region_areas.sum()),
            "region_areas": self.region_areas.tolist(),
        }


def find_traversability(
    surface: trimesh.Trimesh,
    pieces: list[trimesh.Trimesh],
    height_field: HeightField | None,
    footprint: Footprint,
) -> TraversabilityMap:
    """Map where a body can drive.

    Equal arenas give bit-identical maps.
    """
    if not len(surface.faces) or (not pieces and height_field is None):
        raise ArenaError(
            "an arena without surface that was seen, or without contact, has no ground to drive on"
        )
    low, high = np.asarray(surface.bounds, dtype=np.float64)[:, :2]
    grid = make_grid(low, high, footprint.width / 2, _MAX_CELLS)
    if grid.cell > footprint.width:
        text = "the map has cells of %.2f m, wider than the body (%.2f m): steps are missed; map a part of the scan"
        logger.warning(text, grid.cell, footprint.width)
    spans, walls = find_spans(grid, pieces, height_field), find_walls(grid, pieces)
    places = _find_places(grid, spans, surface, footprint.height)
    rises = np.where(places.links >= 0, places.height[places.links] - places.height[:, None], np.nan)
    gradient, steps = _fit_planes(rises) / grid.cell, _find_steps(places.links, rises)
    slope = np.arctan(np.hypot(*gradient.T))
    # Walls in the cell of a place count above the step that the body climbs.
    uneven = np.tan(np.nan_to_num(slope)) * grid.cell / np.sqrt(2)
    bottom, top = places.height + footprint.max_step + uneven, places.height + footprint.height
    is_in_wall = walls.count_below(places.cell, top) > walls.count_below(places.cell, bottom)
    is_walkable = ~(slope > footprint.max_slope) & ~is_in_wall
    is_open = is_walkable[:, None] & is_walkable[places.links] & (places.links >= 0)
    is_open &= steps <= footprint.max_step
    is_open &= np.abs(rises) <= grid.cell * _LENGTHS * np.tan(footprint.max_slope) + footprint.max_step
    links = np.where(is_open, places.links, -1)
    rims = _compute_rims(grid, places, links, spans, walls, footprint)
    wall_distance = _spread_distance(_make_graph(grid, links, places.height), rims)
    links = keep_upright(links, gradient, footprint)
    is_drivable = (wall_distance >= footprint.reach) & (wall_distance > 0.0)
    has_link = np.isfinite(steps).any(axis=1)
    return TraversabilityMap(
        footprint=footprint,
        grid=grid,
        cell=places.cell,
        height=places.height,
        clearance=places.clearance,
        slope=slope,
        step=np.where(has_link, np.nan_to_num(steps).max(axis=1), np.nan),
        wall_distance=wall_distance,
        is_drivable=is_drivable,
        region=_find_regions(_make_graph(grid, links, places.height, is_drivable), is_drivable),
        links=links,
    )


def _find_places(grid: Grid, spans: Spans, surface: trimesh.Trimesh, height: float) -> Places:
    """Return the places where something of some height could stand."""
    is_free = spans.clearance >= height
    cell, top, clearance = spans.cell[is_free], spans.high[is_free], spans.clearance[is_free]
    is_ground = _looks_up(grid, cell, top, surface)
    cell, top, clearance = cell[is_ground], top[is_ground], clearance[is_ground]
    return Places(cell, top, clearance, _find_links(grid, SortedHeights(cell, top)))


def _looks_up(grid: Grid, cell: Cells, height: Heights, surface: trimesh.Trimesh) -> Bool[np.ndarray, " N"]:
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
    reach = max(_SURFACE_DISTANCE, _STEEPEST_LINK * grid.cell / 2)
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


def _find_links(grid: Grid, places: SortedHeights) -> Links:
    """Return the nearest place in height in each neighboring cell, where each is the nearest of the other."""
    links = np.full((len(places.cells), len(DIRECTIONS)), -1)
    most = _STEEPEST_LINK * grid.cell * _LENGTHS + _HIGHEST_LINK
    for k, (along_x, along_y) in enumerate(DIRECTIONS):
        near = places.find_nearest(grid.find_neighbors(places.cells, along_x, along_y), places.heights)
        is_same = (near >= 0) & (np.abs(places.heights[near] - places.heights) <= most[k])
        links[:, k] = np.where(is_same, near, -1)
    back = np.stack([links[links[:, k], (k + 4) % 8] for k in range(8)], axis=1) if len(links) else links
    return np.where((links >= 0) & (back == np.arange(len(links))[:, None]), links, -1)


def _fit_planes(rises: Float[np.ndarray, "P 8"]) -> Float[np.ndarray, "P 2"]:
    """Return the rise per cell of least-squares planes through places and their neighbors; nan of too few."""
    is_known = np.isfinite(rises)
    values = np.stack([np.where(is_known, each, 0.0) for each in (*DIRECTIONS.T, rises)])
    count = 1.0 + is_known.sum(axis=1)
    mean = values.sum(axis=2) / count
    (s_xx, s_xy, s_xz), (_, s_yy, s_yz) = (
        (one * values).sum(axis=2) - count * own * mean for one, own in zip(values[:2], mean[:2], strict=True)
    )
    spread = s_xx * s_yy - s_xy**2
    is_plane = (count >= _LEAST_PLACES) & (spread > _FLATTEST)
    spread = np.where(is_plane, spread, 1.0)
    gradient = np.column_stack([s_xz * s_yy - s_yz * s_xy, s_yz * s_xx - s_xz * s_xy]) / spread[:, None]
    return np.where(is_plane[:, None], gradient, np.nan)


def _find_steps(links: Links, rises: Float[np.ndarray, "P 8"]) -> Float[np.ndarray, "P 8"]:
    """Return the step on the way to each neighbor [m]: what of the rise the rises before and after do not explain."""
    steps = np.full(rises.shape, np.nan)
    for k in range(8):
        before, after = -rises[:, (k + 4) % 8], np.where(links[:, k] >= 0, rises[links[:, k], k], np.nan)
        low, high = np.nan_to_num(np.fmin(before, after)), np.nan_to_num(np.fmax(before, after))
        steps[:, k] = np.maximum(np.maximum(low - rises[:, k], rises[:, k] - high), 0.0)
    return steps


def keep_upright(links: Links, gradient: Float[np.ndarray, "P 2"], body: Footprint) -> Links:
    """Return the links on which a body leans to its side by no more than it may, at either end; else -1."""
    sideways = np.stack([-DIRECTIONS[:, 1], DIRECTIONS[:, 0]]) / _LENGTHS
    aside = np.abs(np.nan_to_num(gradient) @ sideways)
    leans = np.maximum(aside, aside[links, np.arange(len(DIRECTIONS))]) > np.tan(body.max_roll)
    return np.where(leans, -1, links)


def _compute_rims(
    grid: Grid, places: Places, links: Links, spans: Spans, walls: SortedHeights, body: Footprint
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


def _make_graph(
    grid: Grid, links: Links, height: Float[np.ndarray, " P"], is_used: Bool[np.ndarray, " P"] | None = None
) -> csr_matrix:
    is_link = links >= 0
    if is_used is not None:
        is_link &= is_used[:, None] & is_used[links]
    first, k = np.nonzero(is_link)
    second = links[first, k]
    flat = grid.cell * _LENGTHS[k]
    return csr_matrix((np.hypot(flat, height[second] - height[first]), (first, second)), (len(links),) * 2)


def _spread_distance(graph: csr_matrix, rims: Float[np.ndarray, " P"]) -> Float[np.ndarray, " P"]:
    """Return distances from walls and rims along the ground, from those of the places next to them."""
    distance = np.minimum(rims, _MAX_DISTANCE)
    for known in np.unique(rims[rims < _MAX_DISTANCE]):
        near = dijkstra(graph, indices=np.flatnonzero(rims == known), min_only=True, limit=_MAX_DISTANCE)
        distance = np.minimum(distance, near + known)
    return distance


def _find_regions(graph: csr_matrix, is_drivable: Bool[np.ndarray, " P"]) -> Int[np.ndarray, " P"]:
    """Return numbers of the connected parts of what is drivable, the largest first; -1 elsewhere."""
    label = connected_components(graph, directed=False)[1]
    sizes = np.bincount(label[is_drivable], minlength=label.max(initial=-1) + 1)
    rank = np.argsort(np.argsort(-sizes, kind="stable"))
    return np.where(is_drivable, rank[label], -1)
