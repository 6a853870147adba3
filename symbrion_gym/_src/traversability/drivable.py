"""The map of where a body can drive."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.traversability.columns import SortedHeights, Spans, find_spans, find_walls
from symbrion_gym._src.traversability.footprint import Footprint, TraversabilityConfig
from symbrion_gym._src.traversability.grid import Grid, make_grid
from symbrion_gym._src.traversability.places import DIRECTIONS, Places, find_places

_LEAST_PLACES = 4  # A plane is fitted through at least as many places
_FLATTEST = 1e-6  # Places on a line have a smaller determinant of their spread, in cells to the power of 4


class Ground(NamedTuple):
    """The shape of the ground at places."""

    # rise of the plane through a place and its neighbors along x and y; nan with fewer than 3 neighbors
    gradient: Float[np.ndarray, "P 2"]
    slope: Float[np.ndarray, " P"]  # angle of that plane [rad]; nan likewise
    roughness: Float[np.ndarray, " P"]  # standard deviation of the ground from that plane [m]
    # height of the ground at each neighbor above that at the place [m]; nan without a neighbor
    rises: Float[np.ndarray, "P 8"]
    # step on the way to each neighbor [m]: what of the rise is not explained by the slopes before and after
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


def compute_rims(
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


logger = logging.getLogger(__name__)


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
    # rise of the ground along x and y over 3 x 3 cells; nan where there are too few neighbors
    gradient: Float[np.ndarray, "P 2"]
    # slope of the ground over 3 x 3 cells [rad]; nan where there are too few neighbors
    slope: Float[np.ndarray, " P"]
    roughness: Float[np.ndarray, " P"]  # standard deviation of the ground from that slope [m]; nan likewise
    step: Float[np.ndarray, " P"]  # highest step to a neighbor on the same ground [m]; nan without one
    # distance from the nearest wall, rim or ground that is too steep [m], up to
    # `TraversabilityConfig.max_distance`; 0 on such ground itself
    wall_distance: Float[np.ndarray, " P"]
    # whether the middle of the body can be here: it keeps `footprint.reach` from walls
    is_drivable: Bool[np.ndarray, " P"]
    # number of the connected drivable region, the largest is 0; -1 where it is not drivable
    region: Int[np.ndarray, " P"]
    # the place in each neighboring cell that the body can drive to without leaning too far to its side; -1
    # for none
    links: Int[np.ndarray, "P 8"]

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
        starts = np.searchsorted(self.cell, self.cell)
        return np.arange(len(self.cell)) - starts

    @cached_property
    def positions(self) -> Float[np.ndarray, "P 3"]:
        """Places as points in the world [m]."""
        return np.column_stack([self.grid.compute_centers(self.cell), self.height])

    @cached_property
    def sorted_heights(self) -> SortedHeights:
        """The places, for searches by cell and height."""
        return SortedHeights(self.cell, self.height)

    def find_graph(self, is_used: Bool[np.ndarray, " P"] | None = None) -> csr_matrix:
        """Return the links between places as a graph of lengths [m]."""
        return _make_graph(self.grid, self.links, self.height, is_used)

    def as_dict(self) -> dict[str, Any]:
        """Return a summary, for JSON."""
        return {
            "footprint": self.footprint.as_dict(),
            "cell": self.grid.cell,
            "num_places": len(self.cell),
            "num_levels": int(self.level.max(initial=-1)) + 1,
            "ground_area": len(self.cell) * self.grid.cell**2,
            "drivable_area": float(self.region_areas.sum()),
            "region_areas": self.region_areas.tolist(),
        }

    def picture(self) -> np.ndarray:
        """Return an image `[H, W, 3]` (RGB, uint8) from above, one pixel a cell, north up.

        White: no ground; gray: ground; green: the largest drivable region; blue: the others.
        """
        colors = np.array([[180, 180, 180], [90, 130, 200], [60, 160, 80]], dtype=np.uint8)
        kind = np.where(self.region == 0, 2, np.where(self.region > 0, 1, 0))
        best = np.full(self.grid.num_cells, -1)
        np.maximum.at(best, self.cell, kind)
        image = np.full((self.grid.num_cells, 3), 255, dtype=np.uint8)
        image[best >= 0] = colors[best[best >= 0]]
        return np.ascontiguousarray(image.reshape(*self.grid.shape, 3).transpose(1, 0, 2)[::-1])


def find_traversability(
    surface: trimesh.Trimesh,
    pieces: list[trimesh.Trimesh],
    height_field: HeightField | None = None,
    footprint: Footprint | None = None,
    config: TraversabilityConfig | None = None,
) -> TraversabilityMap:
    """Map where a body can drive.

    Equal arenas give bit-identical maps.
    """
    footprint, config = footprint or Footprint(), config or TraversabilityConfig()
    if not len(surface.faces) or (not pieces and height_field is None):
        raise ArenaError("an arena without surface or contact geometry has no ground to drive on")
    low, high = np.asarray(surface.bounds, dtype=np.float64)[:, :2]
    wanted = footprint.width / 2 if config.cell is None else config.cell
    grid = make_grid(low, high, wanted, config.max_cells)
    if grid.cell > footprint.width:
        logger.warning(
            "the map has cells of %.2f m, wider than the body (%.2f m), and misses steps between them; "
            "make the arena of a part of the scan",
            grid.cell,
            footprint.width,
        )
    spans = find_spans(grid, pieces, height_field, config.crack)
    places = find_places(grid, spans, surface, footprint.height, config.surface_distance)
    ground = find_ground(grid, places)
    walls = find_walls(grid, pieces, config.wall_slope)
    links = find_walkable(grid, places, ground, walls, footprint)
    wall_distance = _spread_distance(
        _make_graph(grid, links, places.height),
        compute_rims(grid, places, links, spans, walls, footprint),
        config.max_distance,
    )
    links = keep_upright(links, ground.gradient, footprint)
    is_drivable = (wall_distance >= footprint.reach) & (wall_distance > 0.0)
    has_link = np.isfinite(ground.steps).any(axis=1)
    step = np.where(has_link, np.nan_to_num(ground.steps).max(axis=1), np.nan)
    return TraversabilityMap(
        footprint,
        grid,
        places.cell,
        places.height,
        places.clearance,
        ground.gradient,
        ground.slope,
        ground.roughness,
        step,
        wall_distance,
        is_drivable,
        _find_regions(_make_graph(grid, links, places.height, is_drivable), is_drivable),
        links,
    )


def _make_graph(
    grid: Grid,
    links: Int[np.ndarray, "P 8"],
    height: Float[np.ndarray, " P"],
    is_used: Bool[np.ndarray, " P"] | None = None,
) -> csr_matrix:
    is_link = links >= 0
    if is_used is not None:
        is_link &= is_used[:, None] & is_used[links]
    first, k = np.nonzero(is_link)
    second = links[first, k]
    flat = grid.cell * np.hypot(*np.transpose(DIRECTIONS))[k]
    return csr_matrix((np.hypot(flat, height[second] - height[first]), (first, second)), (len(links),) * 2)


def _spread_distance(
    graph: csr_matrix, rims: Float[np.ndarray, " P"], most: float
) -> Float[np.ndarray, " P"]:
    """Return distances from walls and rims along the ground, from those of the places next to them."""
    distance = np.minimum(rims, most)
    for known in np.unique(rims[rims < most]):
        near = dijkstra(graph, indices=np.flatnonzero(rims == known), min_only=True, limit=most)
        distance = np.minimum(distance, near + known)
    return distance


def _find_regions(graph: csr_matrix, is_drivable: Bool[np.ndarray, " P"]) -> Int[np.ndarray, " P"]:
    """Return numbers of the connected parts of what is drivable, the largest first; -1 elsewhere."""
    if not is_drivable.any():
        return np.full(len(is_drivable), -1)
    label = connected_components(graph, directed=False)[1]
    sizes = np.bincount(label[is_drivable], minlength=label.max() + 1)
    rank = np.empty(len(sizes), dtype=np.int64)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return np.where(is_drivable, rank[label], -1)
