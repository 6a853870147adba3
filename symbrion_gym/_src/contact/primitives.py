"""Boxes beneath large planes: the paper's mixed model of primitives and convex pieces (its reference 22)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_smallest_rectangle
from reconstruction._src.geometry.rows import make_hull
from reconstruction._src.geometry.sampling import sample_grid
from symbrion_gym._src.contact.planes import Planes, find_planes
from symbrion_gym._src.contact.seams import share_planes

_ON_TOP = 1e-6
"""A slab is the top where the union of all slabs is no higher than it [m]."""


_MIN_RISE = 0.3
"""Planes whose unit normal rises less are walls, beneath which there is no box."""
_TRIMMED = 0.5
"""Percentage of corners that may stick out at each side: single triangles that reach over a crease."""
_MIN_FILLED = 0.93
"""Share of its rectangle that a plane fills at least."""
_DEPTHS = (0.2, 0.1, 0.05)
"""Boxes tried are this deep [m]."""
_LIFT = 3.0
"""A box may lift the ground by this many times the accuracy,."""
_LIFTED = 0.02
"""... and by more at this share of its points: at its rim."""
_CHECK_POINTS = 80
"""Points a side of the grid on which that is looked at."""
_SPACING = 0.03
"""Spacing of the grid on which slabs are compared with boxes [m]."""
_MIN_OPEN = 0.02
"""A slab is kept for this much of its top that no box reaches [m²]."""


def make_boxes(
    mesh: trimesh.Trimesh,
    ground: Elevation,
    planes: Planes,
    accuracy: float,
) -> list[trimesh.Trimesh]:
    """Return boxes beneath the planes that fill a rectangle."""
    boxes = []
    for k in np.flatnonzero(planes.normals[:, 2] >= _MIN_RISE):
        members = planes.labels == k
        corners = np.asarray(mesh.triangles)[members].reshape(-1, 3)
        area = float(mesh.area_faces[members].sum())
        top = _find_top(corners, planes.normals[k], float(planes.offsets[k]), area)
        if top is None:
            continue
        for depth in _DEPTHS:
            box = make_hull(np.concatenate([top, top - depth * planes.normals[k]]))
            if box is not None and _is_beneath(box, ground, _LIFT * accuracy):
                boxes.append(box)
                break
    return boxes


def find_uncovered(
    slabs: list[trimesh.Trimesh],
    boxes: list[trimesh.Trimesh],
    accuracy: float,
) -> list[trimesh.Trimesh]:
    """Return the slabs whose top the boxes do not already reach."""
    if not boxes:
        return slabs
    low = np.min([slab.bounds[0, :2] for slab in slabs], axis=0)
    high = np.max([slab.bounds[1, :2] for slab in slabs], axis=0)
    x, y = (a.ravel() for a in np.meshgrid(*(np.arange(low[i], high[i], _SPACING) for i in range(2))))
    everything, reached = Elevation(*slabs).height(x, y), Elevation(*boxes).height(x, y)
    is_open = np.isfinite(everything) & ~(np.abs(reached - everything) < accuracy)
    kept = []
    for slab in slabs:
        top = Elevation(slab).height(x[is_open], y[is_open])
        is_top = np.abs(top - everything[is_open]) < _ON_TOP
        if is_top.sum() * _SPACING**2 > _MIN_OPEN:
            kept.append(slab)
    return kept


def _find_top(
    corners: Float[np.ndarray, "N 3"],
    normal: Float[np.ndarray, " 3"],
    offset: float,
    area: float,
) -> Float[np.ndarray, "4 3"] | None:
    """Return the corners of the rectangle around a plane's faces, if they fill it."""
    found = find_smallest_rectangle(corners[:, :2], _TRIMMED)
    if found is None or area * normal[2] <= _MIN_FILLED * float(np.prod(found.high - found.low)):
        return None
    (x0, y0), (x1, y1) = found.low, found.high
    rectangle = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ found.axes.T
    return np.column_stack([rectangle, (offset - rectangle @ normal[:2]) / normal[2]])


def _is_beneath(box: trimesh.Trimesh, ground: Elevation, lift: float) -> bool:
    """Return whether a box lifts the ground nowhere but at its rim."""
    x, y = sample_grid(np.asarray(box.bounds), _CHECK_POINTS, margin=0.0).T
    above = Elevation(box).height(x, y) - ground.height(x, y)
    above = above[np.isfinite(above)]
    return len(above) > 0 and float((above > lift).mean()) < _LIFTED


_SCALES = (1.0, 2.0)
"""Planes are looked for within these multiples of the accuracy, until few enough are found."""
_FEW_PLANES = 32
"""Few enough are these: each slab needs one plane or more."""
_SIMILAR_PLANES = 1.25
"""Or no more than this many times those at the coarsest scale."""
_MOST_PLANES = 40
"""A terrain of more planes is rough ground, for which slabs are no model."""
_HELD = 0.7
"""Share of the ground that planes hold; of less, it is rough."""
MAX_SLABS = 64
"""No more slabs than these: beyond, patches follow the ground as well in less time."""
MAX_UNITED = 24
"""No more slabs go to coacd, whose time grows faster, or have their seams closed: that compares every one with
all others."""
MAX_PARTS = 16
"""Slabs are not cut at creases into more parts than these."""


def find_few_planes(
    top: trimesh.Trimesh,
    accuracy: float,
    is_exceeded: Callable[[], bool],
) -> tuple[Planes, float]:
    """Return the finest planes that are few enough, or about as few as coarser ones, and their tolerance [m].

    Regions that lie apart on one plane share it.
    """
    found: list[tuple[Planes, float]] = []
    for scale in _SCALES:
        planes = find_planes(top, scale * accuracy, is_exceeded=is_exceeded)
        if len(planes.normals) <= _MOST_PLANES:
            planes = share_planes(top, planes, accuracy)
        found.append((planes, scale * accuracy))
        if len(planes.normals) <= _FEW_PLANES or is_exceeded():
            return found[-1]
    fewest = min(len(planes.normals) for planes, _ in found)
    return next(pair for pair in found if len(pair[0].normals) <= _SIMILAR_PLANES * fewest)


def is_smooth(top: trimesh.Trimesh, planes: Planes) -> bool:
    """Return whether a few planes hold most of a terrain."""
    areas = top.area_faces
    held = float(areas[planes.labels >= 0].sum() / areas.sum())
    return held >= _HELD and 0 < len(planes.normals) <= _MOST_PLANES
