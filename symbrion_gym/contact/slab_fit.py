"""Slabs fitted to rough ground: where planes are not enough, caps are fitted to the heights themselves.

The slab with the largest error is cut along the best of many lines, and a concave cap, a minimum of affine
functions, is fitted to either side, until the ground is met or the number of pieces is used up.

References:
    Magnani, Boyd (2009), Convex piecewise-linear fitting, section 3: assign every point to the plane that is
    lowest there, fit each plane to its points, repeat.
    Breiman et al. (1984), Classification and regression trees: greedy cuts, the worst leaf first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.outlines import cap_prism, cut_outline, find_inside, outline_bounds
from symbrion_gym.contact.slabs import Slab, make_grid

_MAX_CAPS = 6
_MAX_GAP = 0.05
"""A point counts as no farther than this from its cap [m]: walls must not bend the ground."""
_SEARCH_POINTS = 300
_DIRECTIONS = 8


@dataclass(frozen=True)
class Patch:
    """A convex part of the plan with a cap fitted to the ground.

    Attributes:
        outline: `[P, 2]` convex, counter-clockwise [m].
        members: `[M]` the points whose ground it is.
        caps: `[K, 3]` slopes and height: the top is the minimum of a x + b y + c.
        error: sum of the distances of its points from the top [m].
    """

    outline: np.ndarray
    members: np.ndarray
    caps: np.ndarray
    error: float


def fit_slabs(
    mesh: trimesh.Trimesh,
    slabs: list[Slab],
    levels: np.ndarray,
    accuracy: float,
    max_pieces: int,
    thickness: float,
    is_late: Callable[[], bool],
) -> list[trimesh.Trimesh]:
    """Fit slabs to the heights of a mesh and cut them further, the worst first.

    Args:
        mesh: open terrain, normals up.
        slabs: to start from.
        levels: `[R, 3]` the planes that the slabs name, as a x + b y + c.
        accuracy: mean distance that is good enough [m].
        max_pieces: no more than these.
        thickness: how far the solids reach below the lowest ground [m].
        is_late: asked now and then; once true, cutting ends.
    """
    points, _ = make_grid(mesh, 30000)
    heights = Elevation(mesh).height(points[:, 0], points[:, 1])
    is_there = np.isfinite(heights)
    ground = np.column_stack([points, heights])[is_there]
    patches = _share_out(ground, slabs, levels)
    patches = [_refit(ground, patch) for patch in patches]
    closed: set[int] = set()
    while len(patches) < max_pieces and not is_late():
        if sum(patch.error for patch in patches) < 0.5 * accuracy * len(ground):
            break
        candidates = [i for i in range(len(patches)) if id(patches[i]) not in closed]
        if not candidates:
            break
        worst = max(candidates, key=lambda i: patches[i].error)
        parts = _cut(ground, patches[worst])
        if parts is None:
            closed.add(id(patches[worst]))
        else:
            patches[worst : worst + 1] = parts
    bottom = float(mesh.vertices[:, 2].min()) - thickness
    solids = [_make_solid(patch, bottom) for patch in patches]
    return [solid for solid in solids if solid is not None]


def _share_out(ground: np.ndarray, slabs: list[Slab], levels: np.ndarray) -> list[Patch]:
    """Every point to the slab that is the ground there: the highest of those above it in plan."""
    tops = np.full((len(slabs), len(ground)), -np.inf)
    for i, slab in enumerate(slabs):
        inside = find_inside(slab.outline, ground[:, :2])
        tops[i, inside] = _top(levels[slab.planes], ground[inside])
    owner = np.argmax(tops, axis=0)
    owner[np.isneginf(tops.max(axis=0))] = -1
    patches = []
    for i, slab in enumerate(slabs):
        members = np.flatnonzero(owner == i)
        caps = levels[slab.planes]
        patches.append(Patch(slab.outline, members, caps, _error(caps, ground[members])))
    return patches


def _refit(ground: np.ndarray, patch: Patch) -> Patch:
    """The patch with a fitted cap, where that is much closer and lifts no other ground."""
    if len(patch.members) < 12:
        return patch
    points = ground[patch.members]
    sample = points[:: max(len(points) // 2000, 1)]
    caps = _fit_caps(sample, patch.caps)
    error = _error(caps, points)
    if error > 0.8 * patch.error:
        return patch
    is_other = find_inside(patch.outline, ground[:, :2])
    is_other[patch.members] = False
    lifted = _top(caps, ground[is_other]) > ground[is_other, 2] + 0.005
    return patch if lifted.sum() > 0.01 * len(points) else Patch(patch.outline, patch.members, caps, error)


def _cut(ground: np.ndarray, patch: Patch) -> list[Patch] | None:
    """The patch in two along the line that leaves the smallest error; None where none helps."""
    if len(patch.members) < 40:
        return None
    points = ground[patch.members]
    sample = points[:: max(len(points) // _SEARCH_POINTS, 1)]
    best, least = None, np.inf
    for angle in np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS:
        normal = np.array([np.cos(angle), np.sin(angle)])
        along = sample[:, :2] @ normal
        for offset in np.quantile(along, [0.15, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85]):
            sides = [sample[along <= offset], sample[along > offset]]
            if min(len(side) for side in sides) < 10:
                continue
            error = sum(_error(_fit_plane(side), side) for side in sides)
            if error < least:
                best, least = np.append(normal, offset), error
    if best is None:
        return None
    is_left = points[:, :2] @ best[:2] <= best[2]
    parts = []
    for side, line in ((is_left, best), (~is_left, -best)):
        outline = cut_outline(patch.outline, line)
        if outline is None:
            return None
        members = patch.members[side]
        caps = _fit_caps(ground[members][:: max(len(members) // 1000, 1)], None)
        part = Patch(outline, members, caps, _error(caps, ground[members]))
        kept = _error(patch.caps, ground[members])
        parts.append(part if part.error < kept else Patch(outline, members, patch.caps, kept))
    return parts if parts[0].error + parts[1].error < 0.97 * patch.error else None


def _fit_caps(points: np.ndarray, start: np.ndarray | None) -> np.ndarray:
    """Affine functions whose minimum follows the points: one, two, then more while that helps."""
    best = _fit_plane(points)
    least = _error(best, points)
    starts = [] if start is None else [start]
    for count in (2, 3, _MAX_CAPS):
        if len(points) >= 12 * count:
            starts.append(_spread_caps(points, count))
    for caps in starts:
        for _ in range(8):
            owner = np.argmin(points[:, :2] @ caps[:, :2].T + caps[:, 2], axis=1)
            used = [k for k in range(len(caps)) if (owner == k).sum() >= 8]
            if not used:
                break
            caps = np.concatenate([_fit_plane(points[owner == k]) for k in used])
        error = _error(caps, points)
        if error < 0.93 * least:
            best, least = caps, error
    return best


def _spread_caps(points: np.ndarray, count: int) -> np.ndarray:
    """Planes of parts of about one size, side by side along the longest extent."""
    center = points[:, :2] - points[:, :2].mean(axis=0)
    along = center @ np.linalg.eigh(center.T @ center)[1][:, -1]
    part = np.minimum((np.argsort(np.argsort(along)) * count) // len(points), count - 1)
    return np.concatenate([_fit_plane(points[part == k]) for k in range(count)])


def _fit_plane(points: np.ndarray) -> np.ndarray:
    """Robust affine function through points `[M, 3]`, `[1, 3]`."""
    center = points.mean(axis=0)
    local = points - center
    weights = np.ones(len(points))
    slope = np.zeros(3)
    for _ in range(3):
        design = np.column_stack([local[:, :2], np.ones(len(points))])
        normal = (design.T * weights) @ design + 1e-6 * len(points) * np.diag([1e-3, 1e-3, 0.0])
        slope = np.linalg.lstsq(normal, (design.T * weights) @ local[:, 2], rcond=None)[0]
        weights = 1.0 / np.maximum(np.abs(local[:, 2] - design @ slope) / 0.01, 1.0)
    return np.array([[slope[0], slope[1], slope[2] + center[2] - slope[:2] @ center[:2]]])


def _top(caps: np.ndarray, points: np.ndarray) -> np.ndarray:
    return (points[:, :2] @ caps[:, :2].T + caps[:, 2]).min(axis=1)


def _error(caps: np.ndarray, points: np.ndarray) -> float:
    return (
        float(np.minimum(np.abs(_top(caps, points) - points[:, 2]), _MAX_GAP).sum()) if len(points) else 0.0
    )


def _make_solid(patch: Patch, bottom: float) -> trimesh.Trimesh | None:
    normals = np.column_stack([-patch.caps[:, :2], np.ones(len(patch.caps))])
    size = np.linalg.norm(normals, axis=1)
    return cap_prism(outline_bounds(patch.outline), normals / size[:, None], patch.caps[:, 2] / size, bottom)
