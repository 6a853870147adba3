"""Boxes whose sides are planes that were found."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import compute_vertex_normals, group_sides
from reconstruction._src.surfaces.primitives.primitive import (
    MAX_EXPOSED,
    MIN_COVERED,
    Primitive,
)

_RIGHT = 0.07  # Sine of the angle by which two sides may be off a right angle, or a side off its axis
_NEAR = 4.0  # Sides are neighbors whose faces come nearer than so many typical edges
_TRIMMED = 1.0  # Percentile of corners at which a box ends where no side was found


class Side(NamedTuple):
    """A plane that was found."""

    normal: Float[np.ndarray, " 3"]  # unit normal, into free space
    corners: Float[np.ndarray, "F 3 3"]  # of its faces [m]
    area: float  # of its faces [m²]


def propose_boxes(sides: list[Side], edge: float) -> list[tuple[Primitive, list[int]]]:
    """Return the boxes that pairs of sides at right angles propose, the largest area first, with their sides."""
    trees = [cKDTree(side.corners.reshape(-1, 3)) for side in sides]
    near = {
        (i, j)
        for i, j in combinations(range(len(sides)), 2)
        if np.isfinite(
            trees[i].query(sides[j].corners.reshape(-1, 3), distance_upper_bound=_NEAR * edge)[0]
        ).any()
    }
    near |= {(j, i) for i, j in near}
    found: dict[tuple[int, ...], tuple[float, Primitive]] = {}
    for i, j in sorted(pair for pair in near if pair[0] < pair[1]):
        if abs(sides[i].normal @ sides[j].normal) > _RIGHT or not _is_convex(sides[i], sides[j]):
            continue
        axes = _make_axes(sides[i].normal, sides[j].normal)
        members = [i, j]
        for k in range(len(sides)):
            is_aligned = np.abs(sides[k].normal @ axes).max() > 1.0 - _RIGHT**2
            touches = any((k, member) in near for member in (i, j))
            if (
                k not in members
                and is_aligned
                and touches
                and all(_agrees(sides[k], sides[m]) for m in members)
            ):
                members.append(k)
        key = tuple(sorted(members))
        area = sum(sides[k].area for k in key)
        if key not in found:
            found[key] = area, _enclose([sides[k] for k in key], axes)
    ranked = sorted(found.items(), key=lambda item: (-item[1][0], item[0]))
    return [(box, list(key)) for key, (_, box) in ranked]


def _is_convex(one: Side, other: Side) -> bool:
    """Return whether each of two sides lies behind the other."""
    a, b = one.corners.mean(axis=(0, 1)), other.corners.mean(axis=(0, 1))
    return bool((b - a) @ one.normal < 0 and (a - b) @ other.normal < 0)


def _agrees(one: Side, other: Side) -> bool:
    """Return whether two planes may be sides of one box: opposite, or convex."""
    cosine = one.normal @ other.normal
    return bool(cosine < 0.5) and _is_convex(one, other)


def _make_axes(x: Float[np.ndarray, " 3"], y: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    y = y - (x @ y) * x
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _enclose(sides: list[Side], axes: Float[np.ndarray, "3 3"]) -> Primitive:
    """Return the box between sides; where there is none, it ends with the others."""
    local = np.concatenate([side.corners.reshape(-1, 3) for side in sides]) @ axes
    low, high = np.percentile(local, [_TRIMMED, 100.0 - _TRIMMED], axis=0)
    for side in sides:
        toward = side.normal @ axes
        axis = int(np.argmax(np.abs(toward)))
        place = float((side.corners.reshape(-1, 3) @ axes[:, axis]).mean())
        if toward[axis] > 0:
            high[axis] = place
        else:
            low[axis] = place
    half = np.maximum((high - low) / 2, 1e-6)
    return Primitive("box", axes @ ((low + high) / 2), axes, half)


_SAMPLES = 2000  # Points on a shape at which that is looked at
_BEHIND = 2.0  # Tolerances behind the surface from which on a point is hidden


class Surface:
    """A surface that says where free space is."""

    def __init__(self, vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> None:
        """Find the rim."""
        self._vertices, self._faces = vertices, faces
        self._normals = compute_vertex_normals(vertices, faces)
        sides = group_sides(faces, len(vertices))
        slots = sides.slots[sides.starts[sides.counts == 1]]
        self._rim = np.zeros(len(vertices), dtype=bool)
        self._rim[faces.ravel()[slots]] = True
        self._rim[faces[:, [1, 2, 0]].ravel()[slots]] = True

    def is_closed_by(self, shape: Primitive, area: float, tolerance: float) -> bool:
        """Return whether faces cover enough of a closed shape, and all of it lies on the surface or behind it."""
        if area < MIN_COVERED * float(shape.as_mesh().area):
            return False
        return self.compute_exposed(shape, tolerance) <= MAX_EXPOSED

    def compute_exposed(self, shape: Primitive, tolerance: float) -> float:
        """Return the share of a closed shape that neither lies on the surface nor behind it.

        A point whose nearest place of the surface is at the rim, where the surface ends, is not behind it.
        """
        mesh = shape.as_mesh()
        points, index = _sample(mesh.triangles, np.random.default_rng(0))
        return 1.0 - float(self.is_backed(points, mesh.face_normals[index], tolerance).mean())

    def is_backed(
        self, points: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"], tolerance: float
    ) -> Bool[np.ndarray, " N"]:
        """Return which points of a shape lie on the surface or behind it."""
        import igl

        squared, nearest, places = igl.point_mesh_squared_distance(points, self._vertices, self._faces)[:3]
        distance, nearest = np.sqrt(np.asarray(squared)), np.asarray(nearest)
        corners = self._faces[nearest]
        weights = 1.0 / (np.linalg.norm(self._vertices[corners] - np.asarray(places)[:, None], axis=2) + 1e-9)
        toward = np.einsum("nk,nkd->nd", weights, self._normals[corners])
        toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-12)
        front = np.einsum("nd,nd->n", points - np.asarray(places), toward)
        is_on = (distance <= _BEHIND * tolerance) & (np.einsum("nd,nd->n", normals, toward) > 0.0)
        at_rim = self._rim[corners].sum(axis=1) >= 2
        is_hidden = (front < 0) & ~at_rim
        return is_on | is_hidden


def _sample(
    triangles: Float[np.ndarray, "F 3 3"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " N"]]:
    """Return points that are spread evenly over triangles, and on which triangle each lies."""
    crossed = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(crossed, axis=1)
    index = np.searchsorted(np.cumsum(area), (np.arange(_SAMPLES) + 0.5) / _SAMPLES * area.sum())
    index = np.minimum(index, len(area) - 1)
    u, v = rng.random((2, _SAMPLES))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = np.moveaxis(triangles[index], 1, 0)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), index
