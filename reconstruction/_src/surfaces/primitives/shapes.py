"""The shapes: their distances, normals, fits, and the minimal sets that define them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

KINDS = ("plane", "sphere", "cylinder")
_LEAST = 1e-9
"""Divided by instead of 0."""


class Shapes(NamedTuple):
    """Several infinite shapes of one kind.

    Attributes:
        kind: one of `KINDS`.
        point: `[C, 3]` a point of the plane, the center, a point of the axis [m].
        axis: `[C, 3]` unit normal of the plane, axis of the cylinder; unused by spheres.
        radius: `[C]` of sphere or cylinder [m]; unused by planes.
        side: `[C]` 1 where the surface looks outwards, away from center or axis, -1 inwards; 1 for planes.
    """

    kind: str
    point: Float[np.ndarray, "C 3"]
    axis: Float[np.ndarray, "C 3"]
    radius: Float[np.ndarray, " C"]
    side: Float[np.ndarray, " C"]

    def pick(self, index: int) -> Shapes:
        """Return one of them."""
        one = slice(index, index + 1)
        return Shapes(self.kind, *(array[one] for array in self[1:]))

    def measure(
        self, points: Float[np.ndarray, "N 3"]
    ) -> tuple[Float[np.ndarray, "C N"], Float[np.ndarray, "C N 3"]]:
        """Return the signed distance of points in front of each shape [m], and the shape's normals there."""
        offset = points[None] - self.point[:, None]
        if self.kind == "plane":
            distance = np.einsum("cnk,ck->cn", offset, self.axis)
            return distance, np.broadcast_to(self.axis[:, None], offset.shape)
        if self.kind == "cylinder":
            along = np.einsum("cnk,ck->cn", offset, self.axis)
            offset = offset - along[..., None] * self.axis[:, None]
        length = np.linalg.norm(offset, axis=2)
        normals = self.side[:, None, None] * offset / np.maximum(length, _LEAST)[..., None]
        return self.side[:, None] * (length - self.radius[:, None]), normals


def make_candidates(
    kind: str,
    points: Float[np.ndarray, "C 2 3"],
    normals: Float[np.ndarray, "C 2 3"],
    max_radius: float,
) -> Shapes:
    """Return the shapes through minimal sets: two oriented points each.

    References:
        Schnabel, Wahl and Klein (2007), Efficient RANSAC for point-cloud shape detection, section 4.1.
        Differs: a plane is made of two oriented points, not of three points.
    """
    (p, q), (n, m) = np.moveaxis(points, 1, 0), np.moveaxis(normals, 1, 0)
    if kind == "plane":
        axis = _normalize(n + m)
        return Shapes(kind, (p + q) / 2, axis, np.zeros(len(p)), np.ones(len(p)))
    axis = _normalize(np.cross(n, m)) if kind == "cylinder" else np.zeros_like(p)
    apart = q - p
    apart = apart - (np.einsum("ck,ck->c", apart, axis))[:, None] * axis
    # the lines p + s n and q + t m, across the axis, come nearest to each other at the center
    cosine = np.einsum("ck,ck->c", n, m)
    a, b = np.einsum("ck,ck->c", n, apart), np.einsum("ck,ck->c", m, apart)
    sine = np.maximum(1.0 - cosine**2, _LEAST)
    s, t = (a - cosine * b) / sine, (cosine * a - b) / sine
    center = (p + s[:, None] * n + p + apart + t[:, None] * m) / 2
    radius = (np.abs(s) + np.abs(t)) / 2
    is_good = (s * t > 0) & (radius < max_radius) & (np.abs(np.abs(s) - np.abs(t)) < 0.3 * radius)
    is_good &= sine > 0.03
    return Shapes(kind, center[is_good], axis[is_good], radius[is_good], -np.sign(s[is_good]))


def fit_shape(shape: Shapes, points: Float[np.ndarray, "N 3"], weights: Float[np.ndarray, " N"]) -> Shapes:
    """Return the shape that fits points best in the sense of least squares, from a first guess."""
    weights = weights / weights.sum()
    if shape.kind == "plane":
        center = weights @ points
        offset = (points - center) * np.sqrt(weights)[:, None]
        axis = np.linalg.svd(offset, full_matrices=False)[2][2]
        axis = axis * np.sign(axis @ shape.axis[0])
        return shape._replace(point=center[None], axis=axis[None])
    basis = _find_across(shape.axis[0]) if shape.kind == "cylinder" else np.eye(3)

    def make(x: Float[np.ndarray, " P"]) -> Shapes:
        if shape.kind == "sphere":
            return shape._replace(point=shape.point + x[:3], radius=shape.radius + x[3])
        axis = _normalize(shape.axis + x[3:5] @ basis)
        return shape._replace(point=shape.point + x[:2] @ basis, axis=axis, radius=shape.radius + x[2])

    def find_gaps(x: Float[np.ndarray, " P"]) -> Float[np.ndarray, " N"]:
        return np.sqrt(weights) * make(x).measure(points)[0][0]

    found = least_squares(find_gaps, np.zeros(4 if shape.kind == "sphere" else 5), max_nfev=30)
    made = make(found.x)
    return made._replace(radius=np.abs(made.radius))


def _normalize(vectors: Float[np.ndarray, "C 3"]) -> Float[np.ndarray, "C 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _LEAST)


def _find_across(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "2 3"]:
    """Return two unit vectors that are perpendicular to an axis and to each other."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])
