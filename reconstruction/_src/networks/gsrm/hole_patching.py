"""Close the holes that topology learning leaves; what no sample supports stays open.

References:
    The paper's post-processing closes a triangle at every node with exactly two border edges, until nothing
    changes.
    Differs: whole boundary loops are triangulated at once, best ears first, so that a patch can neither
    pinch a vertex nor use an edge twice.
"""

import itertools

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.geometry.manifold import (
    compute_vertex_normals,
    find_folds,
    find_hinges,
    find_loops,
    group_sides,
)
from reconstruction._src.geometry.rows import Faces, compute_lengths, cross_rows, sum_rows
from reconstruction._src.networks.gsrm.support import MAX_VOID, Support, Units

_MAX_HOLE_EDGES = 24  # Longer boundary loops are the boundary of the surface, not holes
_MAX_TIP_EDGES = 64  # Longer loops are not tested for sharp tips and ridges
_RIM_COSINE = -0.5
"""A loop whose area vector lies against the normals next to it by more than this cosine runs around a piece of
surface and not around a gap in it."""
_MAX_FOLDED = 0.3
"""A patch of which a larger share of the faces is folded back is a second layer of the surface."""
_REVERSED_COST = 10.0
"""Cost of a face that lies against the surface around it; well-shaped faces cost 0.5, slivers 1."""
_MIN_PATCH_COVER = 0.75
"""Likewise for the patches of longer loops, which may reach far: with less, a hole in the data would be
covered."""


def patch_holes(
    units: Units, faces: Faces, support: Support
) -> tuple[Int[np.ndarray, "G 3"], Int[np.ndarray, " D"]]:
    """Triangulate short boundary loops that lie where there are samples; return what is in the way of the others."""
    loops = sorted(loop for loop in find_loops(faces, len(units)) if len(loop) <= _MAX_HOLE_EDGES)
    normals = compute_vertex_normals(units, faces)
    # A loop around a gap in the surface, not around a piece of it, looks where the normals next to it point.
    loops = [loop for loop in loops if _compute_area(units[loop]) @ normals[loop].sum(axis=0) > 0]
    if not loops:
        return faces, np.empty(0, dtype=np.int64)
    neighbors = _find_neighbors(faces, {vertex for loop in loops for vertex in loop})
    costs = _rate_triangles(loops, units, normals)
    patches = [(loop, _triangulate(loop, cost, neighbors)) for loop, cost in zip(loops, costs, strict=True)]
    closed = [np.array(patch) for _, patch in patches if patch]
    blocked = [loop for loop, patch in patches if not patch]
    if closed:
        added = np.concatenate(closed)
        owner = np.repeat(np.arange(len(closed)), [len(patch) for patch in closed])
        void = np.bincount(owner, support.measure_void(units[added]))
        patched = np.concatenate([faces, added[void[owner] <= MAX_VOID]])
    else:
        patched = faces
    return patched, _find_obstacles(faces, blocked)


def close_tips(units: Units, faces: Faces, support: Support) -> Int[np.ndarray, "G 3"]:
    """Close what is left of longer holes, and of sharp tips and ridges, whose two sides face apart."""
    loops = sorted(loop for loop in find_loops(faces, len(units)) if len(loop) <= _MAX_TIP_EDGES)
    if not loops:
        return faces
    normals = compute_vertex_normals(units, faces)
    normals /= np.maximum(compute_lengths(normals)[..., None], 1e-300)
    loops = [loop for loop in loops if _compute_outlook(units[loop], normals[loop]) > _RIM_COSINE]
    neighbors = _find_neighbors(faces, {vertex for loop in loops for vertex in loop})
    added = []
    for loop in loops:
        costs = _rate_triangles([loop], units, normals)[0]
        patch = np.array(_triangulate(loop, costs, neighbors))
        if len(patch) == 0:
            continue
        void = support.measure_void(units[patch], _MIN_PATCH_COVER).sum()
        if void <= MAX_VOID and not _is_second_layer(units, faces, loop, patch):
            added.append(patch)
    return np.concatenate([faces, *added])


def _is_second_layer(units: Units, faces: Faces, loop: list[int], patch: Int[np.ndarray, "P 3"]) -> bool:
    """Return whether more than a share of a patch's faces is folded back onto the surface next to its loop."""
    adjacent = faces[np.isin(faces, loop).sum(axis=1) >= 2]
    around = np.concatenate([adjacent, patch])
    hinges = find_hinges(around, group_sides(around, len(units)))
    folded = find_folds(units, around, hinges, np.arange(len(around), 0.0, -1))
    return bool((folded >= len(adjacent)).sum() > _MAX_FOLDED * len(patch))


def _compute_outlook(positions: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]) -> float:
    """Return the cosine between a loop's area vector and the normals next to it, less where these differ."""
    area = _compute_area(positions)
    return float(area @ normals.mean(axis=0) / max(float(np.linalg.norm(area)), 1e-300))


def _compute_area(positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " 3"]:
    """Return twice the area vector of a loop."""
    offset = positions - positions[0]
    return cross_rows(offset[1:-1], offset[2:]).sum(axis=0)


def _find_obstacles(faces: Faces, loops: list[list[int]]) -> Int[np.ndarray, " D"]:
    """Return the faces that join corners of one loop across it; else those around the loop."""
    obstacles = []
    for loop in loops:
        is_near = np.isin(faces, loop)
        near = np.flatnonzero(is_near.sum(axis=1) >= 2)
        sides = {frozenset(pair) for pair in zip(loop, [*loop[1:], loop[0]], strict=True)}
        members = set(loop)
        across = [
            index
            for index, face in zip(near.tolist(), faces[near].tolist(), strict=True)
            if any(
                a in members and b in members and frozenset((a, b)) not in sides
                for a, b in zip(face, [*face[1:], face[0]], strict=True)
            )
        ]
        obstacles.extend(across or near.tolist())
    return np.unique(np.array(obstacles, dtype=np.int64))


def _find_neighbors(faces: Faces, wanted: set[int]) -> dict[int, set[int]]:
    near = faces[np.isin(faces, np.array(sorted(wanted))).any(axis=1)]
    neighbors: dict[int, set[int]] = {vertex: set() for vertex in wanted}
    for face in near.tolist():
        for vertex in face:
            if vertex in neighbors:
                neighbors[vertex].update(face)
    return neighbors


def _triangulate(
    loop: list[int], costs: list[list[list[float]]], neighbors: dict[int, set[int]]
) -> list[tuple[int, int, int]]:
    """Find the triangulation of a loop with the best-shaped faces, by dynamic programming.

    No face may use an existing edge as an inner one; faces that lie against the surface around them are
    taken only where nothing else closes the loop, and a loop that needs nothing but those stays open.
    """
    size = len(loop)
    is_chord = [[other not in neighbors[vertex] for other in loop] for vertex in loop]
    is_chord[0][size - 1] = True
    best = {(i, i + 1): (0.0, -1) for i in range(size - 1)}
    for gap in range(2, size):
        for i in range(size - gap):
            k = i + gap
            options = [
                (best[i, j][0] + best[j, k][0] + costs[i][j][k], j)
                for j in range(i + 1, k)
                if best[i, j][0] + best[j, k][0] < np.inf
            ]
            best[i, k] = min(options) if options and is_chord[i][k] else (np.inf, -1)
    if best[0, size - 1][0] >= _REVERSED_COST * (size - 2):
        return []
    faces, stack = [], [(0, size - 1)]
    while stack:
        i, k = stack.pop()
        j = best[i, k][1]
        if j >= 0:
            faces.append((loop[i], loop[j], loop[k]))
            stack.extend([(i, j), (j, k)])
    return faces


def _rate_triangles(loops: list[list[int]], units: Units, normals: Units) -> list:
    """Return for every loop the cost of the triangles between its n corners, `[n, n, n]`.

    A triangle costs the cosine of its smallest angle, and a constant more where it lies against the normals
    of its corners.
    """
    rated: list = [None] * len(loops)
    for size in {len(loop) for loop in loops}:
        places = [place for place, loop in enumerate(loops) if len(loop) == size]
        corners = np.array([loops[place] for place in places])
        positions, up = units[corners], normals[corners]
        i, j, k = np.array(list(itertools.combinations(range(size), 3))).T
        side, other = positions[:, j] - positions[:, i], positions[:, k] - positions[:, i]
        squared = np.stack([sum_rows(side**2), sum_rows(other**2), sum_rows((other - side) ** 2)])
        squared.sort(axis=0)
        cosine = (squared[1] + squared[2] - squared[0]) / np.maximum(
            2 * np.sqrt(squared[1] * squared[2]), 1e-300
        )
        outlook = sum_rows(cross_rows(side, other) * (up[:, i] + up[:, j] + up[:, k]))
        costs = np.zeros((len(places), size, size, size))
        costs[:, i, j, k] = np.where(outlook > 0, cosine, cosine + _REVERSED_COST)
        for place, cost in zip(places, costs.tolist(), strict=True):
            rated[place] = cost
    return rated
