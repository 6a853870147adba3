"""Efficient RANSAC on a triangle mesh: planes, spheres and cylinders with the faces that they explain.

References:
    Schnabel, Wahl and Klein (2007), Efficient RANSAC for point-cloud shape detection, Computer Graphics Forum 26(2),
    sections 4.1-4.5: minimal sets of oriented points, local ones; scores on a random subset; connected components;
    refitting.
    Differs: two oriented points make a plane; a round draws a fixed number of candidates; the mesh gives normals,
    areas and connectivity.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import (
    compute_normals,
    compute_vertex_normals,
    find_hinges,
    group_sides,
    label_parts,
)
from reconstruction._src.geometry.rows import (
    Faces,
    Points,
    Vertices,
    all_rows,
    compute_areas,
    compute_lengths,
    sum_by_owner,
    sum_rows,
)

_KINDS = ("plane", "sphere", "cylinder")
_MIN_AREA = 0.03  # Of the faces of a shape [m²], at least ...
_MIN_PART = 0.003  # ... and their share of the surface; smaller ones stay triangles
_MAX_RADIUS = 1.0  # Of spheres and cylinders [m]; larger ones are hardly told from planes
_NORMAL_ANGLE = 0.35
"""Largest angle between a face and its shape [rad]: normals of faces of 3 cm with a noise of 1 mm deviate by 4
degrees."""
_NEIGHBORS = (6, 24, 96, 384)
"""The second point of a minimal set is one of this many nearest ones: levels of locality."""
_SMOOTHING = 3
"""Rounds in which the normal of a face becomes the mean of its and its neighbors': noise tilts a single face."""
_EDGE = 0.7  # Cosine of the angle from which on two faces meet at an edge, across which nothing is smoothed
_CANDIDATES = 200  # Drawn in a round, of each kind
_SAMPLE = 1500  # Faces on which candidates are compared
_FINALISTS = 6  # Candidates of each kind that are measured on all faces
_MISSES = 3  # Rounds without a shape after which the search ends
_WIDE = (3.0, 3.0, 1.5, 1.0)
"""Tolerances within which faces count, fit by fit: two points define a candidate, many the shape."""
_CURVED_GAIN = 1.1
"""A sphere or cylinder explains this many times the area of the best plane; else it is a plane."""
_MIN_SINE = 0.17  # Of the angle between two normals that show where the center is
_UNEQUAL = 0.3  # Share of the radius by which two points may be unequally far from the center
_LEAST = 1e-9  # Divided by instead of 0


class Shapes(NamedTuple):
    """Several infinite shapes of one kind."""

    kind: str  # one of `_KINDS`
    point: Float[np.ndarray, "C 3"]  # a point of the plane, the center, a point of the axis [m]
    axis: Float[np.ndarray, "C 3"]  # unit normal of the plane, axis of the cylinder; unused by spheres
    radius: Float[np.ndarray, " C"]  # of sphere or cylinder [m]; unused by planes
    # 1: the surface looks away from center or axis, -1: towards it; 1 for planes
    side: Float[np.ndarray, " C"]

    def measure(self, points: Points) -> tuple[Float[np.ndarray, "C N"], Float[np.ndarray, "C N 3"]]:
        """Return the signed distance of points in front of each shape [m], and the shape's normals there."""
        offset = points[None] - self.point[:, None]
        along = np.einsum("cnk,ck->cn", offset, self.axis)
        if self.kind == "plane":
            return along, np.broadcast_to(self.axis[:, None], offset.shape)
        offset = offset - along[..., None] * self.axis[:, None]
        length = compute_lengths(offset)
        normals = self.side[:, None, None] * offset / np.maximum(length, _LEAST)[..., None]
        return self.side[:, None] * (length - self.radius[:, None]), normals


class FoundShape(NamedTuple):
    """A shape, with what it explains."""

    shape: Shapes  # one infinite shape
    faces: Int[np.ndarray, " F"]  # the connected faces that lie on it
    area: float  # of the faces [m²]


class _Surface(NamedTuple):
    corners: Float[np.ndarray, "F 3 3"]
    centers: Float[np.ndarray, "F 3"]
    normals: Float[np.ndarray, "F 3"]  # smoothed
    areas: Float[np.ndarray, " F"]
    pairs: Int[np.ndarray, "P 2"]  # neighbors
    tree: cKDTree  # of the centers
    tolerance: float  # [m]
    min_area: float  # of a shape [m²]


def estimate_noise(vertices: Vertices, faces: Faces) -> float:
    """Return the noise of a surface [m]: how far a vertex is typically off its neighbors, along the normal."""
    one, other = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = np.bincount(one, minlength=len(vertices))
    normals = compute_vertex_normals(vertices, faces)
    is_inner = (count >= 3) & (compute_lengths(normals) > 0)
    if not is_inner.any():
        return 0.0
    mean = sum_by_owner(one, vertices[other], len(vertices)) / np.maximum(count, 1)[:, None]
    gaps = np.abs(sum_rows((vertices - mean)[is_inner] * _normalize(normals[is_inner])))
    return float(1.4826 * np.median(gaps) / np.sqrt(1.0 + 1.0 / np.median(count[is_inner])))


def find_shapes(
    vertices: Vertices, faces: Faces, tolerance: float, rng: np.random.Generator
) -> list[FoundShape]:
    """Return the shapes of a surface, in the order in which they were found: large ones first, about."""
    surface = _prepare(vertices, faces, tolerance)
    is_left = surface.areas > 0.0
    found: list[FoundShape] = []
    misses = 0
    while misses < _MISSES and surface.areas[is_left].sum() >= surface.min_area:
        best = _search(surface, is_left, rng)
        if best is None:
            misses += 1
        else:
            found.append(best)
            is_left[best.faces] = False
    return found


def _prepare(vertices: Vertices, faces: Faces, tolerance: float) -> _Surface:
    pairs = find_hinges(faces, group_sides(faces, len(vertices))).faces
    areas, normals = compute_areas(vertices, faces), compute_normals(vertices, faces)
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    for _ in range(_SMOOTHING):
        weight = areas[ends[:, 1]] * (sum_rows(normals[ends[:, 0]] * normals[ends[:, 1]]) > _EDGE)
        around = sum_by_owner(ends[:, 0], weight[:, None] * normals[ends[:, 1]], len(faces))
        normals = _normalize(normals * areas[:, None] + around)
    corners = vertices[faces]
    centers = corners.mean(axis=1)
    min_area = max(_MIN_AREA, _MIN_PART * float(areas.sum()))
    return _Surface(corners, centers, normals, areas, pairs, cKDTree(centers), tolerance, min_area)


def _search(
    surface: _Surface, is_left: Bool[np.ndarray, " F"], rng: np.random.Generator
) -> FoundShape | None:
    """Return the best shape of a round; None where none is large enough."""
    left = np.flatnonzero(is_left)
    share = surface.areas[left] / surface.areas[left].sum()
    sample = rng.choice(left, size=min(_SAMPLE, len(left)), p=share)
    best: FoundShape | None = None
    for kind in _KINDS:
        first = rng.choice(left, size=_CANDIDATES, p=share)
        near = surface.tree.query(surface.centers[first], k=min(_NEIGHBORS[-1], len(is_left)))[1]
        near = near.reshape(len(first), -1)
        reach = np.minimum(rng.choice(_NEIGHBORS, len(first)), near.shape[1])
        second = near[np.arange(len(first)), (rng.random(len(first)) * reach).astype(np.int64)]
        pairs = np.stack([first, second], axis=1)[is_left[second] & (first != second)]
        shapes = _make_candidates(kind, surface.centers[pairs], surface.normals[pairs])
        if not len(shapes.point):
            continue
        scores = _fits(shapes, surface, sample, _WIDE[0] * surface.tolerance).mean(axis=1)
        for place in np.argsort(-scores)[:_FINALISTS]:
            one = Shapes(kind, *(array[[place]] for array in shapes[1:]))
            refined = _refine(one, surface, is_left)
            is_curved = kind != "plane" and best is not None and best.shape.kind == "plane"
            gain = _CURVED_GAIN if is_curved else 1.0
            if refined is not None and (best is None or refined.area > gain * best.area):
                best = refined
    return best


def _make_candidates(
    kind: str, points: Float[np.ndarray, "C 2 3"], normals: Float[np.ndarray, "C 2 3"]
) -> Shapes:
    """Return the shapes through two oriented points each."""
    (p, q), (n, m) = np.moveaxis(points, 1, 0), np.moveaxis(normals, 1, 0)
    if kind == "plane":
        return Shapes(kind, (p + q) / 2, _normalize(n + m), np.zeros(len(p)), np.ones(len(p)))
    axis = _normalize(np.cross(n, m)) if kind == "cylinder" else np.zeros_like(p)
    apart = q - p
    apart = apart - sum_rows(apart * axis)[:, None] * axis
    # The lines p + s n and q + t m, across the axis, come nearest to each other at the center.
    cosine, a, b = sum_rows(n * m), sum_rows(n * apart), sum_rows(m * apart)
    squared_sine = np.maximum(1.0 - cosine**2, _LEAST)
    s, t = (a - cosine * b) / squared_sine, (cosine * a - b) / squared_sine
    center = (p + s[:, None] * n + p + apart + t[:, None] * m) / 2
    radius = (np.abs(s) + np.abs(t)) / 2
    is_good = (s * t > 0) & (radius < _MAX_RADIUS) & (np.abs(np.abs(s) - np.abs(t)) < _UNEQUAL * radius)
    is_good &= squared_sine > _MIN_SINE**2
    return Shapes(kind, center[is_good], axis[is_good], radius[is_good], -np.sign(s[is_good]))


def _fits(
    shapes: Shapes, surface: _Surface, chosen: Int[np.ndarray, " N"], tolerance: float
) -> Bool[np.ndarray, "C N"]:
    distance, normals = shapes.measure(surface.centers[chosen])
    cosine = np.einsum("cnk,nk->cn", normals, surface.normals[chosen])
    return (np.abs(distance) <= tolerance) & (cosine >= np.cos(_NORMAL_ANGLE))


def _refine(shape: Shapes, surface: _Surface, is_left: Bool[np.ndarray, " F"]) -> FoundShape | None:
    """Fit a shape to its connected faces, again and again; None where they are too few in the end."""
    faces = _find_connected(shape, surface, is_left, _WIDE[0] * surface.tolerance)
    for wide in _WIDE:
        if surface.areas[faces].sum() < surface.min_area / 2:
            return None
        shape = _fit_shape(shape, surface.corners[faces].reshape(-1, 3), np.repeat(surface.areas[faces], 3))
        faces = _find_connected(shape, surface, is_left, wide * surface.tolerance)
    area = float(surface.areas[faces].sum())
    is_possible = shape.kind == "plane" or 0 < shape.radius[0] < _MAX_RADIUS
    return FoundShape(shape, faces, area) if area >= surface.min_area and is_possible else None


def _fit_shape(shape: Shapes, points: Points, weights: Float[np.ndarray, " N"]) -> Shapes:
    """Return the shape that fits points best in the sense of least squares, from a first guess."""
    weights = weights / weights.sum()
    if shape.kind == "plane":
        center = weights @ points
        axis = np.linalg.svd((points - center) * np.sqrt(weights)[:, None], full_matrices=False)[2][2]
        return shape._replace(point=center[None], axis=axis[None] * np.sign(axis @ shape.axis[0]))
    basis = make_frame(shape.axis[0])[:, :2].T if shape.kind == "cylinder" else np.eye(3)
    size = len(basis)

    def make(x: Float[np.ndarray, " P"]) -> Shapes:
        moved = shape._replace(point=shape.point + x[:size] @ basis, radius=np.abs(shape.radius + x[size]))
        is_cylinder = shape.kind == "cylinder"
        return moved._replace(axis=_normalize(shape.axis + x[3:] @ basis)) if is_cylinder else moved

    def compute_gaps(x: Float[np.ndarray, " P"]) -> Float[np.ndarray, " N"]:
        return np.sqrt(weights) * make(x).measure(points)[0][0]

    return make(least_squares(compute_gaps, np.zeros(4 if shape.kind == "sphere" else 5), max_nfev=30).x)


def _find_connected(
    shape: Shapes, surface: _Surface, is_left: Bool[np.ndarray, " F"], tolerance: float
) -> Int[np.ndarray, " N"]:
    """Return the largest connected group of the faces whose corners all lie on a shape."""
    left = np.flatnonzero(is_left)
    distance = shape.measure(surface.corners[left].reshape(-1, 3))[0].reshape(-1, 3)
    left = left[all_rows(np.abs(distance) <= tolerance)]
    left = left[_fits(shape, surface, left, np.inf)[0]]
    if not len(left):
        return left
    number = np.full(len(is_left), -1)
    number[left] = np.arange(len(left))
    pairs = number[surface.pairs]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    labels = label_parts(pairs, len(left))
    return left[labels == np.argmax(np.bincount(labels, weights=surface.areas[left]))]


def make_frame(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return a right-handed frame (columns) whose z is an axis."""
    first = _normalize(np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis))
    return np.column_stack([first, np.cross(axis, first), axis])


def _normalize(vectors: Float[np.ndarray, "*C 3"]) -> Float[np.ndarray, "*C 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _LEAST)
