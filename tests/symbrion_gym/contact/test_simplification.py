"""Simplification of surfaces: drawn ones are known to the last step, scanned ones within their noise."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.contact.simplification import is_drawn, split_long_edges

RISE, RUN, STEPS = 0.17, 0.28, 6


@pytest.fixture(scope="module")
def stairs():
    """Return a floor and six closed boxes on it, each reaching 2 cm into the next."""
    boxes = [[[-1.0, -1.0, -0.1], [3.0, 1.0, 0.0]]]
    boxes += [[[i * RUN, -0.6, 0.0], [(i + 1) * RUN + 0.02, 0.6, (i + 1) * RISE]] for i in range(STEPS)]
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes])
    mesh.merge_vertices()
    return mesh


@pytest.mark.slow
def test_every_tread_of_overlapping_boxes_keeps_its_height(stairs):
    ground = Elevation(*make_arena(stairs, cache=False).pieces)
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.01, 0.27, 20), np.linspace(-0.59, 0.59, 60)))
    for step in range(STEPS):
        assert ground.height(x + step * RUN, y) == pytest.approx((step + 1) * RISE, abs=0.003)


def test_boxes_are_drawn_and_noisy_ones_are_not(stairs):
    assert is_drawn(stairs)
    fine = trimesh.creation.box().subdivide().subdivide().subdivide()
    assert is_drawn(fine)
    rng = np.random.default_rng(0)
    noisy = trimesh.Trimesh(fine.vertices + rng.normal(scale=0.003, size=fine.vertices.shape), fine.faces)
    assert not is_drawn(noisy)


def count_parts(mesh):
    return len(trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces))))


@pytest.mark.parametrize("mesh", [Course().surface(), StairsCourse().surface()])
def test_the_surface_stays_the_same_and_hangs_together(mesh):
    fine = split_long_edges(mesh)
    assert fine.area == pytest.approx(mesh.area)
    assert fine.edges_unique_length.max() <= fine.extents.max() / 25 * (1 + 1e-9)
    assert count_parts(fine) == count_parts(mesh)
    rim = trimesh.grouping.group_rows(fine.edges_sorted, require_count=1)
    assert len(rim) == len(fine.edges) - 2 * len(fine.face_adjacency)
    assert fine.is_winding_consistent


def test_fine_meshes_are_left_alone():
    mesh = make_scanned_surface(Course().profile(), num_vertices=800)
    assert split_long_edges(mesh) is mesh
