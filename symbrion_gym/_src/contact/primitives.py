"""Boxes beneath large planes: the paper's mixed model of primitives and convex pieces (its reference 22)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_smallest_rectangle
from reconstruction._src.geometry.rows import make_hull
from reconstruction._src.geometry.sampling import sample_grid
from symbrion_gym._src.contact.planes import PlaneConfig, Planes, find_planes
from symbrion_gym._src.contact.seams import SharingConfig, share_planes

_ON_TOP = 1e-6
"""A slab is the top where the union of all slabs is no higher than it [m]."""


@dataclass(frozen=True)
class PrimitiveConfig:
    """Which planes become boxes.

    Attributes:
        min_rise: planes whose unit normal rises less are walls, beneath which there is no box.
        trimmed: percentage of corners that may stick out at each side: single triangles that reach over a crease.
        min_filled: share of its rectangle that a plane fills at least.
        depths: boxes tried are this deep [m].
        lift: a box may lift the ground by this many times the accuracy, ...
        lifted: ... and by more at this share of its points: at its rim.
        check_points: points a side of the grid on which that is looked at.
        spacing: spacing of the grid on which slabs are compared with boxes [m].
        min_open: a slab is kept for this much of its top that no box reaches [m²].
    """

    min_rise: float = 0.3
    trimmed: float = 0.5
    min_filled: float = 0.93
    depths: tuple[float, ...] = (0.2, 0.1, 0.05)
    lift: float = 3.0
    lifted: float = 0.02
    check_points: int = 80
    spacing: float = 0.03
    min_open: float = 0.02


PRIMITIVE_DEFAULTS = PrimitiveConfig()


def make_boxes(
    mesh: trimesh.Trimesh,
    ground: Elevation,
    planes: Planes,
    accuracy: float,
    config: PrimitiveConfig = PRIMITIVE_DEFAULTS,
) -> list[trimesh.Trimesh]:
    """Return boxes beneath the planes that fill a rectangle."""
    boxes = []
    for k in np.flatnonzero(planes.normals[:, 2] >= config.min_rise):
        members = planes.labels == k
        corners = np.asarray(mesh.triangles)[members].reshape(-1, 3)
        area = float(mesh.area_faces[members].sum())
        top = _find_top(corners, planes.normals[k], float(planes.offsets[k]), area, config)
        if top is None:
            continue
        for depth in config.depths:
            box = make_hull(np.concatenate([top, top - depth * planes.normals[k]]))
            if box is not None and _is_beneath(box, ground, config.lift * accuracy, config):
                boxes.append(box)
                break
    return boxes


def find_uncovered(
    slabs: list[trimesh.Trimesh],
    boxes: list[trimesh.Trimesh],
    accuracy: float,
    config: PrimitiveConfig = PRIMITIVE_DEFAULTS,
) -> list[trimesh.Trimesh]:
    """Return the slabs whose top the boxes do not already reach."""
    if not boxes:
        return slabs
    low = np.min([slab.bounds[0, :2] for slab in slabs], axis=0)
    high = np.max([slab.bounds[1, :2] for slab in slabs], axis=0)
    x, y = (a.ravel() for a in np.meshgrid(*(np.arange(low[i], high[i], config.spacing) for i in range(2))))
    everything, reached = Elevation(*slabs).height(x, y), Elevation(*boxes).height(x, y)
    is_open = np.isfinite(everything) & ~(np.abs(reached - everything) < accuracy)
    kept = []
    for slab in slabs:
        top = Elevation(slab).height(x[is_open], y[is_open])
        is_top = np.abs(top - everything[is_open]) < _ON_TOP
        if is_top.sum() * config.spacing**2 > config.min_open:
            kept.append(slab)
    return kept


def _find_top(
    corners: Float[np.ndarray, "N 3"],
    normal: Float[np.ndarray, " 3"],
    offset: float,
    area: float,
    config: PrimitiveConfig,
) -> Float[np.ndarray, "4 3"] | None:
    """Return the corners of the rectangle around a plane's faces, if they fill it."""
    found = find_smallest_rectangle(corners[:, :2], config.trimmed)
    if found is None or area * normal[2] <= config.min_filled * float(np.prod(found.high - found.low)):
        return None
    (x0, y0), (x1, y1) = found.low, found.high
    rectangle = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ found.axes.T
    return np.column_stack([rectangle, (offset - rectangle @ normal[:2]) / normal[2]])


def _is_beneath(box: trimesh.Trimesh, ground: Elevation, lift: float, config: PrimitiveConfig) -> bool:
    """Return whether a box lifts the ground nowhere but at its rim."""
    x, y = sample_grid(np.asarray(box.bounds), config.check_points, margin=0.0).T
    above = Elevation(box).height(x, y) - ground.height(x, y)
    above = above[np.isfinite(above)]
    return len(above) > 0 and float((above > lift).mean()) < config.lifted


@dataclass(frozen=True)
class SlabPassConfig:
    """Which terrains become slabs, and what is done with slabs.

    Attributes:
        scales: planes are looked for within these multiples of the accuracy, until few enough are found.
        few_planes: few enough are these: each slab needs one plane or more.
        similar_planes: or no more than this many times those at the coarsest scale.
        most_planes: a terrain of more planes is rough ground, for which slabs are no model.
        held: share of the ground that planes hold; of less, it is rough.
        max_slabs: no more slabs than these: beyond, patches follow the ground as well in less time.
        max_united: no more slabs go to coacd, whose time grows faster, or have their seams closed: that compares
            every one with all others.
        max_parts: slabs are not cut at creases into more parts than these.
        sharing: which regions share a plane.
    """

    scales: tuple[float, ...] = (1.0, 2.0)
    few_planes: int = 32
    similar_planes: float = 1.25
    most_planes: int = 40
    held: float = 0.7
    max_slabs: int = 64
    max_united: int = 24
    max_parts: int = 16
    sharing: SharingConfig = field(default_factory=SharingConfig)


def find_few_planes(
    top: trimesh.Trimesh,
    accuracy: float,
    config: SlabPassConfig,
    plane_config: PlaneConfig,
    is_exceeded: Callable[[], bool],
) -> tuple[Planes, float]:
    """Return the finest planes that are few enough, or about as few as coarser ones, and their tolerance [m].

    Regions that lie apart on one plane share it.
    """
    found: list[tuple[Planes, float]] = []
    for scale in config.scales:
        planes = find_planes(top, scale * accuracy, is_exceeded=is_exceeded, config=plane_config)
        if len(planes.normals) <= config.most_planes:
            planes = share_planes(top, planes, accuracy, config.sharing)
        found.append((planes, scale * accuracy))
        if len(planes.normals) <= config.few_planes or is_exceeded():
            return found[-1]
    fewest = min(len(planes.normals) for planes, _ in found)
    return next(pair for pair in found if len(pair[0].normals) <= config.similar_planes * fewest)


def is_smooth(top: trimesh.Trimesh, planes: Planes, config: SlabPassConfig) -> bool:
    """Return whether a few planes hold most of a terrain."""
    areas = top.area_faces
    held = float(areas[planes.labels >= 0].sum() / areas.sum())
    return held >= config.held and 0 < len(planes.normals) <= config.most_planes
