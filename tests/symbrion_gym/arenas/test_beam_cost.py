"""What a beam costs in MuJoCo's trees, and where primitives pay."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.surfaces.primitives.find import Primitives
from reconstruction._src.surfaces.primitives.primitive import Primitive
from symbrion_gym._src.arenas.primitives import compute_beam_cost, pays

NONE = Primitives([], 0.004)


def make_ground(extent: float = 2.0) -> trimesh.Trimesh:
    """Return rough ground of 2 m x 2 m."""
    box = trimesh.creation.box((extent, extent, 0.2)).subdivide_to_size(0.1)
    ground = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] > 0.5])
    ground.vertices[:, 2] += np.random.default_rng(0).normal(0, 0.001, len(ground.vertices))
    return ground


def make_floor(half: float) -> Primitives:
    plane = Primitive("plane", np.array([0.0, 0.0, 0.098]), np.eye(3), np.array([half, half, 0.002]))
    return NONE._replace(shapes=[plane])


def test_two_triangles_in_one_box_cost_its_node_and_two_leaves():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], float)
    square = trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False)
    assert 1.0 <= compute_beam_cost(square, NONE) <= 3.5  # MuJoCo turns the mesh into its own frame


def test_cost_is_the_same_at_any_scale():
    ground = make_ground()
    larger = ground.copy().apply_scale(10.0)
    assert compute_beam_cost(larger, NONE) == pytest.approx(compute_beam_cost(ground, NONE), rel=0.02)


def test_a_rectangle_pays_where_it_replaces_most_triangles():
    ground = make_ground()
    assert compute_beam_cost(ground, make_floor(0.95)) < 0.5 * compute_beam_cost(ground, NONE)
    assert pays(ground, make_floor(0.95))
    assert not pays(ground, make_floor(0.2))
    assert pays(ground, NONE)
