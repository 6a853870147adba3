"""Objects of known shape: a wall socket, a docking station, a box and a tag. Meters; x ahead, z up.

The origin of a socket and of a tag is the middle of the back that lies on the wall, x out of the wall; that of a
station and of a box is the middle of the foot.
"""

from __future__ import annotations

import numpy as np
import trimesh

SOCKET_SIZE = (0.055, 0.105, 0.140)
"""Depth, width and height of the housing of a surface-mounted industrial socket, 16 A [m]: the usual outer sizes of
makers of CEE (IEC 60309) wall sockets, rounded to 5 mm."""
SNOUT = (0.036, 0.065, np.radians(20.0))
"""Radius and length of its snout [m], and how far it points downwards [rad]."""
BORE = (0.026, 0.045)
"""Radius and depth of the opening in the snout [m]."""


def make_socket() -> trimesh.Trimesh:
    """Make a wall socket: a housing with a round snout that points down by 20 degrees and is open in front."""
    depth, width, height = SOCKET_SIZE
    housing = _place_box((depth / 2, 0, 0), (depth, width, height))
    radius, length, tilt = SNOUT
    turn = trimesh.transformations.rotation_matrix(np.pi / 2 + tilt, [0, 1, 0])
    axis = turn[:3, :3] @ [0, 0, 1]
    root = np.array([depth - 0.02, 0, 0.01])
    snout = _place_cylinder(root, axis, radius, length + 0.02, turn)
    bore = _place_cylinder(root + (length + 0.02 - BORE[1]) * axis, axis, BORE[0], BORE[1] + 0.01, turn)
    return trimesh.boolean.difference([trimesh.boolean.union([housing, snout], engine="manifold"), bore])


def make_station() -> trimesh.Trimesh:
    """Make a docking station: a plate on the ground, a tower with a slanted top, and a socket plate that sticks out."""
    plate = _place_box((0.0, 0.0, 0.01), (0.30, 0.26, 0.02))
    profile = [(-0.15, 0.0), (-0.03, 0.0), (-0.03, 0.14), (-0.10, 0.24), (-0.15, 0.24)]
    corners = np.array([(x, y, z) for x, z in profile for y in (-0.11, 0.11)])
    tower = trimesh.convex.convex_hull(corners)
    dock = _place_box((-0.02, 0.0, 0.0525 + 0.02), (0.04, 0.105, 0.105))
    return trimesh.boolean.union([plate, tower, dock], engine="manifold")


def make_box() -> trimesh.Trimesh:
    """Make a box of 0.30 x 0.20 x 0.15 m."""
    return _place_box((0, 0, 0.075), (0.30, 0.20, 0.15))


def make_tag() -> trimesh.Trimesh:
    """Make a tag: a plate of 0.20 x 0.20 m, 6 mm thick, with a raised rim of 15 x 15 mm."""
    plate = _place_box((0.003, 0, 0), (0.006, 0.20, 0.20))
    sides = [_place_box((0.0075, s * 0.0925, 0), (0.015, 0.015, 0.20)) for s in (-1, 1)]
    ends = [_place_box((0.0075, 0, s * 0.0925), (0.015, 0.20, 0.015)) for s in (-1, 1)]
    return trimesh.boolean.union([plate, *sides, *ends], engine="manifold")


OBJECTS = {"socket": make_socket, "station": make_station, "box": make_box, "tag": make_tag}
"""Name -> function that makes the mesh."""


def _place_box(center: tuple, size: tuple) -> trimesh.Trimesh:
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(center))


def _place_cylinder(
    root: np.ndarray, axis: np.ndarray, radius: float, length: float, turn: np.ndarray
) -> trimesh.Trimesh:
    """Make a cylinder from a root along an axis."""
    place = turn.copy()
    place[:3, 3] = root + length / 2 * axis
    return trimesh.creation.cylinder(radius, length, sections=24, transform=place)
