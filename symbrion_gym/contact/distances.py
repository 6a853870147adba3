"""Distances between a surface and the convex pieces that stand for it, in 3-D and both ways.

Surface to contact: from points all over the surface to the boundary of the union of the pieces. A point inside a
piece lies as deep as the piece is thick above it, along the normal of the surface: there contact stands in front
of the surface. A point outside of all pieces lies as far off as the nearest piece.

Contact to surface: from points all over the pieces that a robot can touch (those inside of no other piece and not
behind the surface) to the surface: how far contact stands in front of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from reconstruction.geometry.rows import find_areas
from reconstruction.geometry.sampling import sample_area

_GRID_CELLS = 48
"""Cells a side of the grid in which points are looked up."""
_LEAST_SLOPE = 1e-9
"""A plane that turns from a direction by less is parallel to it."""
_LEAST_LENGTH = 1e-30
"""Keeps divisions by the length of a normal finite."""


@dataclass(frozen=True)
class DistanceConfig:
    """How distances are measured.

    Attributes:
        num_points: points on the surface, and as many on the pieces: a share of 1 % is known to 0.1 %.
        uncovered: a point of the surface farther than this from contact is uncovered [m]: half a Scout's height.
        inside: a point of a piece deeper than this in another one cannot be touched [m].
    """

    num_points: int = 20_000
    uncovered: float = 0.05
    inside: float = 1e-5


DISTANCE_DEFAULTS = DistanceConfig()


class Gaps(NamedTuple):
    """Distances of points on a surface from contact.

    Attributes:
        points: [m].
        gaps: above 0 where contact stands in front of the surface, below where it lies behind [m].
        protrusions: of the points of the pieces that can be touched, how far they stand in front of the surface [m].
    """

    points: Float[np.ndarray, "N 3"]
    gaps: Float[np.ndarray, " N"]
    protrusions: Float[np.ndarray, " M"]


class SurfaceDistance:
    """Distance of one set of pieces after another from one surface."""

    def __init__(self, surface: trimesh.Trimesh, config: DistanceConfig = DISTANCE_DEFAULTS) -> None:
        """Sample the surface.

        Args:
            surface: wound so that its faces look at free space.
            config: how it is measured.
        """
        self.config = config
        self._vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
        self.points = sample_area(self._vertices, self._faces, config.num_points)
        _, face, _ = _find_nearest(self.points, self._vertices, self._faces)
        self._normals = _find_normals(self._vertices, self._faces)
        self.normals = self._normals[face]

    def find_gaps(self, pieces: list[trimesh.Trimesh]) -> Gaps:
        """Return the distances of all sampled points."""
        if not pieces:
            infinite = np.full(len(self.points), -np.inf)
            return Gaps(self.points, infinite, np.zeros(0))
        solids = ConvexSolids(pieces)
        raised = solids.find_exits(self.points, self.normals)
        distance, _, _ = _find_nearest(self.points, solids.vertices, solids.faces)
        gaps = np.where(raised > 0, raised, -distance)
        return Gaps(self.points, gaps, self._find_protrusions(solids))

    def _find_protrusions(self, solids: ConvexSolids) -> Float[np.ndarray, " M"]:
        """Return how far touchable points of the pieces stand in front of the surface [m]."""
        points = sample_area(solids.vertices, solids.faces, self.config.num_points)
        points = points[solids.find_depths(points) <= self.config.inside]
        distance, face, nearest = _find_nearest(points, self._vertices, self._faces)
        height = np.einsum("ni,ni->n", points - nearest, self._normals[face])
        is_touchable = height > -self.config.uncovered
        return np.where(height > 0, distance, 0.0)[is_touchable]


class ConvexSolids:
    """Convex solids that many points are compared with."""

    def __init__(self, pieces: list[trimesh.Trimesh]) -> None:
        """Take the planes and boxes of the pieces; faces look outwards."""
        counts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
        self.vertices = np.concatenate([np.asarray(piece.vertices, dtype=np.float64) for piece in pieces])
        faces = [np.asarray(piece.faces, dtype=np.int64) + start for piece, start in zip(pieces, counts, strict=False)]
        self.faces = np.ascontiguousarray(np.concatenate(faces))
        self._ends = np.cumsum([len(piece.faces) for piece in pieces])
        self._normals = _find_normals(self.vertices, self.faces)
        self._offsets = np.einsum("fi,fi->f", self._normals, self.vertices[self.faces[:, 0]])
        self._low = np.array([piece.bounds[0] for piece in pieces])
        self._high = np.array([piece.bounds[1] for piece in pieces])

    def find_exits(
        self, points: Float[np.ndarray, "N 3"], directions: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, " N"]:
        """Return how far points inside a piece lie from its boundary along a direction [m]; 0 outside of all."""
        exits = np.zeros(len(points))
        for members, depths, normals in self._walk(points):
            slope = directions[members] @ normals.T
            with np.errstate(divide="ignore"):
                length = np.where(slope > _LEAST_SLOPE, depths / np.maximum(slope, _LEAST_SLOPE), np.inf)
            exits[members] = np.maximum(exits[members], length.min(axis=1))
        return exits

    def find_depths(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Return how deep points lie in the piece that they lie deepest in [m]; 0 outside of all."""
        deepest = np.zeros(len(points))
        for members, depths, _ in self._walk(points):
            deepest[members] = np.maximum(deepest[members], depths.min(axis=1))
        return deepest

    def _walk(self, points):  # noqa: ANN001, ANN202
        """Give for each piece the points inside, their depths below its planes, and the planes' normals."""
        lookup = _Lookup(points)
        start = 0
        for low, high, end in zip(self._low, self._high, self._ends.tolist(), strict=True):
            normals, offsets = self._normals[start:end], self._offsets[start:end]
            start = end
            members = lookup.find_within(low, high)
            depths = offsets - points[members] @ normals.T
            is_inside = (depths >= 0).all(axis=1)
            if is_inside.any():
                yield members[is_inside], depths[is_inside], normals


class _Lookup:
    """Points in the cells of a grid, to find those within a box."""

    def __init__(self, points: Float[np.ndarray, "N 3"]) -> None:
        self._points = points
        self._low = points.min(axis=0)
        self._cell = np.maximum(np.ptp(points, axis=0).max() / _GRID_CELLS, _LEAST_LENGTH)
        cells = np.floor((points - self._low) / self._cell).astype(np.int64)
        self._shape = cells.max(axis=0) + 1
        keys = np.ravel_multi_index(tuple(cells.T), tuple(self._shape))
        self._order = np.argsort(keys, kind="stable")
        self._starts = np.searchsorted(keys[self._order], np.arange(int(np.prod(self._shape)) + 1))

    def find_within(self, low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"]) -> Int[np.ndarray, " M"]:
        """Return the points within a box."""
        first = np.clip(np.floor((low - self._low) / self._cell).astype(np.int64), 0, self._shape - 1)
        last = np.clip(np.floor((high - self._low) / self._cell).astype(np.int64), 0, self._shape - 1)
        x, y = np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(first[:2], last[:2], strict=True)), indexing="ij")
        row = ((x * self._shape[1] + y) * self._shape[2]).ravel()
        begin, end = self._starts[row + first[2]], self._starts[row + last[2] + 1]
        found = [self._order[a:b] for a, b in zip(begin.tolist(), end.tolist(), strict=True) if b > a]
        if not found:
            return np.zeros(0, dtype=np.int64)
        members = np.concatenate(found)
        near = self._points[members]
        return members[((near >= low) & (near <= high)).all(axis=1)]


def _find_normals(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> Float[np.ndarray, "F 3"]:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _LEAST_LENGTH)


def _find_nearest(
    points: Float[np.ndarray, "N 3"], vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, " N"], Int[np.ndarray, " N"], Float[np.ndarray, "N 3"]]:
    """Return the distance, face and place of the nearest point of the faces, by libigl."""
    import igl

    squared, face, place = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)
    return np.sqrt(np.maximum(squared, 0.0)), np.asarray(face, dtype=np.int64), place
