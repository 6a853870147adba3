"""Four ways to touch a surface, one option: convex pieces, a height field, exact prisms, boxes and pieces.

| kind | what it is | for |
|---|---|---|
| `convex` | convex slabs under planes of the mesh; coacd where it is not a terrain | everything |
| `primitives` | the paper's mixed model: planes become boxes, the rest convex pieces | few large planes |
| `hfield` | MuJoCo's height field | rough, unbroken ground |
| `prisms` | one prism a triangle: exact, slow, noise and all | reference |
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.hulls import make_hull
from reconstruction.geometry.outlines import hull_2d
from symbrion_gym.contact.planes import Planes
from symbrion_gym.errors import ArenaError

CONTACT_KINDS = ("convex", "primitives", "hfield", "prisms")

_PRISM_DEPTH = 0.10


class HeightField(NamedTuple):
    """Heights on a grid.

    Attributes:
        heights: `[R, C]` rows along y, columns along x; nothing is NaN, beyond the rim stands the lowest [m].
        low: (x, y) of the first row and column [m].
        high: (x, y) of the last [m].
    """

    heights: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def as_mesh(self) -> trimesh.Trimesh:
        """Return the surface as MuJoCo splits it: two triangles a cell."""
        rows, columns = self.heights.shape
        x, y = (np.linspace(self.low[i], self.high[i], n) for i, n in ((0, columns), (1, rows)))
        vertices = np.stack([*np.meshgrid(x, y), self.heights], axis=-1).reshape(-1, 3)
        corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
        first = np.stack([corner, corner + 1, corner + columns], axis=1)
        second = np.stack([corner + 1, corner + columns + 1, corner + columns], axis=1)
        return trimesh.Trimesh(vertices, np.concatenate([first, second]), process=False)


def make_height_field(mesh: trimesh.Trimesh, spacing: float = 0.02, max_cells: int = 400_000) -> HeightField:
    """Sample a terrain on a grid of about `spacing` [m]."""
    low, high = mesh.bounds[:, :2]
    spacing = max(spacing, float(np.sqrt(np.prod(high - low) / max_cells)))
    columns, rows = (max(int(np.ceil(extent / spacing)) + 1, 2) for extent in high - low)
    # A hair inside the rim, so that the rim itself is hit.
    low, high = low + 1e-6, high - 1e-6
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    heights = Elevation(mesh).height(x, y)
    if np.isnan(heights).all():
        raise ArenaError("a height field needs ground that is seen from above")
    return HeightField(np.where(np.isnan(heights), np.nanmin(heights), heights), low, high)


def make_prisms(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Return one prism a triangle: the triangle, and itself moved down, or inwards where it is steep."""
    faces = np.array([[0, 1, 2], [3, 5, 4], [0, 3, 1], [1, 3, 4], [1, 4, 2], [2, 4, 5], [2, 5, 0], [0, 5, 3]])
    corners, normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
    down = np.where(normals[:, 2:] > 0.5, [0.0, 0.0, -1.0], -normals)
    is_usable = np.asarray(mesh.area_faces) > 1e-6
    prisms = np.concatenate([corners, corners + _PRISM_DEPTH * down[:, None]], axis=1)[is_usable]
    return [trimesh.Trimesh(prism, faces, process=False) for prism in prisms]


def make_boxes(
    mesh: trimesh.Trimesh, planes: Planes, accuracy: float, min_rise: float = 0.3
) -> list[trimesh.Trimesh]:
    """Return boxes beneath the planes that fill a rectangle (the paper's primitives, its reference 22)."""
    elevation = Elevation(mesh)
    boxes = []
    for k in range(len(planes.normals)):
        normal = planes.normals[k]
        if normal[2] < min_rise:
            continue
        members = planes.labels == k
        corners = np.asarray(mesh.triangles)[members].reshape(-1, 3)
        rectangle = _find_rectangle(corners, normal, float(mesh.area_faces[members].sum()))
        if rectangle is None:
            continue
        for depth in (0.2, 0.1, 0.05):
            box = _make_box(rectangle, normal, planes.offsets[k], depth)
            if box is not None and _is_beneath(box, elevation, accuracy):
                boxes.append(box)
                break
    return boxes


def find_uncovered(
    slabs: list[trimesh.Trimesh], boxes: list[trimesh.Trimesh], accuracy: float, spacing: float = 0.03
) -> list[trimesh.Trimesh]:
    """Return the slabs whose top the boxes do not already reach."""
    if not boxes:
        return slabs
    low = np.min([slab.bounds[0, :2] for slab in slabs], axis=0)
    high = np.max([slab.bounds[1, :2] for slab in slabs], axis=0)
    x, y = (a.ravel() for a in np.meshgrid(*(np.arange(low[i], high[i], spacing) for i in range(2))))
    everything, reached = Elevation(*slabs).height(x, y), Elevation(*boxes).height(x, y)
    is_open = np.isfinite(everything) & ~(np.abs(reached - everything) < accuracy)
    kept = []
    for slab in slabs:
        top = Elevation(slab).height(x[is_open], y[is_open])
        is_top = np.abs(top - everything[is_open]) < 1e-6
        if is_top.sum() * spacing**2 > 0.02:
            kept.append(slab)
    return kept


def _find_rectangle(corners: np.ndarray, normal: np.ndarray, area: float) -> np.ndarray | None:
    """The smallest rectangle around a plane's faces, `[4, 2]` in plan, if they fill it."""
    outline = hull_2d(corners[:, :2])
    if outline is None:
        return None
    best, least = None, np.inf
    for side in np.roll(outline, -1, axis=0) - outline:
        along = side / np.linalg.norm(side)
        frame = np.array([along, [-along[1], along[0]]])
        # 0.5 % of the corners may stick out: single triangles that reach over a crease.
        low, high = np.percentile(corners[:, :2] @ frame.T, [0.5, 99.5], axis=0)
        if np.prod(high - low) < least:
            least = float(np.prod(high - low))
            best = (
                np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]) @ frame
            )
    return best if best is not None and area * normal[2] > 0.93 * least else None


def _make_box(
    rectangle: np.ndarray, normal: np.ndarray, offset: float, depth: float
) -> trimesh.Trimesh | None:
    heights = (offset - rectangle @ normal[:2]) / normal[2]
    top = np.column_stack([rectangle, heights])
    return make_hull(np.concatenate([top, top - depth * normal]))


def _is_beneath(box: trimesh.Trimesh, elevation: Elevation, accuracy: float) -> bool:
    """Whether a box lifts the ground nowhere but at its very rim."""
    (x0, y0), (x1, y1) = box.bounds[:, :2]
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(x0, x1, 80), np.linspace(y0, y1, 80)))
    above = Elevation(box).height(x, y) - elevation.height(x, y)
    above = above[np.isfinite(above)]
    return len(above) > 0 and float((above > 3.0 * accuracy).mean()) < 0.02
