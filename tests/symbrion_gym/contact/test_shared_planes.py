"""One plane for regions that lie apart on it."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.planes import Planes
from symbrion_gym._src.contact.seams import share_planes


def make_squares(heights: list[float]) -> tuple[trimesh.Trimesh, Planes]:
    """Return level squares of a meter, a meter apart, each a region of its own."""
    grid = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    vertices, faces = [], []
    for k, height in enumerate(heights):
        vertices += [[x + 2 * k, y, height] for x, y in grid]
        faces += [[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    normals = np.tile([0.0, 0.0, 1.0], (len(heights), 1))
    labels = np.repeat(np.arange(len(heights)), 2)
    return mesh, Planes(normals, np.array(heights), labels, 0.0)


def test_level_squares_at_almost_one_height_get_their_mean_height():
    mesh, planes = make_squares([0.0, 0.001, 0.0])
    shared = share_planes(mesh, planes, 0.003)
    assert np.allclose(shared.normals[0], [0.0, 0.0, 1.0])
    assert shared.offsets == pytest.approx(np.full(3, 0.001 / 3), abs=1e-9)
    assert np.array_equal(shared.labels, planes.labels)


def test_a_step_above_the_tolerance_stays():
    mesh, planes = make_squares([0.0, 0.01, 0.0])
    shared = share_planes(mesh, planes, 0.003)
    assert shared.offsets[1] == pytest.approx(0.01)
    assert shared.offsets[0] == shared.offsets[2] == pytest.approx(0.0)


def test_sides_that_face_away_from_each_other_stay_apart():
    mesh, planes = make_squares([0.0, 0.0])
    turned = planes._replace(normals=planes.normals * [[1.0], [-1.0]])
    assert np.array_equal(share_planes(mesh, turned, 0.003).normals, turned.normals)


def test_equal_meshes_share_equal_planes():
    mesh, planes = make_squares([0.0, 0.0005, 0.001])
    first, second = share_planes(mesh, planes, 0.003), share_planes(mesh.copy(), planes, 0.003)
    assert np.array_equal(first.normals, second.normals)
    assert np.array_equal(first.offsets, second.offsets)


def test_without_planes_there_is_nothing_to_share():
    mesh, planes = make_squares([0.0, 0.001])
    none = planes._replace(normals=np.zeros((0, 3)), offsets=np.zeros(0), labels=np.full(len(mesh.faces), -1))
    assert share_planes(mesh, none, 0.003) is none
