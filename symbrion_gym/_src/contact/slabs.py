"""A terrain as few convex slabs: cut where it is hollow, cap each part by a minimum of planes.

Seen from above, the terrain is cut by vertical planes into convex cells (a binary space partition). In a
cell the ground is the minimum of the planes found there, so the cell with everything beneath it is one convex
solid. Cuts are tried along hollow creases (where two planes meet below both) and along steps, in any
direction. Cells that one cap serves as well are joined again, also where the joint runs beneath other ground.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Float32, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import STEEP, make_prism
from reconstruction._src.geometry.outlines import (
    compute_bounds,
    compute_hull_outline,
    find_outline,
    is_within,
    measure_area,
)
from reconstruction._src.geometry.sampling import sample_cells
from symbrion_gym._src.contact.planes import Planes

_CREASE_REACH = 3.0  # A crease lies this close to the edges where its planes touch, in median edges
_STEP_REACH = 2.0  # Likewise, the points of a step
_ROUNDS = 6  # Number of rounds of robust line fits
_LEAST_CROSSING = 0.01
"""Planes that meet at a smaller angle (sine, in plan) have no line in plan that is worth its noise."""
_SAME_LINE = 1e-4  # Lines whose coefficients differ by less are one
_LEAST_GAP = 1e-6  # Keeps the scale of a robust fit above zero [m]


def find_crease_lines(mesh: trimesh.Trimesh, planes: Planes) -> Float[np.ndarray, "C 3"]:
    """Find lines in plan (a x + b y = c) along which the terrain may be cut: walls, creases, steps."""
    labels = _fill_labels(mesh, planes.labels)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    sides = np.sort(labels[pairs], axis=1)
    is_contact = (sides[:, 0] != sides[:, 1]) & (sides[:, 0] >= 0)
    middles = np.asarray(mesh.vertices)[np.asarray(mesh.face_adjacency_edges).reshape(-1, 2)].mean(axis=1)
    edge_length = float(np.median(mesh.edges_unique_length))
    lines = [_find_wall(mesh, planes, int(k)) for k in np.flatnonzero(planes.normals[:, 2] < STEEP)]
    for first, second in np.unique(sides[is_contact], axis=0):
        contact = middles[is_contact & (sides[:, 0] == first) & (sides[:, 1] == second)]
        crease = _find_crease(planes, first, second, contact, _CREASE_REACH * edge_length)
        lines += [] if crease is None else [crease]
        if min(planes.normals[first, 2], planes.normals[second, 2]) >= STEEP:
            points = _find_step(mesh, planes, first, second, (labels == first) | (labels == second))
            distance, _ = cKDTree(contact[:, :2]).query(points)
            points = points[distance < _STEP_REACH * edge_length]
            lines += [_fit_line(points)] if len(points) >= 3 else []
    return _drop_repeated(lines)


def _fill_labels(mesh: trimesh.Trimesh, labels: Int[np.ndarray, " F"]) -> Int[np.ndarray, " F"]:
    """Give every face without a plane the label of the nearest face that has one, in steps over edges."""
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    labels = labels.copy()
    while True:
        is_next = (labels[pairs[:, 0]] >= 0) & (labels[pairs[:, 1]] < 0)
        if not is_next.any():
            return labels
        labels[pairs[is_next, 1]] = labels[pairs[is_next, 0]]


def _find_wall(mesh: trimesh.Trimesh, planes: Planes, wall: int) -> Float[np.ndarray, " 3"]:
    """Return the line of a wall at its mean height, where neither foot nor rim is rounded."""
    areas = np.where(planes.labels == wall, mesh.area_faces, 0.0)
    height = areas @ np.asarray(mesh.triangles_center)[:, 2] / areas.sum()
    normal = planes.normals[wall]
    return np.append(normal[:2], planes.offsets[wall] - normal[2] * height) / np.hypot(normal[0], normal[1])


def _find_crease(
    planes: Planes, first: int, second: int, contact: Float[np.ndarray, "N 3"], reach: float
) -> Float[np.ndarray, " 3"] | None:
    """Return the line in plan where two planes meet, if that is where their faces meet."""
    normals, offsets = planes.normals[[first, second]], planes.offsets[[first, second]]
    # z taken out of n1·p = d1 and n2·p = d2.
    line = np.append(
        normals[0, :2] * normals[1, 2] - normals[1, :2] * normals[0, 2],
        offsets[0] * normals[1, 2] - offsets[1] * normals[0, 2],
    )
    size = np.hypot(line[0], line[1])
    if size < _LEAST_CROSSING:
        return None
    line /= size
    return line if np.median(np.abs(contact[:, :2] @ line[:2] - line[2])) < reach else None


def _find_step(
    mesh: trimesh.Trimesh, planes: Planes, first: int, second: int, is_part: Bool[np.ndarray, " F"]
) -> Float[np.ndarray, "N 2"]:
    """Return the points in plan where edges are half way up from one plane to the other."""
    edges = np.unique(np.sort(mesh.faces[is_part][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    vertices = np.asarray(mesh.vertices)
    heights = [
        (planes.offsets[k] - vertices[:, :2] @ planes.normals[k, :2]) / planes.normals[k, 2]
        for k in (first, second)
    ]
    above = vertices[:, 2] - (heights[0] + heights[1]) / 2
    start, end = above[edges[:, 0]], above[edges[:, 1]]
    is_crossing = start * end < 0
    share = start[is_crossing] / (start[is_crossing] - end[is_crossing])
    a, b = (vertices[edges[is_crossing, i], :2] for i in range(2))
    return a + share[:, None] * (b - a)


def _fit_line(points: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, " 3"]:
    """Fit a line to points: total least squares, far points losing weight."""
    weights = np.ones(len(points))
    line = np.zeros(3)
    for _ in range(_ROUNDS):
        center = weights @ points / weights.sum()
        spread = (points - center).T * weights @ (points - center)
        normal = np.linalg.eigh(spread)[1][:, 0]
        line = np.append(normal, normal @ center)
        gap = np.abs(points @ normal - line[2])
        # About 1.5 medians are a standard deviation of normal noise.
        scale = max(1.5 * float(np.median(gap)), _LEAST_GAP)
        weights = 1.0 / np.maximum(gap / scale, 1.0) ** 2
    return line


def _drop_repeated(lines: list[np.ndarray]) -> Float[np.ndarray, "D 3"]:
    kept: list[np.ndarray] = []
    for line in lines:
        signs = [np.sign(other[:2] @ line[:2]) or 1.0 for other in kept]
        if all(np.abs(line - s * other).max() > _SAME_LINE for s, other in zip(signs, kept, strict=True)):
            kept.append(line)
    return np.array(kept).reshape(-1, 3)


_THICKNESS = 0.2  # How far slabs reach below the lowest ground [m]
_NUM_POINTS = 30_000  # About how many points of the ground are looked at
_MAX_PLANES = 24  # Planes that a cap is selected from, those with the most ground first
_MAX_PAIRS_OF = 24  # Slabs tried in every pair; of more, only neighbors and those with a common plane
_MAX_CELLS = 4.0  # Cutting ends at this many times the pieces that are wanted: joining leaves fewer
_MIN_GAIN = 0.98  # A cut must leave this share, or less, of the pairs of points that one cap does not serve
_ALLOWED_POINTS = 8.0  # This number of points may lie farther off than the accuracy: single spikes
_ALLOWED_SHARE = 1e-3  # ... or this share of a cell's points.
_JOIN_ACCURACY = 0.5  # Slabs are joined within this share of the accuracy
_MAX_LIFT = 0.5  # A joint may lie above other ground by this share of the accuracy it is joined within
_EVERYWHERE = np.zeros((0, 3))  # Bounds of a cell without any
_MAX_UNCOVERED = 0.02  # Share of a joint that may be without ground, beyond what its parts have
_PREVIEW_POINTS = 250  # Points of a joint on which a hopeless one is recognized
_PREVIEW_SLACK = 2.0  # A joint is hopeless where its error on them is this many times too large
_NEIGHBOR_REACH = 3.0  # Slabs this close are neighbors, in spacings of the points


def _allow(num_points: int) -> float:
    """Return the weight of points, of a number, that may lie farther off than the accuracy."""
    return max(_ALLOWED_POINTS, _ALLOWED_SHARE * num_points)


class Ground(NamedTuple):
    """The terrain on a grid seen from above, noise taken out."""

    points: Float[np.ndarray, "N 2"]  # (x, y) [m]
    heights: Float[np.ndarray, " N"]  # height of the plane there, or of the mesh where there is no plane [m]
    levels: Float[np.ndarray, "N R"]  # height of every plane there [m]; +inf for walls
    labels: Int[np.ndarray, " N"]  # the plane whose ground this is, -1 for none
    weights: Float[np.ndarray, " N"]  # how much it counts: 0 on walls and chamfers
    spacing: float  # distance of the grid's points [m]


@dataclass(frozen=True)
class Cell:
    """A convex part of the plan and the planes that cap it."""

    bounds: Float[np.ndarray, "B 3"]  # lines (a, b, c): inside is a x + b y <= c
    members: Int[np.ndarray, " M"]  # the ground's points in it
    planes: Int[np.ndarray, " K"]  # the planes whose minimum is its top
    error: float = 0.0  # sum of the weighted distances of its points from the top [m]
    excess: float = 0.0  # weight of its points farther than the accuracy from the top


@dataclass(frozen=True)
class Slab:
    """A cell with an outline of its own; slabs may run beneath one another."""

    outline: Float[np.ndarray, "P 2"]  # convex, counter-clockwise [m]
    members: Int[np.ndarray, " M"]  # the ground's points whose ground it is
    planes: Int[np.ndarray, " K"]  # the planes whose minimum is its top
    error: float  # sum of the weighted distances of its points from the top [m]
    excess: float  # weight of its points farther than the accuracy from the top
    uncovered: float  # area of the outline without any ground [m²]


def _make_ground(mesh: trimesh.Trimesh, elevation: Elevation, planes: Planes) -> Ground:
    """Measure the mesh from above on a grid; `elevation` is that of the mesh."""
    low, high = mesh.bounds[:, :2]
    spacing = float(np.sqrt(np.prod(high - low) / _NUM_POINTS))
    points = sample_cells(low, high, spacing).reshape(-1, 2)
    heights, faces = elevation.find_top(points[:, 0], points[:, 1])
    is_there = faces >= 0
    points, heights, labels = points[is_there], heights[is_there], planes.labels[faces[is_there]]
    is_wall = planes.normals[:, 2] < STEEP
    rise = np.where(is_wall, 1.0, planes.normals[:, 2])
    levels = (planes.offsets - points @ planes.normals[:, :2].T) / rise
    levels[:, is_wall] = np.inf
    is_ground = (labels >= 0) & ~np.append(is_wall, True)[labels]
    heights = np.where(is_ground, levels[np.arange(len(labels)), labels], heights)
    weights = np.where(is_ground, 1.0, 0.0)
    return Ground(points, heights, levels, np.where(is_ground, labels, -1), weights, spacing)


def make_slabs(
    mesh: trimesh.Trimesh, elevation: Elevation, planes: Planes, accuracy: float, max_pieces: int
) -> list[trimesh.Trimesh]:
    """Return convex solids whose union has the terrain as its top; none where there are no planes."""
    ground = _make_ground(mesh, elevation, planes)
    cells = _split(ground, find_crease_lines(mesh, planes), accuracy, max_pieces)
    slabs = [slab for cell in cells if (slab := _make_slab(mesh, ground, cell)) is not None]
    slabs = _merge(ground, slabs, _JOIN_ACCURACY * accuracy)
    bottom = float(mesh.vertices[:, 2].min()) - _THICKNESS
    tops = np.column_stack([planes.normals, -planes.offsets])
    solids = [make_prism(compute_bounds(slab.outline), tops[slab.planes], bottom) for slab in slabs]
    return [solid for solid in solids if solid is not None]


def _split(ground: Ground, lines: Float[np.ndarray, "C 3"], accuracy: float, max_pieces: int) -> list[Cell]:
    """Cut the worst cell along its best line until every cap is accurate or no cut helps."""
    above = ground.heights[:, None] > ground.levels + accuracy
    clashes = (above * ground.weights[:, None]).astype(np.float32)
    everything = _cap(ground, _EVERYWHERE, np.arange(len(ground.points)), accuracy)
    most = _MAX_CELLS * max_pieces
    done, open_cells = [], [everything]
    while open_cells and len(done) + len(open_cells) < most:
        worst = max(range(len(open_cells)), key=lambda i: open_cells[i].error)
        cell = open_cells.pop(worst)
        line = None
        if cell.excess > _allow(len(cell.members)):
            line = _find_best_line(ground, clashes, cell, lines)
        if line is None:
            done.append(cell)
            continue
        is_left = ground.points[cell.members] @ line[:2] <= line[2]
        for side, bound in ((is_left, line), (~is_left, -line)):
            bounds = np.concatenate([cell.bounds, bound[None]])
            open_cells.append(_cap(ground, bounds, cell.members[side], accuracy))
    return done + open_cells


def _find_best_line(
    ground: Ground, clashes: Float32[np.ndarray, "N R"], cell: Cell, lines: Float[np.ndarray, "C 3"]
) -> Float[np.ndarray, " 3"] | None:
    """Return the line that parts the most pairs of points of which one lies above the plane of the other."""
    members = cell.members
    points, labels, clash = ground.points[members], ground.labels[members], clashes[members]
    count = clashes.shape[1]

    def count_pairs(is_side: Bool[np.ndarray, " M"]) -> float:
        owners = labels[is_side]
        return float(np.bincount(owners[owners >= 0], minlength=count) @ clash[is_side].sum(axis=0))

    best, least = None, _MIN_GAIN * count_pairs(np.ones(len(members), dtype=bool))
    for line in lines:
        is_left = points @ line[:2] <= line[2]
        if is_left.all() or not is_left.any():
            continue
        pairs = count_pairs(is_left) + count_pairs(~is_left)
        if pairs < least:
            best, least = line, pairs
    return best


def _cap(
    ground: Ground, bounds: Float[np.ndarray, "B 3"], members: Int[np.ndarray, " M"], accuracy: float
) -> Cell:
    """Select the planes whose minimum lies closest to the ground's points."""
    weights = ground.weights[members]
    heights = ground.heights[members]
    share = np.bincount(ground.labels[members][weights > 0], minlength=ground.levels.shape[1])
    planes = np.flatnonzero(share)
    planes = planes[np.argsort(-share[planes], kind="stable")][:_MAX_PLANES]
    levels = ground.levels[np.ix_(members, planes)]
    is_selected = np.zeros(len(planes), dtype=bool)
    top = np.full(len(members), np.inf)
    error = np.inf
    for k in range(len(planes)):
        lower = np.minimum(top, levels[:, k])
        lower_error = float(np.sum(weights * np.abs(lower - heights)))
        if lower_error < error:
            is_selected[k], top, error = True, lower, lower_error
    gap = np.abs(top - heights)
    excess = float(weights[gap > accuracy].sum()) if is_selected.any() else 0.0
    return Cell(bounds, members, planes[is_selected], error if is_selected.any() else 0.0, excess)


def _merge(ground: Ground, slabs: list[Slab], accuracy: float) -> list[Slab]:
    """Join slabs, best pair first, while one cap serves both and lifts no ground between them."""
    slabs, alive = list(slabs), set(range(len(slabs)))
    joints: dict[tuple[int, int], Slab] = {}
    new = list(combinations(range(len(slabs)), 2))
    while True:
        for i, j in new:
            is_likely = len(alive) <= _MAX_PAIRS_OF or _are_near(slabs[i], slabs[j], ground.spacing)
            if is_likely and (joint := _join(ground, slabs[i], slabs[j], accuracy)) is not None:
                joints[i, j] = joint
        if not joints:
            return [slabs[k] for k in sorted(alive)]
        i, j = min(joints, key=lambda pair: joints[pair].error - sum(slabs[k].error for k in pair))
        slabs.append(joints[i, j])
        alive -= {i, j}
        joints = {pair: joint for pair, joint in joints.items() if alive.issuperset(pair)}
        new = [(k, len(slabs) - 1) for k in sorted(alive)]
        alive.add(len(slabs) - 1)


def _are_near(first: Slab, second: Slab, spacing: float) -> bool:
    """Return whether two slabs touch, by the boxes around them, or share a plane."""
    gap = np.maximum(
        first.outline.min(axis=0) - second.outline.max(axis=0),
        second.outline.min(axis=0) - first.outline.max(axis=0),
    )
    have_common_plane = bool(np.isin(first.planes, second.planes).any())
    return have_common_plane or bool(gap.max() < _NEIGHBOR_REACH * spacing)


def _join(ground: Ground, first: Slab, second: Slab, accuracy: float) -> Slab | None:
    """Return one slab in place of two; None where one cap does not serve both."""
    members = np.concatenate([first.members, second.members])
    allowed = _allow(min(len(first.members), len(second.members)))
    limit = first.excess + second.excess + allowed
    step = max(len(members) // _PREVIEW_POINTS, 1)
    preview = step * _cap(ground, _EVERYWHERE, members[::step], accuracy).excess
    if preview > _PREVIEW_SLACK * limit + 2 * step:
        return None
    outline = compute_hull_outline(np.concatenate([first.outline, second.outline]))
    if outline is None:
        return None
    cell = _cap(ground, _EVERYWHERE, members, accuracy)
    if cell.excess > limit:
        return None
    inside = np.flatnonzero(is_within(outline, ground.points))
    uncovered = measure_area(outline) - len(inside) * ground.spacing**2
    if uncovered > first.uncovered + second.uncovered + _MAX_UNCOVERED * measure_area(outline):
        return None
    is_other = np.ones(len(ground.points), dtype=bool)
    is_other[members] = False
    others = inside[is_other[inside]]
    others = others[ground.weights[others] > 0]
    top = ground.levels[np.ix_(others, cell.planes)].min(axis=1, initial=np.inf)
    if (top > ground.heights[others] + _MAX_LIFT * accuracy).sum() > allowed:
        return None
    return Slab(outline, members, cell.planes, cell.error, cell.excess, uncovered)


def _make_slab(mesh: trimesh.Trimesh, ground: Ground, cell: Cell) -> Slab | None:
    """Return the slab of a cell; None where there is no ground or no plane in it."""
    outline = find_outline(mesh, cell.bounds)
    if outline is None or not len(cell.planes):
        return None
    uncovered = measure_area(outline) - is_within(outline, ground.points).sum() * ground.spacing**2
    return Slab(outline, cell.members, cell.planes, cell.error, cell.excess, float(uncovered))
