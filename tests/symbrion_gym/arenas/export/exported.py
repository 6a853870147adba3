"""Arenas that the tests of export share."""

import numpy as np
import trimesh

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality


def make_mixed_arena() -> Arena:
    """Return an arena of a turned box, a box on its side, a wedge and a ball of 162 vertices, under a wavy surface."""
    turned = trimesh.creation.box((1.0, 0.6, 0.2))
    turned.apply_transform(trimesh.transformations.euler_matrix(0.3, -0.4, 0.5))
    upright = trimesh.creation.box((0.3, 0.4, 0.5))
    upright.apply_transform(trimesh.transformations.euler_matrix(0.2, np.pi / 2, 0.0))  # a gimbal lock
    wedge = make_hull(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 0.4], [0, 1, 0.4]], float))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.25)
    assert wedge is not None
    pieces = [turned, upright, wedge, ball]
    for i, piece in enumerate(pieces):
        piece.apply_translation([2.0 * i, 0.5 * i, 0.1 * i])
    x, y = np.meshgrid(np.linspace(-1, 7, 20), np.linspace(-1, 3, 10))
    grid = HeightField(0.1 * np.sin(x) + 0.02 * y, np.array([-1.0, -1.0]), np.array([7.0, 3.0]))
    return Arena("mixed", pieces, grid.as_mesh(), ArenaQuality(0.001, 0.002, 0.003, 4), friction=0.6)


def make_field_arena() -> Arena:
    """Return an arena of the kind "hfield" without any symmetry."""
    x, y = np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 1, 6))
    field = HeightField(
        0.1 * x + 0.3 * y**2 + 0.05 * np.sin(7 * x), np.array([1.0, -2.0]), np.array([3.0, -1.0])
    )
    quality = ArenaQuality(0.0, 0.0, 0.0, 0)
    return Arena("field", [], field.as_mesh(), quality, kind="hfield", height_field=field)
