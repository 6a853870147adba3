"""Judge a mesh of the scanned staircase step by step."""

from typing import Any

import numpy as np
import trimesh

from reconstruction.orientation import find_components
from reconstruction.quality import count_topology, find_distances, sample_area

YAW = np.deg2rad(2.25)
FIRST_RISER, TREAD, RISE, NUM_STEPS = 5.14, 0.34, 0.144, 12
"""Along the stairs, in the scan's frame turned by `YAW` [m]; tread and rise by OctoMap's data."""
SIDES = (-3.5, 1.2)
"""Where both the steps and the scan are whole, across the stairs [m]."""
TOLERANCE = 0.010
"""A tread is told apart where its height in the mesh is within this of the scan's [m]."""


def judge_stairs(mesh: trimesh.Trimesh, points: np.ndarray) -> dict[str, Any]:
    """Compare the heights of the treads, and tell whether the stairs hang together.

    Returns:
        `treads`: number, height in scan and mesh [m] and points of every step that has enough points to be
        `judged`; `told_apart`: how many of them are within 10 mm; `rise`: mean step in the mesh [m]; `reach`:
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
    cos, sin = np.cos(YAW), np.sin(YAW)
    return points @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])


def _heights(points: np.ndarray, low: float, high: float) -> np.ndarray:
    is_between = (points[:, 1] > SIDES[0]) & (points[:, 1] < SIDES[1])
    return points[is_between & (points[:, 0] > low) & (points[:, 0] < high), 2]
