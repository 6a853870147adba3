"""Efficient RANSAC on a triangle mesh: planes, spheres and cylinders with the faces that they explain."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import compute_normals, find_hinges, group_sides
from reconstruction._src.surfaces.primitives.primitive import (
    CANDIDATES,
    FITS,
    KINDS,
    MIN_PART,
    MISSES,
    NORMAL_ANGLE,
    SAMPLE,
    PrimitivesConfig,
    Shapes,
    fit_shape,
    make_candidates,
)

_NEIGHBORS = (6, 24, 96, 384)
"""The second point of a minimal set is one of this many nearest ones: levels of locality."""
_SMOOTHING = 3
"""Rounds in which the normal of a face becomes the mean of its and its neighbors': noise tilts a single face."""
_EDGE = 0.7  # Cosine of the angle from which on two faces meet at an edge, across which nothing is smoothed
_LEAST = 1e-12
_FINALISTS = 6  # Candidates that are measured on all faces
_WIDE = 3.0  # Tolerances within which faces count for a candidate, which two points define
_CURVED_GAIN = 1.1
"""A sphere or cylinder explains this many times the area of the best plane; else it is a plane."""


class FoundShape(NamedTuple):
    """A shape, with what it explains."""

    shape: Shapes  # one infinite shape
    faces: Int[np.ndarray, " F"]  # the connected faces that lie on it
    area: float  # of the faces [m²]


class _Faces(NamedTuple):
    vertices: np.ndarray
    corners: np.ndarray
    centers: np.ndarray
    normals: np.ndarray
    smooth: np.ndarray
    areas: np.ndarray
    pairs: np.ndarray


def estimate_noise(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> float:
    """Return the noise of a surface [m]: how far a vertex is typically off its neighbors, along the normal."""
    one, other = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    total, count = np.zeros_like(vertices), np.zeros(len(vertices))
    np.add.at(total, one, vertices[other])
    np.add.at(count, one, 1.0)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], compute_normals(vertices, faces))
    is_inner = (count >= 3) & (np.linalg.norm(normals, axis=1) > 0)
    if not is_inner.any():
        return 0.0
    offset = vertices[is_inner] - total[is_inner] / count[is_inner, None]
    along = normals[is_inner] / np.linalg.norm(normals[is_inner], axis=1, keepdims=True)
    gaps = np.abs(np.einsum("vk,vk->v", offset, along))
    return float(1.4826 * np.median(gaps) / np.sqrt(1.0 + 1.0 / np.median(count[is_inner])))


def find_shapes(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    tolerance: float,
    config: PrimitivesConfig,
    rng: np.random.Generator,
) -> list[FoundShape]:
    """Return the shapes of a surface, in the order in which they were found: large ones first, about.

    References:
        Schnabel, Wahl and Klein (2007), Efficient RANSAC for point-cloud shape detection, sections 4.2-4.5: local
        minimal sets, scores on a random subset, connected components, refitting.
        Differs: a fixed number of candidates in a round; the mesh gives normals, areas and connectivity.
    """
    data = _prepare(vertices, faces)
    config = replace(config, min_area=max(config.min_area, MIN_PART * float(data.areas.sum())))
    tree = cKDTree(data.centers)
    is_left = data.areas > 0.0
    found: list[FoundShape] = []
    misses = 0
    while misses < MISSES and data.areas[is_left].sum() >= config.min_area:
        best = _search(data, tree, is_left, tolerance, config, rng)
        if best is None:
            misses += 1
            continue
        found.append(best)
        is_left[best.faces] = False
    return found


def _prepare(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> _Faces:
    corners = vertices[faces]
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    normals = compute_normals(vertices, faces)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    smooth = normals
    for _ in range(_SMOOTHING):
        total = smooth * areas[:, None]
        for side in (0, 1):
            near = hinges.faces[:, 1 - side]
            weight = areas[near] * (
                np.einsum("pk,pk->p", smooth[near], smooth[hinges.faces[:, side]]) > _EDGE
            )
            np.add.at(total, hinges.faces[:, side], weight[:, None] * smooth[near])
        smooth = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), _LEAST)
    return _Faces(vertices, corners, corners.mean(axis=1), normals, smooth, areas, hinges.faces)


def _search(
    data: _Faces,
    tree: cKDTree,
    is_left: Bool[np.ndarray, " F"],
    tolerance: float,
    config: PrimitivesConfig,
    rng: np.random.Generator,
) -> FoundShape | None:
    """Return the best shape of a round; None where none is large enough."""
    left = np.flatnonzero(is_left)
    share = data.areas[left] / data.areas[left].sum()
    sample = rng.choice(left, size=min(SAMPLE, len(left)), p=share)
    finalists: list[tuple[float, Shapes]] = []
    for kind in KINDS:
        first = rng.choice(left, size=CANDIDATES, p=share)
        near = tree.query(data.centers[first], k=min(_NEIGHBORS[-1], len(data.areas)))[1].reshape(
            len(first), -1
        )
        reach = np.minimum(rng.choice(_NEIGHBORS, len(first)), near.shape[1])
        second = near[np.arange(len(first)), (rng.random(len(first)) * reach).astype(np.int64)]
        pairs = np.stack([first, second], axis=1)[is_left[second] & (first != second)]
        shapes = make_candidates(kind, data.centers[pairs], data.smooth[pairs], config.max_radius)
        if not len(shapes.point):
            continue
        scores = _fits(shapes, data, sample, _WIDE * tolerance).mean(axis=1)
        finalists += [(float(scores[i]), shapes.pick(int(i))) for i in np.argsort(-scores)[:_FINALISTS]]
    best: FoundShape | None = None
    for _, shape in finalists:
        one = _refine(shape, data, is_left, tolerance, config)
        gain = 1.0 if shape.kind == "plane" or best is None or best.shape.kind != "plane" else _CURVED_GAIN
        if one is not None and (best is None or one.area > gain * best.area):
            best = one
    return best


def _fits(
    shapes: Shapes, data: _Faces, chosen: Int[np.ndarray, " N"], tolerance: float
) -> Bool[np.ndarray, "C N"]:
    distance, normals = shapes.measure(data.centers[chosen])
    cosine = np.einsum("cnk,nk->cn", normals, data.smooth[chosen])
    return (np.abs(distance) <= tolerance) & (cosine >= np.cos(NORMAL_ANGLE))


def _refine(
    shape: Shapes,
    data: _Faces,
    is_left: Bool[np.ndarray, " F"],
    tolerance: float,
    config: PrimitivesConfig,
) -> FoundShape | None:
    """Fit a shape to its connected faces, again and again; None where they are too few in the end."""
    faces = _find_connected(shape, data, is_left, _WIDE * tolerance)
    for step in range(FITS):
        if data.areas[faces].sum() < config.min_area / 2:
            return None
        shape = fit_shape(shape, data.corners[faces].reshape(-1, 3), np.repeat(data.areas[faces], 3))
        last = step == FITS - 1
        faces = _find_connected(shape, data, is_left, (1.0 if last else _WIDE / (step + 1)) * tolerance)
    area = float(data.areas[faces].sum())
    is_round = shape.kind != "plane"
    if area < config.min_area or (is_round and not 0 < shape.radius[0] < config.max_radius):
        return None
    return FoundShape(shape, faces, area)


def _find_connected(
    shape: Shapes,
    data: _Faces,
    is_left: Bool[np.ndarray, " F"],
    tolerance: float,
) -> Int[np.ndarray, " N"]:
    """Return the largest connected group of the faces whose corners all lie on a shape."""
    left = np.flatnonzero(is_left)
    distance = shape.measure(data.corners[left].reshape(-1, 3))[0].reshape(-1, 3)
    is_on = (np.abs(distance) <= tolerance).all(axis=1)
    left = left[is_on]
    left = left[_fits(shape, data, left, np.inf)[0]]
    if not len(left):
        return left
    number = np.full(len(data.areas), -1)
    number[left] = np.arange(len(left))
    pairs = number[data.pairs]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(left), len(left)))
    labels = connected_components(graph, directed=False)[1]
    return left[labels == np.argmax(np.bincount(labels, weights=data.areas[left]))]
