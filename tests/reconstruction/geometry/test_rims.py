"""Slivers that bridge ground at the rim go; low triangles of the ground, and all of a closed body, stay."""

import numpy as np
import trimesh

from reconstruction._src.geometry.mesh_repair import drop_rim_slivers, repair_mesh

ACROSS, ALONG = 11, 6


def make_trough(depth=0.2, edge=0.0):
    """Return a grid of 10 cm with a trough along y, and its faces; the row at the rim is bent in plan by `edge`."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, ACROSS), np.linspace(0.0, 0.5, ALONG))
    z = depth * (2.0 * x - 1.0) ** 2
    y[0] -= edge * (2.0 * x[0] - 1.0) ** 2
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, d), (a, d, c))])
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def make_fan():
    """Return the faces that a Delaunay triangulation adds between the ends of the rim."""
    return np.array([[i + 1, i, ACROSS - 1] for i in range(ACROSS - 2)])


def test_slivers_across_a_trough_go_one_behind_the_other():
    vertices, ground = make_trough()
    kept = drop_rim_slivers(vertices, np.concatenate([ground, make_fan()]))
    assert (kept[: len(ground)] == ground).all()
    # What is left of the fan has edges of no more than 5 median edges of 10 to 15 cm.
    left = vertices[kept[len(ground) :]]
    assert 0 < len(left) <= 5
    assert np.ptp(left[..., 0], axis=1).max() <= 0.65


def test_repair_drops_them_where_it_is_asked_for():
    vertices, ground = make_trough()
    mesh = trimesh.Trimesh(vertices, np.concatenate([ground, make_fan()]), process=False)
    assert len(repair_mesh(mesh, drops_slivers=True).faces) <= len(ground) + 5
    assert len(repair_mesh(mesh).faces) == len(mesh.faces)


def test_low_triangles_of_flat_ground_stay():
    vertices, ground = make_trough(depth=0.0, edge=0.05)
    faces = np.concatenate([ground, make_fan()])
    np.testing.assert_array_equal(drop_rim_slivers(vertices, faces), faces)


def test_low_triangles_of_a_closed_body_stay():
    body = trimesh.creation.cylinder(radius=1.0, height=0.1, sections=64)
    faces = np.asarray(body.faces)
    np.testing.assert_array_equal(drop_rim_slivers(body.vertices, faces), faces)
