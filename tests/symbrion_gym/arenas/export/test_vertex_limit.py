"""Solids with many vertices become several with few, of the same shape."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.export.formats import FEWEST_VERTICES, limit_vertices


def make_cylinder(sides: int, radius: float, height: float) -> trimesh.Trimesh:
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    hull = make_hull(np.concatenate([np.c_[ring, np.zeros(sides)], np.c_[ring, np.full(sides, height)]]))
    assert hull is not None
    return hull


def test_a_solid_within_the_limit_stays_as_it_is():
    box = trimesh.creation.box()
    parts, deviation = limit_vertices(box, FEWEST_VERTICES)
    assert parts == [box]
    assert deviation == 0.0


def test_corners_that_hardly_stick_out_are_dropped():
    """Of a circle of 1 m with 400 corners, 100 are within 0.12 mm: no cut is needed."""
    solid = make_cylinder(400, 0.1, 0.05)
    parts, deviation = limit_vertices(solid, 200)
    assert len(parts) == 1
    assert len(parts[0].vertices) <= 200
    assert 0 < deviation <= 2e-4
    assert parts[0].volume == pytest.approx(solid.volume, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("most", [8, 16, 64])
@pytest.mark.parametrize(
    "solid",
    [make_cylinder(120, 1.0, 0.1), trimesh.creation.icosphere(subdivisions=3, radius=0.3)],
    ids=["disk", "ball"],
)
def test_parts_fill_the_solid(solid, most):
    parts, deviation = limit_vertices(solid, most)
    assert len(parts) > 1
    assert max(len(part.vertices) for part in parts) <= most
    assert all(part.is_watertight and part.is_convex for part in parts)
    lost = solid.volume - sum(part.volume for part in parts)
    assert -1e-9 <= lost <= solid.area * deviation + 1e-9
    # No corner of the solid sticks out further than is said.
    corners = np.asarray(solid.vertices)
    outside = np.min([_find_outside(part, corners) for part in parts], axis=0)
    assert outside.max() <= deviation + 1e-9


def _find_outside(part: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Return how far points are beyond the faces of a convex solid, at least (0 within)."""
    beyond = np.einsum("nfi,fi->nf", points[:, None] - part.triangles[:, 0], part.face_normals)
    return np.maximum(beyond.max(axis=1), 0.0)


def test_equal_solids_give_equal_parts():
    solid = make_cylinder(120, 1.0, 0.1)
    first, second = (limit_vertices(solid.copy(), 16)[0] for _ in range(2))
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(first, second, strict=True))
