"""Flip edges that run across a crease, so that the faces next to it lie on its two sides.

Where a fitted mesh has a vertex on a tread joined to one on the riser below, the two faces at that edge bridge the
crease, like a tooth. The other diagonal of the same two faces runs along the crease. A flip is accepted by the
total absolute curvature around both faces: the sum of every edge's length times the angle between its faces.

References:
    van Damme and Alboul (1995), "Tight triangulations": the criterion.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.manifold import (
    Hinges,
    compute_normals,
    find_hinges,
    group_sides,
    is_in_sorted,
)
from reconstruction._src.geometry.rows import (
    Faces,
    Vertices,
    all_rows,
    any_rows,
    compute_lengths,
    cross_rows,
    sum_rows,
)

_SHORTEST = 1e-300  # Divided by instead of 0: the normal of a face without area is 0


_MIN_ANGLE = np.deg2rad(30)
"""Only edges whose faces differ by more are checked [rad]: a smooth surface between units has less, a tooth
across a crease more."""
_MIN_GAIN = 1e-3
"""Share of the curvature around an edge that a flip must save: above the rounding of floats, so that no edge
flips to and fro."""
_MIN_CORNER_SINE = 0.1  # New faces have no corner sharper than this, about 6 degrees
_MAX_ROUNDS = 8  # The search ends after this many, also where edges still wait for each other


def flip_edges(vertices: Vertices, faces: Faces) -> Faces:
    """Return the faces with edges flipped where that lowers the curvature.

    After the first round only what lies around a flipped edge, or around one that had to wait, is checked again.
    """
    faces = faces.copy()
    is_active = np.ones(len(vertices), dtype=bool)
    for _ in range(_MAX_ROUNDS):
        is_open = any_rows(is_active[faces])
        is_near = np.zeros(len(vertices), dtype=bool)
        is_near[faces[is_open]] = True
        part = np.flatnonzero(any_rows(is_near[faces]))
        changed, flipped, corners = _flip_once(vertices, faces[part], is_open[part])
        if len(changed) == 0:
            break
        faces[part[changed]] = flipped
        is_active[:] = False
        is_active[corners] = True
    return faces


def _flip_once(
    vertices: Vertices, faces: Faces, is_open: Bool[np.ndarray, " F"]
) -> tuple[Int[np.ndarray, " C"], Int[np.ndarray, "C 3"], Int[np.ndarray, "R 4"]]:
    """Flip edges of which no two touch the same face, those first that gain most."""
    sides = group_sides(faces, len(vertices))
    hinges = find_hinges(faces, sides)
    normals = compute_normals(vertices, faces)
    steep = np.flatnonzero(all_rows(is_open[hinges.faces]))
    steep = steep[_angle(*(normals[hinges.faces[steep, k]] for k in range(2))) > _MIN_ANGLE]
    candidates = Hinges(*(column[steep] for column in hinges))
    across = np.full((len(faces), 3), -1)
    across[hinges.faces[:, 0], hinges.sides[:, 0]] = hinges.faces[:, 1]
    across[hinges.faces[:, 1], hinges.sides[:, 1]] = hinges.faces[:, 0]
    gain, corners, outer = _rate_flips(vertices, faces, normals, across, candidates)
    worth = np.flatnonzero(gain)
    touched = np.concatenate([candidates.faces, outer], axis=1)[worth]
    ends = np.sort(corners[worth, 2:].astype(np.int64), axis=1)
    is_joined = is_in_sorted(ends[:, 0] * len(vertices) + ends[:, 1], sides.keys)
    gain = np.where(is_joined, 0, gain[worth])
    selected = worth[_select_apart(gain, touched, len(faces))]
    a, b, c, d = corners[selected].T
    flipped = np.concatenate([np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)])
    return candidates.faces[selected].T.ravel(), flipped, corners[worth]


def _rate_flips(
    vertices: Vertices, faces: Faces, normals: Float[np.ndarray, "F 3"], across: Faces, candidates: Hinges
) -> tuple[Float[np.ndarray, " P"], Int[np.ndarray, "P 4"], Int[np.ndarray, "P 4"]]:
    """Return what flipping each edge saves, 0 where it saves nothing; its corners and outer faces."""
    pair, side = candidates.faces, candidates.sides
    first, second = pair.T
    a, b = faces[first, side[:, 0]], faces[first, (side[:, 0] + 1) % 3]
    c, d = faces[first, (side[:, 0] + 2) % 3], faces[second, (side[:, 1] + 2) % 3]
    corners = np.stack([a, b, c, d], axis=1)
    outer = np.stack([across[pair[:, k // 2], (side[:, k // 2] + 1 + k % 2) % 3] for k in range(4)], axis=1)
    outer_edges = [(b, c), (c, a), (a, d), (d, b)]
    left, is_sound = _make_normals(vertices, a, d, c)
    right, is_sound_too = _make_normals(vertices, d, b, c)
    before = compute_lengths(vertices[a] - vertices[b]) * _angle(normals[first], normals[second])
    after = compute_lengths(vertices[c] - vertices[d]) * _angle(left, right)
    inner_before = (normals[first], normals[first], normals[second], normals[second])
    for k, (ends, old, new) in enumerate(
        zip(outer_edges, inner_before, (right, left, left, right), strict=True)
    ):
        length = np.where(outer[:, k] >= 0, compute_lengths(vertices[ends[0]] - vertices[ends[1]]), 0)
        before = before + length * _angle(old, normals[outer[:, k]])
        after = after + length * _angle(new, normals[outer[:, k]])
    gain = np.where(is_sound & is_sound_too & (after < (1 - _MIN_GAIN) * before), before - after, 0)
    return gain, corners, outer


def _make_normals(
    vertices: Vertices, i: Int[np.ndarray, " P"], j: Int[np.ndarray, " P"], k: Int[np.ndarray, " P"]
) -> tuple[Float[np.ndarray, "P 3"], Bool[np.ndarray, " P"]]:
    """Return the unit normals of the faces (i, j, k) and which of these have no sharp corner."""
    p, q, r = vertices[i], vertices[j], vertices[k]
    cross = cross_rows(q - p, r - p)
    double = compute_lengths(cross)
    squared = np.sort(
        np.stack([sum_rows((q - p) ** 2), sum_rows((r - q) ** 2), sum_rows((p - r) ** 2)]), axis=0
    )
    is_sound = double > _MIN_CORNER_SINE * np.sqrt(squared[1] * squared[2])
    return cross / np.maximum(double, _SHORTEST)[:, None], is_sound


def _angle(first: Float[np.ndarray, "P 3"], second: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, " P"]:
    """Return the angles between unit vectors [rad]."""
    return np.arccos(np.clip(sum_rows(first * second), -1, 1))


def _select_apart(
    gain: Float[np.ndarray, " P"], touched: Int[np.ndarray, "P k"], num_faces: int
) -> Int[np.ndarray, " C"]:
    """Return the places of the largest gains, of which no two touch the same face."""
    is_taken = np.zeros(num_faces + 1, dtype=bool)
    selected = []
    for place in np.argsort(-gain, kind="stable")[: (gain > 0).sum()].tolist():
        around = touched[place]
        if not is_taken[around].any():
            is_taken[around[around >= 0]] = True
            selected.append(place)
    return np.array(selected, dtype=np.int64)
