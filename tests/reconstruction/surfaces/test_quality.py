"""Quality measures, against shapes whose answer is known by hand."""

import numpy as np
import pytest
import trimesh
from shapes import make_floor

from reconstruction._src.surfaces.quality import compute_distances, count_topology, measure_quality


def make_sheet(side: int) -> trimesh.Trimesh:
    """Return a flat sheet of so many vertices along a side, one unit apart."""
    return trimesh.Trimesh(*make_floor(side, side - 1.0), process=False)


@pytest.mark.parametrize(
    ("mesh", "euler_number", "loops"),
    [
        (trimesh.creation.icosphere(subdivisions=2), 2, 0),
        (trimesh.creation.torus(2.0, 0.5, 12, 8), 0, 0),
        (make_sheet(5), 1, 1),
        (trimesh.creation.annulus(1, 2, 1), 0, 0),
    ],
)
def test_known_shapes_have_their_topology(mesh, euler_number, loops):
    topology = count_topology(mesh.faces, len(mesh.vertices))
    assert topology.euler_number == euler_number
    assert topology.boundary_loops == loops
    assert topology.is_manifold
    assert topology.components == 1


def test_a_hole_and_an_unused_vertex_are_seen():
    sheet = make_sheet(6)
    inside = [i for i, face in enumerate(sheet.faces) if 14 in face]
    faces = np.delete(sheet.faces, inside, axis=0)
    topology = count_topology(faces, 36)
    assert (topology.boundary_loops, topology.unused_vertices, topology.euler_number) == (2, 1, 0)
    assert topology.boundary_edges == 20 + 6


def test_spoiled_meshes_are_seen():
    two_triangles_at_a_vertex = np.array([[0, 1, 2], [0, 3, 4]])
    assert count_topology(two_triangles_at_a_vertex, 5).pinched_vertices == 1
    three_at_an_edge = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    topology = count_topology(three_at_an_edge, 5)
    assert topology.non_manifold_edges == 1
    assert topology.miswound_edges == 1
    assert count_topology(np.array([[0, 1, 2], [0, 1, 3]]), 4).miswound_edges == 1
    assert count_topology(np.array([[0, 1, 2], [3, 4, 5]]), 6).components == 2


def test_no_faces_is_a_result_too():
    quality = measure_quality(
        trimesh.Trimesh(np.zeros((3, 3)), np.zeros((0, 3), int), process=False), np.zeros((5, 3))
    )
    assert quality.topology.num_faces == 0
    assert quality.cloud_to_mesh is None


def test_distances_go_to_the_faces_not_to_the_vertices():
    sheet = make_sheet(2)
    found = compute_distances(np.array([[0.5, 0.4, 0.3], [2.0, 0.5, 0.0]]), sheet.vertices, sheet.faces)
    np.testing.assert_allclose(found, [0.3, 1.0])


def test_a_lifted_sheet_is_as_far_as_it_was_lifted():
    sheet = make_sheet(5)
    lifted = sheet.copy()
    lifted.apply_translation([0, 0, 0.25])
    quality = measure_quality(sheet, points=lifted.vertices, truth=lifted)
    for distances in (quality.cloud_to_mesh, quality.truth_to_mesh, quality.mesh_to_truth):
        assert distances is not None
        assert distances.mean == pytest.approx(0.25)
        assert distances.max == pytest.approx(0.25)
    assert quality.hausdorff == pytest.approx(0.25)
    assert quality.area == pytest.approx(16)
    assert (quality.self_intersections, quality.folds) == (0, 0)
    assert quality.min_angle == pytest.approx(np.pi / 4)
    assert quality == measure_quality(sheet, points=lifted.vertices, truth=lifted)
    assert quality.as_dict()["topology"]["boundary_loops"] == 1


def test_a_face_turned_over_is_folded():
    sheet = make_sheet(6)
    sheet.vertices[14] += [1.5, 1.5, 0]
    quality = measure_quality(sheet)
    assert quality.self_intersections > 0
    assert quality.folds > 0
