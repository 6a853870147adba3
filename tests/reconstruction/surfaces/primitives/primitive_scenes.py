"""Scenes of known shapes, with noise."""

import numpy as np
import trimesh

NOISE = 0.001


def make_noisy(
    solid: trimesh.Trimesh, seed: int = 0, edge: float = 0.05, noise: float = NOISE
) -> trimesh.Trimesh:
    """Return the surface of a solid in small triangles, its vertices off by a noise [m]."""
    vertices, faces = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, edge)[:2]
    mesh = trimesh.Trimesh(vertices, faces)
    mesh.merge_vertices()
    shift = np.random.default_rng(seed).normal(0.0, noise, mesh.vertices.shape)
    return trimesh.Trimesh(mesh.vertices + shift, mesh.faces, process=False)


def make_box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return a box."""
    return trimesh.creation.box(size).apply_translation(center)


def make_sphere_on_plane() -> trimesh.Trimesh:
    """Return a sphere of 0.3 m, a third of it sunk into a floor of 2 x 2 m."""
    floor = make_box((2.0, 2.0, 0.5), (0.0, 0.0, -0.25))
    return trimesh.boolean.union(
        [floor, trimesh.creation.icosphere(3, 0.3).apply_translation((0.2, 0.1, 0.1))]
    )


def make_column_room() -> trimesh.Trimesh:
    """Return the inside of a room of 2 x 1.6 x 1 m with a column of 0.2 m from floor to ceiling; faces look inwards."""
    column = trimesh.creation.cylinder(0.2, 1.4, sections=24).apply_translation((0.3, 0.2, 0.5))
    inside = trimesh.boolean.difference([make_box((2.0, 1.6, 1.0), (0.0, 0.0, 0.5)), column])
    inside.invert()
    return inside
