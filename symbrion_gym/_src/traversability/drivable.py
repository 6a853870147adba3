"""The map of where a body can drive."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.traversability.columns import SortedHeights, find_spans, find_walls
from symbrion_gym._src.traversability.footprint import Footprint, TraversabilityConfig
from symbrion_gym._src.traversability.grid import Grid, make_grid
from symbrion_gym._src.traversability.ground import find_ground, find_rims, find_walkable, keep_upright
from symbrion_gym._src.traversability.places import DIRECTIONS, find_places

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class TraversabilityMap:
    """Where a body can drive: places on the ground, several in a cell where there are several storeys.

    Places are sorted by cell, then height.

    Attributes:
        footprint: what the body needs.
        grid: the cells.
        cell: `[P]` number of the cell of each place.
        height: `[P]` z of the ground in the middle of the cell [m].
        clearance: `[P]` free height above [m]; inf under the open sky.
        gradient: `[P, 2]` rise of the ground along x and y over 3 x 3 cells; nan where there are too few neighbors.
        slope: `[P]` slope of the ground over 3 x 3 cells [rad]; nan where there are too few neighbors.
        roughness: `[P]` standard deviation of the ground from that slope [m]; nan likewise.
        step: `[P]` highest step to a neighbor on the same ground [m]; nan without one.
        wall_distance: `[P]` distance from the nearest wall, rim or ground that is too steep [m], up to
            `TraversabilityConfig.max_distance`; 0 on such ground itself.
        is_drivable: `[P]` whether the middle of the body can be here: it keeps `footprint.reach` from walls.
        region: `[P]` number of the connected drivable region, the largest is 0; -1 where it is not drivable.
        links: `[P, 8]` the place in each neighboring cell that the body can drive to without leaning too far to its
            side; -1 for none.
    """

    footprint: Footprint
    grid: Grid
    cell: Int[np.ndarray, " P"]
    height: Float[np.ndarray, " P"]
    clearance: Float[np.ndarray, " P"]
    gradient: Float[np.ndarray, "P 2"]
    slope: Float[np.ndarray, " P"]
    roughness: Float[np.ndarray, " P"]
    step: Float[np.ndarray, " P"]
    wall_distance: Float[np.ndarray, " P"]
    is_drivable: Bool[np.ndarray, " P"]
    region: Int[np.ndarray, " P"]
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
        return np.column_stack([self.grid.find_centers(self.cell), self.height])

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

    Equal arenas give equal maps, to the bit.
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
        find_rims(grid, places, links, spans, walls, footprint),
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
