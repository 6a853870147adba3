"""Open surfaces closed, and their shapes told apart."""

import numpy as np
import pytest
import trimesh
from scanned_surface import cut_irregular, make_scanned_surface

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.mesh_repair import repair_mesh
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact.simplification import close_holes, find_shape, take_top

BLOCK = trimesh.creation.box([2.0, 1.0, 0.2])


@pytest.fixture(scope="module")
def terrain():
    return repair_mesh(cut_irregular(make_scanned_surface(Course().profile(), num_vertices=900), 0.3))


def make_tunnel():
    angle, y = np.meshgrid(np.linspace(0, 2 * np.pi, 30), np.linspace(0, 2, 15))
    i = (np.arange(14)[:, None] * 30 + np.arange(29)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 30], 1), np.stack([i + 1, i + 31, i + 30], 1)])
    return trimesh.Trimesh(
        np.stack([np.cos(angle), y, np.sin(angle)], -1).reshape(-1, 3), faces[:, ::-1], process=False
    )


def test_shapes(terrain):
    def find(mesh):
        return find_shape(mesh, Elevation(mesh))

    assert find(terrain) == "terrain"
    assert find(BLOCK) == "terrain"
    assert find(trimesh.creation.icosphere()) == "closed"
    assert find(make_tunnel()) == "overhang"


def test_the_top_of_a_closed_terrain_has_no_underside():
    assert take_top(BLOCK).bounds == pytest.approx(np.array([[-1.0, -0.5, 0.1], [1.0, 0.5, 0.1]]))


def test_small_holes_close_and_large_ones_do_not(terrain):
    ball = trimesh.creation.icosphere(subdivisions=3)
    torn = trimesh.Trimesh(ball.vertices, ball.faces[1:], process=False)
    assert close_holes(torn).is_watertight
    is_kept = np.ones(len(ball.faces), dtype=bool)
    is_kept[np.abs(ball.triangles_center).argmax(axis=0)] = False
    assert close_holes(trimesh.Trimesh(ball.vertices, ball.faces[is_kept], process=False)).is_watertight
    assert not close_holes(make_tunnel()).is_watertight
    assert close_holes(terrain) is terrain
