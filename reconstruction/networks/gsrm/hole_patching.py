"""Close the holes that topology learning leaves; what no sample supports stays open.

References:
    The paper's post-processing closes a triangle at every node with exactly two border edges, until nothing
    changes.
    Differs: whole boundary loops are triangulated at once, best ears first, so that a patch can neither
    pinch a vertex nor use an edge twice.
"""

import itertools

import numpy as np

from reconstruction.geometry.manifold import find_folds, find_hinges, find_normals, group_sides
from reconstruction.geometry.rows import cross_rows, find_lengths, sum_rows
from reconstruction.networks.gsrm.support import MAX_VOID, WHOLE_COVER, Support

MAX_HOLE_EDGES = 24
"""Longer loops are taken for the true rim."""
MAX_TIP_EDGES = 64
"""Longer loops are not looked at for tips."""
_RIM_COSINE = -0.5
"""A loop round a piece of surface, not a gap in it: its area vector lies so much against the normals beside it."""
_MAX_FOLDED = 0.3
"""A patch of which more sides are folded back onto the surface is a second layer of it."""
_AGAINST = 10.0
"""Cost of a face that lies against the surface round it; well-shaped faces cost 0.5, slivers 1."""


def find_loops(faces: np.ndarray, num_units: int) -> list[list[int]]:
    """Return the boundary loops; a face wound along a loop is wound like its neighbours.

    Args:
        faces: `[F, 3]` of an oriented two-manifold: one fan a vertex.
        num_units: how many units there are.
    """
    sides = group_sides(faces, num_units)
    slots = sides.slots[sides.starts[sides.counts == 1]]
    tail, head = faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]
    following = dict(zip(head.tolist(), tail.tolist(), strict=True))
    loops = []
    while following:
        start, vertex = following.popitem()
        loop = [start]
        while vertex != start:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(loop)
    return loops


def patch_holes(
    units: np.ndarray, faces: np.ndarray, support: Support, max_edges: int = MAX_HOLE_EDGES
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate the boundary loops of at most `max_edges` edges that lie where there are samples.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]` of an oriented two-manifold.
        support: tells whether samples lie on a face.
        max_edges: longer loops stay open.

    Returns:
        `[F', 3]` an oriented two-manifold with the patches last, and which of the given faces `[D]` stand in
        the way of loops that could not be closed.
    """
    loops = sorted(loop for loop in find_loops(faces, len(units)) if len(loop) <= max_edges)
    normals = find_vertex_normals(units, faces)
    loops = [loop for loop in loops if _is_hole(units[loop], normals[loop])]
    if not loops:
        return faces, np.empty(0, dtype=np.int64)
    neighbors = _find_neighbors(faces, {vertex for loop in loops for vertex in loop})
    costs = _rate_triangles(loops, units, normals)
    patches = [(loop, _triangulate(loop, cost, neighbors)) for loop, cost in zip(loops, costs, strict=True)]
    closed = [np.array(patch) for _, patch in patches if patch]
    blocked = [loop for loop, patch in patches if not patch]
    if closed:
        is_supported = _find_supported(units, closed, support)
        patched = np.concatenate(
            [faces, *(patch for patch, is_kept in zip(closed, is_supported, strict=True) if is_kept)]
        )
    else:
        patched = faces
    return patched, _find_obstacles(faces, blocked)


def close_tips(units: np.ndarray, faces: np.ndarray, support: Support) -> np.ndarray:
    """Close what is left of longer holes, and of sharp tips and ridges, whose two sides face apart.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]` of an oriented two-manifold.
        support: tells whether samples lie on a face.

    Returns:
        `[F', 3]` an oriented two-manifold with the patches last.
    """
    loops = sorted(loop for loop in find_loops(faces, len(units)) if len(loop) <= MAX_TIP_EDGES)
    if not loops:
        return faces
    normals = find_vertex_normals(units, faces)
    normals /= np.maximum(find_lengths(normals)[..., None], 1e-300)
    loops = [loop for loop in loops if _find_outlook(units[loop], normals[loop]) > _RIM_COSINE]
    neighbors = _find_neighbors(faces, {vertex for loop in loops for vertex in loop})
    added = []
    for loop in loops:
        patch = np.array(_triangulate(loop, _rate_triangles([loop], units, normals)[0], neighbors))
        if len(patch) and support.measure_void(units[patch], WHOLE_COVER).sum() <= MAX_VOID:
            beside = faces[np.isin(faces, loop).sum(axis=1) >= 2]
            around = np.concatenate([beside, patch])
            hinges = find_hinges(around, group_sides(around, len(units)))
            folded = find_folds(units, around, hinges, np.arange(len(around), 0.0, -1))
            if (folded >= len(beside)).sum() <= _MAX_FOLDED * len(patch):
                added.append(patch)
    return np.concatenate([faces, *added])


def _find_outlook(positions: np.ndarray, normals: np.ndarray) -> float:
    """Return the cosine between a loop's area vector and the normals beside it, less where these differ."""
    area = _find_area(positions)
    return float(area @ normals.mean(axis=0) / max(float(np.linalg.norm(area)), 1e-300))


def _is_hole(positions: np.ndarray, normals: np.ndarray) -> bool:
    """Tell whether a loop `[n, 3]` runs round a gap in the surface and not round a piece of it.

    The loop's own area vector, whatever its triangulation, then points where the surface's normals point.
    """
    return bool(_find_area(positions) @ normals.sum(axis=0) > 0)


def _find_area(positions: np.ndarray) -> np.ndarray:
    """Return twice the area vector of a loop `[n, 3]`: `[3]`."""
    offset = positions - positions[0]
    return cross_rows(offset[1:-1], offset[2:]).sum(axis=0)


def _find_supported(units: np.ndarray, patches: list[np.ndarray], support: Support) -> np.ndarray:
    """Return which patches lie on samples: `[P]`."""
    faces = np.concatenate(patches)
    owner = np.repeat(np.arange(len(patches)), [len(patch) for patch in patches])
    return np.bincount(owner, support.measure_void(units[faces])) <= MAX_VOID


def _find_obstacles(faces: np.ndarray, loops: list[list[int]]) -> np.ndarray:
    """Return the faces `[D]` that join corners of one loop across it; else those round the loop."""
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


def find_vertex_normals(units: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the mean unit normal of the faces round every unit: `[U, 3]`, not normalised."""
    normals = np.repeat(find_normals(units, faces), 3, axis=0)
    vertex = faces.ravel()
    return np.stack([np.bincount(vertex, normals[:, k], minlength=len(units)) for k in range(3)], axis=1)


def _find_neighbors(faces: np.ndarray, wanted: set[int]) -> dict[int, set[int]]:
    """Return the neighbours of the wanted vertices."""
    chosen = np.array(sorted(wanted))
    near = faces[np.isin(faces, chosen).any(axis=1)]
    neighbors: dict[int, set[int]] = {vertex: set() for vertex in wanted}
    for face in near.tolist():
        for vertex in face:
            if vertex in neighbors:
                neighbors[vertex].update(face)
    return neighbors


def _triangulate(
    loop: list[int], costs: list[list[list[float]]], neighbors: dict[int, set[int]]
) -> list[tuple[int, int, int]]:
    """Choose the triangulation of a loop with the best-shaped faces, by dynamic programming.

    No face may use an existing edge as an inner one; faces that lie against the surface round them are
    taken only where nothing else closes the loop, and a loop that needs nothing but those stays open.

    Args:
        loop: n vertices.
        costs: `[n, n, n]` of the triangles between its corners.
        neighbors: of every vertex of the loop.

    Returns:
        The faces, or none where the loop cannot be closed.
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
    if best[0, size - 1][0] >= _AGAINST * (size - 2):
        return []
    faces, stack = [], [(0, size - 1)]
    while stack:
        i, k = stack.pop()
        j = best[i, k][1]
        if j >= 0:
            faces.append((loop[i], loop[j], loop[k]))
            stack.extend([(i, j), (j, k)])
    return faces


def _rate_triangles(loops: list[list[int]], units: np.ndarray, normals: np.ndarray) -> list:
    """Return for every loop the cost of the triangles between its n corners, `[n, n, n]`.

    A triangle costs the cosine of its smallest angle, and a constant more where it lies against the normals
    of its corners.
    """
    rated: list = [None] * len(loops)
    for size in {len(loop) for loop in loops}:
        chosen = [place for place, loop in enumerate(loops) if len(loop) == size]
        corners = np.array([loops[place] for place in chosen])
        positions, up = units[corners], normals[corners]
        i, j, k = np.array(list(itertools.combinations(range(size), 3))).T
        side, other = positions[:, j] - positions[:, i], positions[:, k] - positions[:, i]
        squared = np.stack([sum_rows(side**2), sum_rows(other**2), sum_rows((other - side) ** 2)])
        squared.sort(axis=0)
        cosine = (squared[1] + squared[2] - squared[0]) / np.maximum(
            2 * np.sqrt(squared[1] * squared[2]), 1e-300
        )
        outlook = sum_rows(cross_rows(side, other) * (up[:, i] + up[:, j] + up[:, k]))
        costs = np.zeros((len(chosen), size, size, size))
        costs[:, i, j, k] = np.where(outlook > 0, cosine, cosine + _AGAINST)
        for place, cost in zip(chosen, costs.tolist(), strict=True):
            rated[place] = cost
    return rated
