"""United slabs and what coacd makes of them."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact.planes import find_planes
from symbrion_gym._src.contact.slab_union import find_heading, has_moved, restore_planes, unite_slabs
from symbrion_gym._src.errors import ArenaError


def turn(mesh, yaw):
    return mesh.copy().apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))


def test_the_union_is_one_closed_solid():
    pieces = Course(pit=0.40).pieces()
    solid = unite_slabs(pieces)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(unite_slabs(pieces, 0.3).volume, rel=0.002)
    with pytest.raises(ArenaError):
        unite_slabs([])


@pytest.mark.parametrize("yaw", [0.0, 0.35, -0.6])
def test_the_heading_is_that_of_the_course(yaw):
    mesh = turn(make_scanned_surface(Course(pit=0.40).profile(), num_vertices=800), yaw)
    assert find_heading(find_planes(mesh, 0.003), mesh.area_faces) == pytest.approx(yaw, abs=0.02)


def test_a_moved_wall_and_a_filled_pit_are_noticed():
    pieces = Course(pit=0.40).pieces()
    assert not has_moved(pieces, pieces)
    assert not has_moved([turn(piece, 0.0).apply_translation([0.001, 0, 0]) for piece in pieces], pieces)
    assert has_moved(Course(pit=0.41).pieces(), pieces)
    assert has_moved([unite_slabs(pieces).convex_hull], pieces)


def test_hulls_that_bulge_get_the_planes_of_the_slabs_back():
    pieces = Course(pit=0.40).pieces()
    bent = np.array(pieces[0].vertices)
    bent[bent[:, 2] > -0.1, 2] += 0.0015
    restored = restore_planes([make_hull(bent)], pieces[:1])
    assert restored[0].bounds == pytest.approx(pieces[0].bounds, abs=1e-5)


def test_pieces_that_fill_a_pit_get_no_planes():
    pieces = Course(pit=0.40).pieces()
    with pytest.raises(ArenaError, match="bends planes"):
        restore_planes([unite_slabs(pieces).convex_hull], pieces)
