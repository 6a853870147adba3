"""Coarse meshes cut finer, and arenas of them."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from symbrion_gym._src.arenas.course import Course, StairsCourse, make_simple_surface
from symbrion_gym._src.contact.simplification import split_long_edges

EXACT = {
    "course": Course().surface(),
    "simple": make_simple_surface(Course()),
    "stairs": StairsCourse().surface(),
}


def count_parts(mesh):
    return len(trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces))))


@pytest.mark.parametrize("name", EXACT)
def test_the_surface_stays_the_same_and_hangs_together(name):
    fine = split_long_edges(EXACT[name])
    assert fine.area == pytest.approx(EXACT[name].area)
    assert fine.edges_unique_length.max() <= fine.extents.max() / 25 * (1 + 1e-9)
    assert count_parts(fine) == count_parts(EXACT[name])
    rim = trimesh.grouping.group_rows(fine.edges_sorted, require_count=1)
    assert len(rim) == len(fine.edges) - 2 * len(fine.face_adjacency)
    assert fine.is_winding_consistent


def test_fine_meshes_are_left_alone():
    mesh = make_scanned_surface(Course().profile(), num_vertices=800)
    assert split_long_edges(mesh) is mesh
