"""A stretched arena is longer, and otherwise the same."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.halfspaces import find_box
from symbrion_gym._src.arenas.arena import Arena, stretch_arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.contact.quality import ArenaQuality


def test_stretching_the_truth_widens_its_pit() -> None:
    stretched = stretch_arena(load_arena("truth", Course(pit=0.40)), 1.05)
    wider = Arena.from_course(Course(pit=0.42, floor=1.68, ramp=1.05, plateau=0.525))
    assert isinstance(stretched.course, Course)
    assert stretched.course.pit == pytest.approx(0.42)
    x = np.linspace(-3.4, 3.4, 200)
    np.testing.assert_allclose(stretched.height(x, 0.1), wider.height(x, 0.1), atol=1e-9)
    assert all(piece.is_convex for piece in stretched.pieces)


@pytest.mark.parametrize("name", ["truth", "gsrm", "gg"])
def test_boxes_stay_boxes_with_their_tops_where_the_ground_is(name):
    arena = load_arena(name)
    stretched = stretch_arena(arena, 1.03)
    for piece, wider in zip(arena.pieces, stretched.pieces, strict=True):
        assert (find_box(piece) is None) == (find_box(wider) is None)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-2.9, 2.9, 120), (-0.7, 0.0, 0.7)))
    tops = [
        np.max([_find_top(piece, s * x, y) for piece in one.pieces], axis=0)
        for one, s in ((arena, 1.0), (stretched, 1.03))
    ]
    assert np.percentile(np.abs(tops[0] - tops[1]), 98) < 1e-3


def _find_top(piece, x, y):
    """Return the height of a convex piece; -inf beside it."""
    n, offset = piece.face_normals, (piece.face_normals * piece.triangles[:, 0]).sum(axis=1)
    rest = offset - np.outer(x, n[:, 0]) - np.outer(y, n[:, 1])
    up, down, level = n[:, 2] > 1e-6, n[:, 2] < -1e-6, np.abs(n[:, 2]) <= 1e-6
    high, low = (rest[:, up] / n[up, 2]).min(axis=1), (rest[:, down] / n[down, 2]).max(axis=1)
    return np.where((low <= high) & (rest[:, level] >= 0).all(axis=1), high, -np.inf)


def test_what_lies_at_the_center_stays():
    piece = trimesh.creation.box((1.0, 1.0, 0.1)).apply_translation([50.5, 0.0, 0.0])
    arena = Arena("box", [piece], piece, ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=1))
    stretched = stretch_arena(arena, 1.025, center=50.0)
    for mesh in (stretched.surface, stretched.pieces[0]):
        assert mesh.bounds[:, 0] == pytest.approx([50.0, 51.025])
