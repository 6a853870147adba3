"""Planes found in noisy meshes."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact.planes import find_planes
from symbrion_gym._src.errors import ArenaError


@pytest.mark.parametrize(("num_vertices", "noise"), [(2200, 0.002), (2200, 0.005), (7000, 0.003)])
def test_finds_the_planes_of_the_course_closer_than_the_noise(num_vertices, noise):
    mesh = make_scanned_surface(Course(pit=0.40).profile(), num_vertices=num_vertices, noise=noise)
    planes = find_planes(mesh, 0.003)
    tilt = 0.25 / np.hypot(1.0, 0.25)
    rise = 1.0 / np.hypot(1.0, 0.25)
    wanted = [
        (0, 1, 0),
        (0, 1, 0.25),
        (-tilt, rise, 1.7 * tilt),
        (tilt, rise, 1.7 * tilt),
        (-1, 0, -0.2),
        (1, 0, -0.2),
    ]
    for x, z, offset in wanted:
        gap = np.abs(planes.normals - [x, 0, z]).max(axis=1) + np.abs(planes.offsets - offset)
        assert gap.min() < 0.015, (x, z, offset)


def test_equal_meshes_give_equal_planes():
    mesh = make_scanned_surface(Course(pit=0.40).profile(), num_vertices=800)
    first, second = find_planes(mesh, 0.003), find_planes(mesh.copy(), 0.003)
    assert np.array_equal(first.labels, second.labels)
    assert np.array_equal(first.normals, second.normals)


def test_refuses_a_mesh_without_area():
    with pytest.raises(ArenaError, match="area"):
        find_planes(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False), 0.003)
