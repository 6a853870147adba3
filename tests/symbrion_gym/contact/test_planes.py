"""Planes found in noisy meshes."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact.planes import Planes, find_planes, share_planes
from symbrion_gym._src.errors import ArenaError


@pytest.mark.slow
@pytest.mark.parametrize(("num_vertices", "noise"), [(2200, 0.005), (7000, 0.003)])
def test_finds_the_planes_of_the_course_closer_than_the_noise(num_vertices, noise):
    mesh = make_scanned_surface(Course(pit=0.40).profile(), num_vertices=num_vertices, noise=noise)
    planes = find_planes(mesh, 0.003)
    tilt, rise = 0.25 / np.hypot(1.0, 0.25), 1.0 / np.hypot(1.0, 0.25)
    wanted = [(0, 1, 0), (0, 1, 0.25), (-1, 0, -0.2), (1, 0, -0.2)]
    wanted += [(-tilt, rise, 1.7 * tilt), (tilt, rise, 1.7 * tilt)]
    for x, z, offset in wanted:
        gap = np.abs(planes.normals - [x, 0, z]).max(axis=1) + np.abs(planes.offsets - offset)
        assert gap.min() < 0.015, (x, z, offset)


def test_refuses_a_mesh_without_area():
    with pytest.raises(ArenaError, match="area"):
        find_planes(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False), 0.003)


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


@pytest.mark.parametrize(("height", "offsets"), [(0.001, [0.001 / 3] * 3), (0.01, [0.0, 0.01, 0.0])])
def test_level_squares_get_their_mean_height_unless_a_step_is_above_the_tolerance(height, offsets):
    mesh, planes = make_squares([0.0, height, 0.0])
    shared = share_planes(mesh, planes, 0.003)
    assert np.allclose(shared.normals, [0.0, 0.0, 1.0])
    assert shared.offsets == pytest.approx(np.array(offsets), abs=1e-9)
    assert np.array_equal(shared.labels, planes.labels)


def test_sides_that_face_away_from_each_other_stay_apart():
    mesh, planes = make_squares([0.0, 0.0])
    turned = planes._replace(normals=planes.normals * [[1.0], [-1.0]])
    assert np.array_equal(share_planes(mesh, turned, 0.003).normals, turned.normals)
