"""Distances between a surface and the convex pieces that stand for it, in 3-D and both ways.

Surface to contact: from points all over the surface. Inside a piece, a point lies as deep as it is behind the planes
that face where the surface looks: there contact stands in front of the surface. Outside of all pieces, it lies as far
off as the nearest piece.

Contact to surface: from points all over the pieces that a robot can touch (inside of no other piece, not behind the
surface): how far contact stands in front of the surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction._src.geometry.rows import compute_lengths, cross_rows
from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.inside import ConvexSolids
from symbrion_gym._src.contact.quality import ArenaQuality

_LEAST_LENGTH = 1e-30  # Keeps divisions by the length of a normal finite


_NUM_POINTS = 20_000  # Points on the surface, and as many on the pieces: a share of 1 % is known to 0.1 %
UNCOVERED_BEYOND = 0.05
"""A point of the surface farther than this from contact is uncovered [m]: half a Scout's height."""
_INSIDE = 1e-5  # A point of a piece deeper than this in another one cannot be touched [m]


class Gaps(NamedTuple):
    """Distances of a surface and contact from each other."""

    points: Float[np.ndarray, "N 3"]  # on the surface [m]
    # of each from contact: above 0 where contact stands in front of the surface, below where behind [m]
    gaps: Float[np.ndarray, " N"]
    # of points of the pieces that can be touched: how far they stand in front of the surface [m]
    protrusions: Float[np.ndarray, " M"]

    def find_worst(self) -> tuple[Float[np.ndarray, " 3"], float]:
        """Return the place of the largest distance, and that distance [m]."""
        worst = int(np.argmax(np.abs(self.gaps)))
        return self.points[worst], float(abs(self.gaps[worst]))


class SurfaceDistance:
    """Distance of one set of pieces after another from one surface.

    Attributes:
        points: `[N, 3]` samples of the surface [m].
    """

    def __init__(self, surface: trimesh.Trimesh) -> None:
        """Sample the surface."""
        self._vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
        self._normals = _compute_normals(self._vertices, self._faces)
        self.points = sample_area(self._vertices, self._faces, _NUM_POINTS)
        _, face, _ = find_nearest(self.points, self._vertices, self._faces)
        self._directions = self._normals[face]

    def compute_gaps(self, pieces: list[trimesh.Trimesh]) -> Gaps:
        """Return the distances from pieces; -inf where there are none."""
        if not pieces:
            return Gaps(self.points, np.full(len(self.points), -np.inf), np.zeros(0))
        solids = ConvexSolids(pieces)
        raised = solids.compute_depths_behind(self.points, self._directions)
        distance, _, _ = find_nearest(self.points, solids.vertices, solids.faces)
        return Gaps(self.points, np.where(raised > 0, raised, -distance), self._compute_protrusions(solids))

    def compute_gaps_of_sheet(self, sheet: trimesh.Trimesh) -> Gaps:
        """Return the distances from an open sheet with everything beneath it solid: a height field."""
        vertices, faces = np.asarray(sheet.vertices), np.asarray(sheet.faces)
        distance, face, nearest = find_nearest(self.points, vertices, faces)
        normals = _compute_normals(vertices, faces)
        height = np.einsum("ni,ni->n", self.points - nearest, normals[face])
        gaps = np.where(height < 0, distance, -distance)
        middles = sample_area(vertices, faces, _NUM_POINTS)
        distance, face, nearest = find_nearest(middles, self._vertices, self._faces)
        height = np.einsum("ni,ni->n", middles - nearest, self._normals[face])
        return Gaps(self.points, gaps, np.where(height > 0, distance, 0.0))

    def measure(self, pieces: list[trimesh.Trimesh], seconds: float = 0.0) -> ArenaQuality:
        """Return the distances from pieces as figures."""
        return self.summarize(self.compute_gaps(pieces), len(pieces), seconds)

    def summarize(self, gaps: Gaps, num_pieces: int, seconds: float = 0.0) -> ArenaQuality:
        """Return distances as figures."""
        uncovered = float((np.abs(gaps.gaps) > UNCOVERED_BEYOND).mean())
        return ArenaQuality.of_gaps(gaps.gaps, uncovered, num_pieces, seconds, gaps.protrusions)

    def measure_mesh(
        self, vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
    ) -> Float[np.ndarray, " N"]:
        """Return the distances of the samples from another mesh [m]."""
        return find_nearest(self.points, vertices, faces)[0]

    def _compute_protrusions(self, solids: ConvexSolids) -> Float[np.ndarray, " M"]:
        points = sample_area(solids.vertices, solids.faces, _NUM_POINTS)
        points = points[solids.compute_depths(points) <= _INSIDE]
        distance, face, nearest = find_nearest(points, self._vertices, self._faces)
        height = np.einsum("ni,ni->n", points - nearest, self._normals[face])
        is_touchable = height > -UNCOVERED_BEYOND
        return np.where(height > 0, distance, 0.0)[is_touchable]


def find_nearest(
    points: Float[np.ndarray, "N 3"], vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, " N"], Int[np.ndarray, " N"], Float[np.ndarray, "N 3"]]:
    """Return the distance [m], face and place of the nearest point of the faces, by libigl."""
    import igl

    if not len(points):
        return np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    squared, face, place = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
    )
    return np.sqrt(np.maximum(squared, 0.0)), np.asarray(face, dtype=np.int64), np.asarray(place)


def _compute_normals(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "F 3"]:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = cross_rows(b - a, c - a)
    return normals / np.maximum(compute_lengths(normals), _LEAST_LENGTH)[:, None]
