"""What is gone: not read again though all around it was, or passed by rays."""

import numpy as np
import pytest
from shapes import make_floor
from shapes import read_floor as read

from reconstruction._src.knowledge.changes import detect_changes, find_gone, find_read

SIDE = 21
SPACING = 0.1


@pytest.fixture(scope="module")
def sheet() -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet 2 m x 2 m: (vertices, faces)."""
    return make_floor()


def test_a_hole_in_a_whole_scan_is_gone_and_what_was_out_of_sight_is_not(sheet):
    new = read(8000, seed=1)
    in_hole = (np.abs(new[:, :2] - 1) < 0.4).all(axis=1)
    change = detect_changes(*sheet, read(8000), new[~in_hole], SPACING)
    assert change.is_gone[np.linalg.norm(sheet[0] - [1, 1, 0], axis=1) < 0.2].all()
    corner = new[(new[:, :2] < 0.8).all(axis=1)]
    assert not detect_changes(*sheet, read(8000), corner, SPACING).is_gone.any()


def lay_ring(inner: float, outer: float, missing: float = 0.0) -> np.ndarray:
    """Readings on a ring round the middle of the sheet, but for a sector of some degrees."""
    angle, radius = np.meshgrid(np.radians(np.arange(missing, 360, 3)), np.linspace(inner, outer, 4))
    flat = np.zeros(angle.size)
    return np.column_stack([1 + (radius * np.cos(angle)).ravel(), 1 + (radius * np.sin(angle)).ravel(), flat])


@pytest.mark.parametrize(
    ("readings", "is_surrounded"),
    [
        (lay_ring(0.4, 0.5), True),
        (lay_ring(1.10, 1.15), True),
        (lay_ring(1.22, 1.28), False),
        (lay_ring(0.4, 0.5, missing=70), False),
        (lay_ring(0.05, 0.2), False),
    ],
)
def test_a_patch_is_gone_if_readings_lie_just_beyond_it_on_all_sides(sheet, readings, is_surrounded):
    """A patch of radius 0.3 m; just beyond is within its radius and six times the spacing."""
    vertices, faces = sheet
    patch = np.linalg.norm(vertices - [1, 1, 0], axis=1) < 0.31
    is_read = ~patch
    is_read[vertices[:, 0] < 0.45] = False
    is_gone = find_gone(vertices, faces, readings, is_read, SPACING)
    assert is_gone.dtype == bool
    assert np.array_equal(is_gone, patch if is_surrounded else np.zeros_like(patch))


def test_one_or_two_vertices_without_readings_are_no_hole_and_every_hole_is_looked_at_alone(sheet):
    vertices, faces = sheet
    middle = SIDE * 10 + 10
    is_read = vertices[:, 0] > 0.45
    for unread, is_hole in (([0], False), ([0, 1], False), ([0, 1, SIDE], True)):
        missing = middle + np.array(unread)
        is_gone = find_gone(
            vertices, faces, lay_ring(0.3, 0.4), is_read & ~np.isin(np.arange(SIDE**2), missing), SPACING
        )
        assert np.flatnonzero(is_gone).tolist() == (missing.tolist() if is_hole else [])


def test_a_scan_of_nearly_all_shows_what_is_gone_wherever_it_is(sheet):
    vertices, faces = sheet
    for width, is_whole in ((3, True), (5, False)):
        is_edge = vertices[:, 0] < (width - 0.5) * SPACING
        readings = vertices[~is_edge]
        is_gone = find_gone(vertices, faces, readings, ~is_edge, SPACING)
        assert np.array_equal(is_gone, is_edge if is_whole else np.zeros_like(is_edge))
    loose = np.concatenate([vertices, [[5.0, 5.0, 5.0]]])
    nothing = find_gone(loose, faces, vertices, np.r_[np.ones(SIDE**2, dtype=bool), False], SPACING)
    assert nothing.dtype == bool
    assert not nothing.any(), "a vertex of no face cannot go"


def test_a_vertex_is_read_where_a_reading_is_as_near_as_readings_are_dense():
    """Readings 5 cm apart: a vertex within 7.5 cm and its own spacing of one is read."""
    x, y = np.meshgrid(0.05 * np.arange(21), 0.05 * np.arange(21))
    readings = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    vertices = np.array(
        [[0.5, 0.5, 0.0], [0.5, 0.5, 0.17], [0.5, 0.5, 0.18], [1.17, 1.0, 0.0], [1.18, 1.0, 0.0]]
    )
    is_read = find_read(vertices, readings, SPACING)
    assert is_read.tolist() == [True, True, False, True, False]
    assert is_read.dtype == bool
    few = find_read(vertices, readings[:2], SPACING)
    assert not few.any()


def test_what_rays_pass_through_is_gone(sheet):
    """A floor a meter below the sheet is seen from a meter above its middle."""
    new = read(4000, seed=1)
    under = (np.abs(new[:, :2] - 1) < 0.5).all(axis=1)
    new[under, 2] -= 1.0
    origins = new * [1, 1, 0] + [0, 0, 1.0]
    gone = detect_changes(*sheet, read(8000), new, SPACING, origins).is_gone
    inside = (np.abs(sheet[0][:, :2] - 1) < 0.35).all(axis=1)
    assert gone[inside].all()
    assert not gone[(np.abs(sheet[0][:, :2] - 1) > 0.65).any(axis=1)].any()
