"""The scanned staircase: its beams in order, and the comparison of a mesh with the scan, step by step."""

from typing import Any

import numpy as np
import trimesh

from reconstruction._src.geometry.orientation import find_components
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.surfaces.quality import count_topology, find_distances

YAW = np.deg2rad(2.25)
FIRST_RISER, TREAD, RISE, NUM_STEPS = 5.14, 0.34, 0.144, 12
"""Along the stairs, in the scan's frame rotated by `YAW` [m]; tread and rise from OctoMap's data."""
SIDES = (-3.5, 1.2)
"""Range across the stairs in which both the steps and the scan are complete [m]."""
TOLERANCE = 0.010
"""A tread is resolved if its height in the mesh is within this of the scan's [m]."""


FLOOR = 3.4
"""Start of the crop: room for a snake before the first riser [m]."""
CROP = (-3.6, 1.3)
"""Across the stairs, between the walls [m]."""
HIGHEST = 2.0
"""Above this are walls and the ceiling [m]."""
MAX_GAP = 0.45
"""Beams farther apart than a tread and a riser hit different objects [m]."""
_LEAN = 0.1
"""Horizontal over vertical extent of a riser hidden beneath its nosing."""
_UNDERCUT = 0.1
"""Largest overhang of a nosing [m]."""


def order_beams(points: np.ndarray) -> np.ndarray:
    """Return the scan as a grid `[sweep, beam, 3]`, NaN where nothing was hit.

    The sweeps follow one another from high to low; a sweep's beams are 1 degree apart, to the left.
    """
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    sweep = np.cumsum(np.append(0, np.diff(azimuth) < -20))
    beam = np.round(azimuth).astype(int)
    beam -= beam.min()
    grid = np.full((sweep[-1] + 1, beam.max() + 1, 3), np.nan)
    grid[sweep, beam] = points
    return grid


def crop_stairs(points: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Return which points `[..., 3]` are on the stairs or the floor before them."""
    x, y, z = np.moveaxis(_turn(points), -1, 0)
    return (x > FLOOR - margin) & (y > CROP[0]) & (y < CROP[1]) & (z < HIGHEST + margin)


def fill_undercuts(grid: np.ndarray) -> np.ndarray:
    """Return the beams with risers moved under the nosings.

    The space beneath a nosing cannot be touched from above, and convex solids under a terrain cannot be hollow.
    """
    turned = np.where(crop_stairs(grid, 0.3)[..., None], _turn(grid), np.nan)
    for column in np.moveaxis(turned, 1, 0):
        above = None
        for place in np.flatnonzero(np.isfinite(column[:, 0])):
            x, _, z = column[place]
            if above is not None:
                limit = above[0] - _LEAN * max(0.0, above[1] - z)
                if limit < x < above[0] + _UNDERCUT:
                    column[place, 0] = x = limit
            above = x, z
    return _turn_back(turned)


def fill_between_beams(grid: np.ndarray, spacing: float, squeeze: float) -> np.ndarray:
    """Return points `[N, 3]` on the patches between four beams that hit the same surface.

    On the upper treads a column of beams has one or two points, on the risers four. Linear interpolation between beams
    makes the samples even.

    Args:
        grid: `[sweep, beam, 3]` [m].
        spacing: of the points [m].
        squeeze: factor on distances across the stairs, as in `squeeze_stairs`.
    """
    scale = np.array([1.0, squeeze, 1.0])
    low, high, low_left, high_left = grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]
    sides = ((high, low), (high_left, low_left), (low_left, low), (high_left, high))
    lengths = np.stack([np.linalg.norm(a - b, axis=-1) for a, b in sides])
    scaled = np.stack([np.linalg.norm((a - b) * scale, axis=-1) for a, b in sides])
    points = []
    for patch in zip(*np.nonzero((lengths < MAX_GAP).all(axis=0)), strict=True):
        up, left = (int(np.ceil(scaled[i : i + 2, *patch].max() / spacing)) for i in (0, 2))
        s, t = np.meshgrid(np.arange(up) / up, np.arange(left) / left, indexing="ij")
        s, t = s.ravel()[:, None], t.ravel()[:, None]
        below, above = ((1 - t) * a[patch] + t * b[patch] for a, b in ((low, low_left), (high, high_left)))
        points.append((1 - s) * below + s * above)
    return np.concatenate(points)


def squeeze_stairs(points: np.ndarray, squeeze: float) -> np.ndarray:
    """Return points in the stairs' frame, compressed across the stairs so that units become long there."""
    return _turn(points) * [1.0, squeeze, 1.0]


def stretch_stairs(points: np.ndarray, squeeze: float) -> np.ndarray:
    """Undo `squeeze_stairs`."""
    return _turn_back(points / [1.0, squeeze, 1.0])


def compare_stairs(mesh: trimesh.Trimesh, points: np.ndarray) -> dict[str, Any]:
    """Compare the heights of the treads, and check whether the stairs are connected.

    Returns:
        `treads`: number, height in scan and mesh [m] and points of every step with enough points; `judged`: their
        number; `told_apart`: how many of them are resolved, within 10 mm; `rise`: mean step in the mesh [m]; `reach`:
        how high the component of the floor goes, and `highest`, the scan [m]; `cloud_to_mesh` mean [m];
        topology counts.
    """
    faces = np.asarray(mesh.faces)
    on_mesh = _turn(sample_area(np.asarray(mesh.vertices), faces, 400_000))
    scanned = _turn(points)
    treads = []
    for step in range(1, NUM_STEPS + 1):
        start = FIRST_RISER + (step - 1) * TREAD
        in_scan, in_mesh = (_heights(p, start + 0.08, start + 0.27) for p in (scanned, on_mesh))
        if len(in_scan) >= 20 and len(in_mesh) >= 20:
            treads.append([step, float(np.median(in_scan)), float(np.median(in_mesh)), len(in_scan)])
    heights = np.array(treads)
    error = np.abs(heights[:, 2] - heights[:, 1])
    part = find_components(faces, len(mesh.vertices))
    floor = np.bincount(part).argmax()
    topology = count_topology(faces, len(mesh.vertices))
    return {
        "treads": treads,
        "judged": len(treads),
        "told_apart": int((error < TOLERANCE).sum()),
        "worst_height": float(error.max()),
        "rise": float(np.polyfit(heights[:, 0], heights[:, 2], 1)[0]),
        "reach": float(mesh.vertices[faces[part == floor]][..., 2].max()),
        "highest": float(points[:, 2].max()),
        "cloud_to_mesh": float(find_distances(points, np.asarray(mesh.vertices), faces).mean()),
        "components": topology.components,
        "boundary_loops": topology.boundary_loops,
        "unused_vertices": topology.unused_vertices,
    }


def _turn(points: np.ndarray) -> np.ndarray:
    """Return the points with x along the stairs."""
    return points @ _TURN


def _turn_back(points: np.ndarray) -> np.ndarray:
    return points @ _TURN.T


_TURN = np.array([[np.cos(YAW), np.sin(YAW), 0], [-np.sin(YAW), np.cos(YAW), 0], [0, 0, 1]])


def _heights(points: np.ndarray, low: float, high: float) -> np.ndarray:
    is_between = (points[:, 1] > SIDES[0]) & (points[:, 1] < SIDES[1])
    return points[is_between & (points[:, 0] > low) & (points[:, 0] < high), 2]
