"""Small arenas for tests of swarms: a floor with things on it."""

import numpy as np
import trimesh

import symbrion_gym as sg
from symbrion_gym._src.contact.quality import ArenaQuality


def make_floor(*things: trimesh.Trimesh, tilt: float = 0.0) -> sg.Arena:
    """Return a floor of 4 x 4 m about the origin, tilted up along x by an angle [rad], with things on it."""
    x, z = 2.0, 2.0 * np.tan(tilt)
    corners = np.array([[-x, -2.0, -z], [x, -2.0, z], [x, 2.0, z], [-x, 2.0, -z]])
    floor = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    surface = trimesh.util.concatenate([floor, *things])
    piece = trimesh.creation.box((4.0, 4.0, 0.1), trimesh.transformations.translation_matrix([0, 0, -0.05]))
    return sg.Arena("made", [piece], surface, ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=1))


def make_sheet(x: float) -> trimesh.Trimesh:
    """Return a wall without thickness across the floor, 0.3 m high."""
    corners = np.array([[x, -2.0, 0.0], [x, 2.0, 0.0], [x, 2.0, 0.3], [x, -2.0, 0.3]])
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def make_block(x: float, y: float, size: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return a box that stands on the floor about a place."""
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix([x, y, size[2] / 2]))
