"""Turn edges that run across a crease, so that the faces beside it lie on its two sides.

Where a fitted mesh has a vertex on a tread joined to one on the riser below, the two faces at that edge bridge the
crease, like a tooth. The other diagonal of the same two faces runs along the crease. Turning is judged by the
total absolute curvature round both faces: the sum of every edge's length times the angle between its faces.

References:
    van Damme and Alboul (1995), "Tight triangulations": the criterion.
"""

import numpy as np

from reconstruction.geometry.manifold import Sides, find_hinges, find_normals, group_sides, is_in_sorted
from reconstruction.geometry.rows import all_corners, any_corner, cross_rows, find_lengths, sum_rows

MIN_TURN = np.deg2rad(30)
"""Only edges whose faces differ by more are looked at."""
MIN_GAIN = 1e-3
"""Share of the curvature round an edge that turning it must save."""
MIN_ANGLE_SINE = 0.1
"""New faces have no angle below about 6 degrees."""
MAX_ROUNDS = 8


def turn_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces `[F, 3]` with edges turned where that makes the surface less crumpled.

    After the first round only what lies about a turned edge, or about one that had to wait, is looked at again.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]` of an oriented two-manifold; the result is one too, of the same topology.
    """
    faces = faces.copy()
    is_restless = np.ones(len(vertices), dtype=bool)
    for _ in range(MAX_ROUNDS):
        is_open = any_corner(is_restless, faces)
        is_about = np.zeros(len(vertices), dtype=bool)
        is_about[faces[is_open]] = True
        part = np.flatnonzero(any_corner(is_about, faces))
        changed, turned, restless = _turn_once(vertices, faces[part], is_open[part])
        if len(changed) == 0:
            break
        faces[part[changed]] = turned
        is_restless[:] = False
        is_restless[restless] = True
    return faces


def _turn_once(
    vertices: np.ndarray, faces: np.ndarray, is_open: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Turn edges of which no two touch the same face, those first that gain most.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]`, with all those that share an edge with an open one.
        is_open: `[F]` edges between two such faces may turn.

    Returns:
        Which faces change `[C]`, into what `[C, 3]`, and the corners of all edges worth turning `[R, 4]`.
    """
    sides = group_sides(faces, len(vertices))
    hinges = find_hinges(faces, sides)
    normals = find_normals(vertices, faces)
    steep = np.flatnonzero(all_corners(is_open, hinges.faces))
    steep = steep[_angle(*(normals[hinges.faces[steep, k]] for k in range(2))) > MIN_TURN]
    across = np.full((len(faces), 3), -1)
    across[hinges.faces[:, 0], hinges.sides[:, 0]] = hinges.faces[:, 1]
    across[hinges.faces[:, 1], hinges.sides[:, 1]] = hinges.faces[:, 0]
    pair, side = hinges.faces[steep], hinges.sides[steep]
    gain, corners, outer = _rate_turns(vertices, faces, normals, across, pair, side)
    worth = np.flatnonzero(gain)
    touched = np.concatenate([pair, outer], axis=1)[worth]
    gain = np.where(_are_joined(corners[worth, 2:], faces, sides, len(vertices)), 0, gain[worth])
    chosen = worth[_choose_apart(gain, touched, len(faces))]
    a, b, c, d = corners[chosen].T
    turned = np.concatenate([np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)])
    return pair[chosen].T.ravel(), turned, corners[worth]


def _rate_turns(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    across: np.ndarray,
    pair: np.ndarray,
    side: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what turning each edge saves, `[P]`, 0 where it saves nothing; its corners and outer faces.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]`.
        normals: `[F, 3]`.
        across: `[F, 3]` the face behind every side, -1 where none.
        pair: `[P, 2]` the two faces at each edge.
        side: `[P, 2]` which side of each it is.
    """
    first, second = pair.T
    a, b = faces[first, side[:, 0]], faces[first, (side[:, 0] + 1) % 3]
    c, d = faces[first, (side[:, 0] + 2) % 3], faces[second, (side[:, 1] + 2) % 3]
    corners = np.stack([a, b, c, d], axis=1)
    outer = np.stack([across[pair[:, k // 2], (side[:, k // 2] + 1 + k % 2) % 3] for k in range(4)], axis=1)
    rims = [(b, c), (c, a), (a, d), (d, b)]
    left, is_sound = _make_normals(vertices, a, d, c)
    right, is_sound_too = _make_normals(vertices, d, b, c)
    before = _length(vertices, a, b) * _angle(normals[first], normals[second])
    after = _length(vertices, c, d) * _angle(left, right)
    inner_before = (normals[first], normals[first], normals[second], normals[second])
    for k, (rim, old, new) in enumerate(zip(rims, inner_before, (right, left, left, right), strict=True)):
        length = np.where(outer[:, k] >= 0, _length(vertices, *rim), 0)
        before = before + length * _angle(old, normals[outer[:, k]])
        after = after + length * _angle(new, normals[outer[:, k]])
    gain = np.where(is_sound & is_sound_too & (after < (1 - MIN_GAIN) * before), before - after, 0)
    return gain, corners, outer


def _make_normals(
    vertices: np.ndarray, i: np.ndarray, j: np.ndarray, k: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals of faces and which of these have no sharp corner."""
    p, q, r = vertices[i], vertices[j], vertices[k]
    cross = cross_rows(q - p, r - p)
    double = find_lengths(cross)
    squared = np.sort(
        np.stack([sum_rows((q - p) ** 2), sum_rows((r - q) ** 2), sum_rows((p - r) ** 2)]), axis=0
    )
    is_sound = double > MIN_ANGLE_SINE * np.sqrt(squared[1] * squared[2])
    return cross / np.maximum(double, 1e-300)[:, None], is_sound


def _length(vertices: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    return find_lengths(vertices[i] - vertices[j])


def _angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.arccos(np.clip(sum_rows(first * second), -1, 1))


def _are_joined(pairs: np.ndarray, faces: np.ndarray, sides: Sides, num_vertices: int) -> np.ndarray:
    """Return which pairs of vertices `[P, 2]` have an edge."""
    slots = sides.slots[sides.starts]
    ends = np.stack([faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]], axis=1)
    keys, wanted = (
        part.min(axis=1).astype(np.int64) * num_vertices + part.max(axis=1) for part in (ends, pairs)
    )
    return is_in_sorted(wanted, keys)


def _choose_apart(gain: np.ndarray, touched: np.ndarray, num_faces: int) -> np.ndarray:
    """Return the places of the largest gains, of which no two touch the same face, `[C]`."""
    is_taken = np.zeros(num_faces + 1, dtype=bool)
    chosen = []
    for place in np.argsort(-gain, kind="stable")[: (gain > 0).sum()].tolist():
        around = touched[place]
        if not is_taken[around].any():
            is_taken[around[around >= 0]] = True
            chosen.append(place)
    return np.array(chosen, dtype=np.int64)
