"""Points sampled on surfaces, and over boxes in plan: on a grid, and in the middle of cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import (
    Faces,
    Points,
    Vertices,
    compute_area_vectors,
    compute_areas,
    compute_lengths,
    sum_rows,
)

if TYPE_CHECKING:
    import trimesh

_MIN_COSINE = 0.05
"""A ray closer than this to the plane of its face (3 degrees) votes for neither side: noise of the normal decides."""
_REACH = 0.5
"""A point votes for its nearest face where it is nearer than this share of the face's longest side."""
_DEPTH_CELLS = tuple(np.deg2rad([1.0, 2.0, 4.0, 8.0]))
"""Widths of the directions in which a point hides those behind it [rad], of which the first is taken that holds
`_MIN_COUNT` points; 1 degree is the spacing of the beams of many scanners, wider cells round off what they hide."""
_MIN_COUNT = 4
"""With this many points in a direction in the mean, few directions without one are left to look through."""
_DEPTH_MARGIN = 0.25
"""A point is hidden where it is farther than the nearest one in its direction by more than this share: on a floor
seen at a low angle ranges in one direction differ by as much."""
_NUM_CANDIDATES = 8  # As many of the nearest viewpoints are tried for each point
TALLEST, SQUARE = 2.0, 1.0  # What is so far above the lowest of its square of so wide meets no robot [m]
_MARGIN = 1e-3  # Reach of a grid beyond the corners [m]: what ends at them is seen from both sides


def sample_area(
    vertices: Vertices, faces: Faces, num_samples: int, rng: np.random.Generator | int = 0
) -> Float[np.ndarray, "{num_samples} 3"]:
    """Return points spread evenly over the area of the faces: one in each of `num_samples` shares of the area."""
    rng = np.random.default_rng(rng)
    areas = compute_areas(vertices, faces)
    place = (np.arange(num_samples) + rng.random(num_samples)) / num_samples * areas.sum()
    face = np.minimum(np.searchsorted(np.cumsum(areas), place), len(faces) - 1)
    root, split = np.sqrt(rng.random((num_samples, 1))), rng.random((num_samples, 1))
    a, b, c = (vertices[faces[face, k]] for k in range(3))
    return (1 - root) * a + root * (1 - split) * b + root * split * c


def find_low(points: Points) -> Bool[np.ndarray, " N"]:
    """Return the points that robots on the ground may meet: none is far above the lowest of its square."""
    square = np.unique(np.floor(points[:, :2] / SQUARE), axis=0, return_inverse=True)[1].ravel()
    lowest = np.full(square.max(initial=-1) + 1, np.inf)
    np.minimum.at(lowest, square, points[:, 2])
    return points[:, 2] <= lowest[square] + TALLEST


def sample_surface(
    mesh: trimesh.Trimesh, num_samples: int, rng: np.random.Generator | int = 0
) -> tuple[Float[np.ndarray, "{num_samples} 3"], Int[np.ndarray, " {num_samples}"]]:
    """Return independent points, uniform over the area of a mesh, and their faces: trimesh's sampler.

    `sample_area` needs fewer points for the same accuracy; this draws what trimesh draws.
    """
    import trimesh

    found = trimesh.sample.sample_surface(mesh, num_samples, seed=rng)
    return np.asarray(found[0]), np.asarray(found[1])


def sample_cells(
    low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"], spacing: float
) -> Float[np.ndarray, "X Y 2"]:
    """Return the centers (x, y) of the grid cells of a width `spacing` between two corners."""
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def sample_grid(
    corners: Float[np.ndarray, "V D"], count: int, margin: float = _MARGIN
) -> Float[np.ndarray, "N 2"]:
    """Return a grid of `count` squared points (x, y) over the box around corners in plan, and a margin [m]."""
    low, high = corners[:, :2].min(axis=0) - margin, corners[:, :2].max(axis=0) + margin
    axes = [np.linspace(low[i], high[i], count) for i in range(2)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def count_votes(
    vertices: Vertices,
    faces: Faces,
    points: Points,
    viewpoints: Float[np.ndarray, "K 3"],
    seen_from: Int[np.ndarray, " N"] | None = None,
) -> tuple[Float[np.ndarray, " F"], Float[np.ndarray, " F"]]:
    """Return for each face the sum of its votes, and the sum of their absolute values.

    Every point votes for its nearest face, with the cosine between the normal and the direction of its viewpoint.
    """
    import igl

    if len(faces) == 0 or len(points) == 0:
        return np.zeros(len(faces)), np.zeros(len(faces))
    if seen_from is None:
        seen_from = choose_viewpoints(points, viewpoints)
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    found = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)
    squared, nearest = np.asarray(found[0]), np.asarray(found[1])
    corners, normal = vertices[faces], compute_area_vectors(vertices, faces)
    normal /= np.maximum(compute_lengths(normal), 1e-300)[:, None]
    longest = compute_lengths(corners - np.roll(corners, 1, axis=1)).max(axis=1)
    direction = viewpoints[seen_from] - points
    direction /= np.maximum(compute_lengths(direction), 1e-300)[:, None]
    vote = sum_rows(direction * normal[nearest])
    vote[(np.abs(vote) < _MIN_COSINE) | (squared > (_REACH * longest[nearest]) ** 2)] = 0.0
    votes = np.bincount(nearest, vote, minlength=len(faces))
    return votes, np.bincount(nearest, np.abs(vote), minlength=len(faces))


def choose_viewpoints(points: Points, viewpoints: Float[np.ndarray, "K 3"]) -> Int[np.ndarray, " N"]:
    """Return for each point the nearest viewpoint from which no other point hides it; else the nearest."""
    if len(viewpoints) == 1:
        return np.zeros(len(points), np.int64)
    num_candidates = min(_NUM_CANDIDATES, len(viewpoints))
    _, candidates = cKDTree(viewpoints).query(points, k=num_candidates)
    chosen = candidates[:, 0].astype(np.int64)
    is_open = np.ones(len(points), dtype=bool)
    seen: dict[int, Bool[np.ndarray, " N"]] = {}
    for rank in range(num_candidates):
        for viewpoint in np.unique(candidates[is_open, rank]):
            if viewpoint not in seen:
                seen[viewpoint] = find_visible(points, viewpoints[viewpoint])
            is_found = is_open & (candidates[:, rank] == viewpoint) & seen[viewpoint]
            chosen[is_found], is_open = viewpoint, is_open & ~is_found
    return chosen


def find_visible(points: Points, viewpoint: Float[np.ndarray, " 3"]) -> Bool[np.ndarray, " N"]:
    """Return which points no other one hides from a viewpoint, by a depth map; at least one point."""
    offset = points - viewpoint
    depth = compute_lengths(offset)
    direction = _find_directions(offset, depth, _DEPTH_CELLS[0])
    for width in _DEPTH_CELLS[1:]:
        counts = np.bincount(direction)
        if np.median(counts[counts > 0]) >= _MIN_COUNT:
            break
        direction = _find_directions(offset, depth, width)
    nearest = np.full(direction.max() + 1, np.inf)
    np.minimum.at(nearest, direction, depth)
    return depth <= (1 + _DEPTH_MARGIN) * nearest[direction]


def _find_directions(offset: Points, depth: Float[np.ndarray, " N"], width: float) -> Int[np.ndarray, " N"]:
    """Return the number of the cell of azimuth and elevation, `width` wide [rad], in which each point is seen."""
    azimuth = np.arctan2(offset[:, 1], offset[:, 0]) + np.pi
    elevation = np.arcsin(np.clip(offset[:, 2] / np.maximum(depth, 1e-300), -1, 1)) + np.pi / 2
    num_columns = int(np.ceil(2 * np.pi / width)) + 1
    return (elevation / width).astype(np.int64) * num_columns + (azimuth / width).astype(np.int64)
