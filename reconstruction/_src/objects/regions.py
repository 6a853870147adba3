"""Regions of a scan that may hold an object: what is left beside the large planes, in parts of its size."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.objects.config import ObjectsConfig
from reconstruction._src.objects.model import ObjectModel, find_spread

_GAP = 2.5
"""Cells closer than this many spacings belong together."""
_MIN_EXTENT = 0.5
"""What is smaller than this share of the object's radius is no part of it."""
_MIN_SPREAD = 0.4
"""Along each principal axis a region is as wide as this share of the object."""


class Region(NamedTuple):
    """A part of the scan that may hold an object.

    Attributes:
        center: `[3]` [m].
        rows: cells that are not background, within a diameter.
    """

    center: Float[np.ndarray, " 3"]
    rows: Int[np.ndarray, " M"]


def find_regions(points: Float[np.ndarray, "C 3"], model: ObjectModel, config: ObjectsConfig) -> list[Region]:
    """Return the regions in which an object is searched.

    Parts smaller than the object give one region; larger ones are covered by several that overlap.
    """
    if len(points) < 8:
        return []
    tree = cKDTree(points)
    pairs = tree.query_pairs(_GAP * config.spacing, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), tuple(pairs.T)), shape=(len(points), len(points)))
    count, part = connected_components(graph, directed=False)
    order = np.argsort(part, kind="stable")
    regions: list[Region] = []
    for rows in np.split(order, np.cumsum(np.bincount(part, minlength=count))[:-1]):
        if len(rows) >= 12 and np.ptp(points[rows], axis=0).max() >= _MIN_EXTENT * model.radius:
            regions += _cover(points, rows, tree, model.radius)
    return [each for each in regions if _may_hold(points, each, model)]


def _may_hold(points: np.ndarray, region: Region, model: ObjectModel) -> bool:
    """Return whether what is near the center is no thinner than half the object, as edges and flat sides are."""
    near = points[region.rows]
    near = near[np.linalg.norm(near - region.center, axis=1) <= model.radius]
    return len(near) >= 12 and bool((find_spread(near) >= _MIN_SPREAD * model.spread).all())


def _cover(points: np.ndarray, rows: np.ndarray, tree: cKDTree, radius: float) -> list[Region]:
    """Return regions around places of a part, a radius apart, until all of it is covered."""
    middle = (points[rows].min(axis=0) + points[rows].max(axis=0)) / 2
    if np.linalg.norm(points[rows] - middle, axis=1).max() <= 1.3 * radius:
        return [Region(middle, np.sort(np.array(tree.query_ball_point(middle, 1.5 * radius), np.int64)))]
    regions, left = [], rows
    while len(left):
        seed = points[left[int(np.argmin(points[left] @ np.array([1.0, 0.618, 0.382])))]]
        near = np.linalg.norm(points[left] - seed, axis=1) <= radius
        center = points[left[near]].mean(axis=0)
        inside = np.sort(np.array(tree.query_ball_point(center, 1.4 * radius), np.int64))
        if len(inside) >= 12:
            regions.append(Region(center, inside))
        left = left[~near]
    return regions
