"""A terrain as few convex slabs: cut where it is hollow, cap each part by a minimum of planes.

Seen from above, the terrain is cut by vertical planes into convex cells (a binary space partition). In a
cell the ground is the minimum of the planes found there, so the cell with everything beneath it is one convex
solid. Cuts are tried along hollow creases (where two planes meet below both) and along steps, in any
direction. Cells that one cap serves as well are joined again, also where the joint runs beneath other ground.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import trimesh

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.outlines import (
    cap_prism,
    find_inside,
    find_outline,
    hull_2d,
    outline_bounds,
    polygon_area,
)
from symbrion_gym.contact.crease_lines import find_crease_lines
from symbrion_gym.contact.planes import Planes

_FEW = 24
"""So many slabs are tried in every pair; of more, only neighbours and those with a plane in common."""
STEEP = 0.34
"""A plane whose normal rises less than this (70 degrees) is a wall: it bounds, but carries no samples."""


class Ground(NamedTuple):
    """The terrain on a grid seen from above, noise taken out.

    Attributes:
        points: `[N, 2]` (x, y) [m].
        heights: `[N]` height of the plane there, or of the mesh where there is no plane [m].
        levels: `[N, R]` height of every plane there [m]; +inf for walls.
        labels: `[N]` the plane whose ground this is, -1 for none.
        weights: `[N]` how much it counts: 0 on walls and chamfers.
        spacing: distance of the grid's points [m].
    """

    points: np.ndarray
    heights: np.ndarray
    levels: np.ndarray
    labels: np.ndarray
    weights: np.ndarray
    spacing: float


@dataclass(frozen=True)
class Cell:
    """A convex part of the plan and the planes that cap it.

    Attributes:
        bounds: `[B, 3]` lines (a, b, c): inside is a x + b y <= c.
        members: `[M]` the ground's points in it.
        planes: `[K]` the planes whose minimum is its top.
        error: sum of the weighted distances of its points from the top [m].
        excess: weight of its points farther than the accuracy from the top.
    """

    bounds: np.ndarray
    members: np.ndarray
    planes: np.ndarray
    error: float = 0.0
    excess: float = 0.0


@dataclass(frozen=True)
class Slab:
    """A cell with an outline of its own; slabs may run beneath one another.

    Attributes:
        outline: `[P, 2]` convex, counter-clockwise [m].
        members: `[M]` the ground's points whose ground it is.
        planes: `[K]` the planes whose minimum is its top.
        error: sum of the weighted distances of its points from the top [m].
        excess: weight of its points farther than the accuracy from the top.
        uncovered: area of the outline without any ground [m²].
    """

    outline: np.ndarray
    members: np.ndarray
    planes: np.ndarray
    error: float
    excess: float
    uncovered: float


def make_grid(mesh: trimesh.Trimesh, num_points: int) -> tuple[np.ndarray, float]:
    """Return about `num_points` points (x, y) over the box around a mesh, `[N, 2]`, and their spacing [m]."""
    low, high = mesh.bounds[:, :2]
    spacing = float(np.sqrt(np.prod(high - low) / num_points))
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2), spacing


def make_ground(mesh: trimesh.Trimesh, planes: Planes, num_points: int = 30000) -> Ground:
    """Look at the mesh from above on a grid of about `num_points`."""
    points, spacing = make_grid(mesh, num_points)
    heights, faces = Elevation(mesh).find_top(points[:, 0], points[:, 1])
    is_there = faces >= 0
    points, heights, faces = points[is_there], heights[is_there], faces[is_there]
    labels = np.asarray(planes.labels[faces])
    is_wall = planes.normals[:, 2] < STEEP
    rise = np.where(is_wall, 1.0, planes.normals[:, 2])
    levels = (planes.offsets - points @ planes.normals[:, :2].T) / rise
    levels[:, is_wall] = np.inf
    is_ground = (labels >= 0) & ~np.append(is_wall, True)[labels]
    heights = np.where(is_ground, levels[np.arange(len(labels)), labels], heights)
    weights = np.where(is_ground, 1.0, 0.0)
    return Ground(points, heights, levels, np.where(is_ground, labels, -1), weights, spacing)


def make_slabs(
    mesh: trimesh.Trimesh,
    planes: Planes,
    accuracy: float,
    max_pieces: int,
    thickness: float,
    is_late: Callable[[], bool] = lambda: False,
) -> tuple[list[Slab], list[trimesh.Trimesh]]:
    """Return convex slabs, and solids, whose union has the terrain as its top; none where there are no planes.

    Args:
        mesh: open terrain, normals up.
        planes: what `find_planes` found in it.
        accuracy: distance between cap and ground that is good enough [m].
        max_pieces: no more than these.
        thickness: how far the solids reach below the lowest ground [m].
        is_late: asked now and then; once true, cutting and joining end where they are.
    """
    if not len(planes.normals):
        return [], []
    ground = make_ground(mesh, planes)
    cells = _split(ground, find_crease_lines(mesh, planes, STEEP), accuracy, max_pieces, is_late)
    slabs = [slab for cell in cells if (slab := _make_slab(mesh, ground, cell)) is not None]
    slabs = _merge(ground, slabs, accuracy / 2, is_late)
    bottom = float(mesh.vertices[:, 2].min()) - thickness
    solids = [_make_solid(planes, slab, bottom) for slab in slabs]
    return slabs, [solid for solid in solids if solid is not None]


def _split(
    ground: Ground, lines: np.ndarray, accuracy: float, max_pieces: int, is_late: Callable[[], bool]
) -> list[Cell]:
    """Cut the worst cell along its best line until every cap is accurate or no cut helps."""
    above = ground.heights[:, None] > ground.levels + accuracy
    clashes = (above * ground.weights[:, None]).astype(np.float32)
    everything = _cap(ground, np.zeros((0, 3)), np.arange(len(ground.points)), accuracy)
    done, open_cells = [], [everything]
    while open_cells and len(done) + len(open_cells) < 4 * max_pieces and not is_late():
        worst = max(range(len(open_cells)), key=lambda i: open_cells[i].error)
        cell = open_cells.pop(worst)
        line = (
            _find_best_line(ground, clashes, cell, lines) if cell.excess > _allow(len(cell.members)) else None
        )
        if line is None:
            done.append(cell)
            continue
        is_left = ground.points[cell.members] @ line[:2] <= line[2]
        for side, bound in ((is_left, line), (~is_left, -line)):
            bounds = np.concatenate([cell.bounds, bound[None]])
            open_cells.append(_cap(ground, bounds, cell.members[side], accuracy))
    return done + open_cells


def _allow(num_points: int) -> float:
    """Weight that may lie farther off than the accuracy: a few points, or one in a thousand."""
    return max(8.0, 1e-3 * num_points)


def _find_best_line(ground: Ground, clashes: np.ndarray, cell: Cell, lines: np.ndarray) -> np.ndarray | None:
    """The line that parts the most pairs of points of which one lies above the plane of the other."""
    members = cell.members
    points, labels, clash = ground.points[members], ground.labels[members], clashes[members]
    count = clashes.shape[1]

    def count_pairs(is_side: np.ndarray) -> float:
        owners = labels[is_side]
        return float(np.bincount(owners[owners >= 0], minlength=count) @ clash[is_side].sum(axis=0))

    best, least = None, 0.98 * count_pairs(np.ones(len(members), dtype=bool))
    for line in lines:
        is_left = points @ line[:2] <= line[2]
        if is_left.all() or not is_left.any():
            continue
        pairs = count_pairs(is_left) + count_pairs(~is_left)
        if pairs < least:
            best, least = line, pairs
    return best


def _cap(ground: Ground, bounds: np.ndarray, members: np.ndarray, accuracy: float) -> Cell:
    """Choose the planes whose minimum lies closest to the ground's points."""
    weights = ground.weights[members]
    heights = ground.heights[members]
    share = np.bincount(ground.labels[members][weights > 0], minlength=ground.levels.shape[1])
    planes = np.flatnonzero(share)
    planes = planes[np.argsort(-share[planes], kind="stable")][:24]
    levels = ground.levels[np.ix_(members, planes)]
    chosen = np.zeros(len(planes), dtype=bool)
    top = np.full(len(members), np.inf)
    error = np.inf
    for k in range(len(planes)):
        lower = np.minimum(top, levels[:, k])
        lower_error = float(np.sum(weights * np.abs(lower - heights)))
        if lower_error < error:
            chosen[k], top, error = True, lower, lower_error
    gap = np.abs(top - heights)
    excess = float(weights[gap > accuracy].sum()) if chosen.any() else 0.0
    return Cell(bounds, members, planes[chosen], error if chosen.any() else 0.0, excess)


def _merge(ground: Ground, slabs: list[Slab], accuracy: float, is_late: Callable[[], bool]) -> list[Slab]:
    """Join slabs, best pair first, while one cap serves both and lifts no ground between them."""
    slabs = list(slabs)
    joints: dict[tuple[int, int], Slab] = {}
    alive = set(range(len(slabs)))
    new, far = list(combinations(range(len(slabs)), 2)), []
    while True:
        if len(alive) <= _FEW:
            new, far = new + [pair for pair in far if alive.issuperset(pair)], []
        for i, j in new:
            if is_late():
                break
            if len(alive) > _FEW and not _are_near(slabs[i], slabs[j], 3.0 * ground.spacing):
                far.append((i, j))
            elif (joint := _join(ground, slabs[i], slabs[j], accuracy)) is not None:
                joints[i, j] = joint
        joints = {pair: joint for pair, joint in joints.items() if alive.issuperset(pair)}
        if not joints:
            return [slabs[k] for k in sorted(alive)]
        i, j = min(joints, key=lambda pair: joints[pair].error - sum(slabs[k].error for k in pair))
        alive -= {i, j}
        slabs.append(joints[i, j])
        new = [(k, len(slabs) - 1) for k in sorted(alive)]
        alive.add(len(slabs) - 1)


def _are_near(first: Slab, second: Slab, reach: float) -> bool:
    """Whether two slabs touch, to judge by the boxes around them, or share a plane."""
    gap = np.maximum(
        first.outline.min(axis=0) - second.outline.max(axis=0),
        second.outline.min(axis=0) - first.outline.max(axis=0),
    )
    return bool(gap.max() < reach) or not set(first.planes.tolist()).isdisjoint(second.planes.tolist())


def _join(ground: Ground, first: Slab, second: Slab, accuracy: float) -> Slab | None:
    members = np.concatenate([first.members, second.members])
    allowed = _allow(min(len(first.members), len(second.members)))
    limit = first.excess + second.excess + allowed
    step = max(len(members) // 250, 1)
    if step * _cap(ground, first.outline, members[::step], accuracy).excess > 2.0 * limit + 2 * step:
        return None
    outline = hull_2d(np.concatenate([first.outline, second.outline]))
    if outline is None:
        return None
    cell = _cap(ground, outline, members, accuracy)
    if cell.excess > limit:
        return None
    inside = np.flatnonzero(find_inside(outline, ground.points))
    uncovered = polygon_area(outline) - len(inside) * ground.spacing**2
    if uncovered > first.uncovered + second.uncovered + 0.02 * polygon_area(outline):
        return None
    is_other = np.ones(len(ground.points), dtype=bool)
    is_other[members] = False
    others = inside[is_other[inside]]
    others = others[ground.weights[others] > 0]
    top = ground.levels[np.ix_(others, cell.planes)].min(axis=1, initial=np.inf)
    if (top > ground.heights[others] + accuracy / 2).sum() > allowed:
        return None
    return Slab(outline, members, cell.planes, cell.error, cell.excess, uncovered)


def _make_slab(mesh: trimesh.Trimesh, ground: Ground, cell: Cell) -> Slab | None:
    outline = find_outline(mesh, cell.bounds)
    if outline is None or not len(cell.planes):
        return None
    uncovered = polygon_area(outline) - find_inside(outline, ground.points).sum() * ground.spacing**2
    return Slab(outline, cell.members, cell.planes, cell.error, cell.excess, float(uncovered))


def _make_solid(planes: Planes, slab: Slab, bottom: float) -> trimesh.Trimesh | None:
    """The convex solid under the slab's cap, down to the bottom."""
    bounds = outline_bounds(slab.outline)
    return cap_prism(bounds, planes.normals[slab.planes], planes.offsets[slab.planes], bottom)
