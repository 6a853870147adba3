"""Edges turn along creases, and stay where nothing is won."""

import numpy as np
import trimesh

from reconstruction._src.surfaces.edge_flips import flip_edges
from reconstruction._src.surfaces.quality import count_topology

# A step seen from the side: two vertices on the crest, one on the tread, one at the foot of the riser.
CREST, REAR_CREST, TREAD, FOOT = 0, 1, 2, 3
STEP = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.5, 1.0], [0.0, 0.5, 0.0]])
SURROUNDINGS = np.array(
    [[1.0, -0.6, 1.0], [1.0, 1.6, 1.0], [0.0, -0.6, 0.0], [0.0, 1.6, 0.0]]
)  # two more on the tread, two more at the foot


def make_step(is_bridged: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the step with the crest's edge, or with one from tread to foot across it."""
    middle = (
        [[CREST, FOOT, TREAD], [FOOT, REAR_CREST, TREAD]]
        if is_bridged
        else [[CREST, REAR_CREST, TREAD], [REAR_CREST, CREST, FOOT]]
    )
    rest = [[4, CREST, TREAD], [REAR_CREST, 5, TREAD], [6, FOOT, CREST], [FOOT, 7, REAR_CREST]]
    return np.concatenate([STEP, SURROUNDINGS]), np.array(middle + rest)


def sorted_faces(faces: np.ndarray) -> list[list[int]]:
    """Return faces in a form that tells nothing of their winding or order."""
    return sorted(sorted(face) for face in faces.tolist())


def test_an_edge_across_a_crest_turns_along_it():
    vertices, faces = make_step(is_bridged=True)
    assert count_topology(faces, 8).is_manifold
    turned = flip_edges(vertices, faces)
    assert [CREST, REAR_CREST, TREAD] in sorted_faces(turned)
    assert [CREST, REAR_CREST, FOOT] in sorted_faces(turned)
    before, after = (count_topology(f, 8) for f in (faces, turned))
    assert before == after


def test_an_edge_along_a_crest_stays():
    vertices, faces = make_step(is_bridged=False)
    np.testing.assert_array_equal(flip_edges(vertices, faces), faces)


def test_an_edge_does_not_turn_to_where_there_is_one():
    # A tetrahedron: every other diagonal is an edge already.
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    np.testing.assert_array_equal(flip_edges(vertices, faces), faces)


def test_the_faces_given_are_left_alone():
    vertices, faces = make_step(is_bridged=True)
    kept = faces.copy()
    flip_edges(vertices, faces)
    np.testing.assert_array_equal(faces, kept)


def test_many_edges_turn_at_once_and_the_rest_later():
    rng = np.random.default_rng(0)
    number = 20
    x, y = np.meshgrid(np.arange(number), np.arange(number), indexing="ij")
    vertices = np.stack([x, y, rng.normal(0, 0.5, x.shape)], axis=-1).reshape(-1, 3).astype(float)
    corner = (number * np.arange(number - 1)[:, None] + np.arange(number - 1)).ravel()
    lower = np.stack([corner, corner + number, corner + 1], axis=1)
    upper = np.stack([corner + number, corner + number + 1, corner + 1], axis=1)
    faces = np.concatenate([lower, upper])
    turned = flip_edges(vertices, faces)
    assert (turned != faces).any(axis=1).mean() > 0.2
    assert count_topology(turned, number**2) == count_topology(faces, number**2)
    assert measure_curvature(vertices, turned) < 0.95 * measure_curvature(vertices, faces)
    np.testing.assert_array_equal(flip_edges(vertices, faces.astype(np.int32)), turned)


def measure_curvature(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the total absolute curvature: length times angle of all edges."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    ends = vertices[mesh.face_adjacency_edges]
    return float((np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) * mesh.face_adjacency_angles).sum())
