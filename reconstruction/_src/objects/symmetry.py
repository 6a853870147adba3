"""Rotations under which an object looks the same, and angles between poses that leave them out of account."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.sampling import sample_area

if TYPE_CHECKING:
    import trimesh

SAME = 0.01
"""Two shapes are the same where no sample is farther from the other than this share of the diameter."""
_SAME_AXIS = np.cos(np.deg2rad(3.0))
"""Axes of inertia that deviate less from x, y or z than 3 degrees are taken as these."""
_NUM_SAMPLES = 1500
_FOLDS = (2, 3, 4, 6)
_ROUND_STEPS = 36
"""A body of revolution is taken as one with this many equal positions."""


def find_symmetries(mesh: trimesh.Trimesh, center: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "S 3 3"]:
    """Return the rotations about a center that map a mesh onto itself, the identity first.

    Tried are rotations by full fractions of a turn about the axes x, y, z and the axes of inertia;
    combinations of those found belong to the result as well.
    """
    points = sample_area(np.asarray(mesh.vertices), np.asarray(mesh.faces), _NUM_SAMPLES, 0) - center
    _, axes = np.linalg.eigh(points.T @ points)
    limit = SAME * 2 * float(np.linalg.norm(points, axis=1).max())
    found = [np.eye(3)]
    own = [axis for axis in axes.T if np.abs(axis).max() < _SAME_AXIS]
    for axis in [*np.eye(3), *own]:
        if is_same(mesh, center, points, make_turn(axis, 2.0), limit):  # no symmetry but that of revolution
            found = [make_turn(axis, 2 * np.pi * k / _ROUND_STEPS) for k in range(_ROUND_STEPS)]
            flip = make_turn(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]), np.pi)
            return _close_group([*found[:2], *([flip] if is_same(mesh, center, points, flip, limit) else [])])
        for fold in _FOLDS:
            turn = make_turn(axis, 2 * np.pi / fold)
            if is_same(mesh, center, points, turn, limit):
                found.append(turn)
    return _close_group(found)


def is_same(
    mesh: trimesh.Trimesh,
    center: Float[np.ndarray, " 3"],
    points: Float[np.ndarray, "N 3"],
    rotation: Float[np.ndarray, "3 3"],
    limit: float,
) -> bool:
    """Return whether samples about the center, rotated, all lie on the mesh within a limit [m]."""
    import igl

    vertices = np.ascontiguousarray(np.asarray(mesh.vertices) - center)
    faces = np.ascontiguousarray(mesh.faces, np.int64)
    found = igl.point_mesh_squared_distance(np.ascontiguousarray(points @ rotation.T), vertices, faces)
    return bool(np.sqrt(np.asarray(found[0]).max()) <= limit)


def make_turn(axis: Float[np.ndarray, " 3"], angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the rotation about an axis by an angle [rad] (Rodrigues)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis)).as_matrix()


def find_angle(
    first: Float[np.ndarray, "3 3"],
    second: Float[np.ndarray, "3 3"],
    symmetries: Float[np.ndarray, "S 3 3"] | None = None,
) -> float:
    """Return the smallest angle between two rotations of an object [rad], its symmetries left out of account."""
    turned = first[None] if symmetries is None else first @ symmetries
    trace = np.einsum("sij,ij->s", turned, second)
    return float(np.arccos(np.clip((trace.max() - 1) / 2, -1.0, 1.0)))


def choose_equivalent(
    rotation: Float[np.ndarray, "3 3"], symmetries: Float[np.ndarray, "S 3 3"]
) -> Float[np.ndarray, "3 3"]:
    """Return of the rotations that look the same the one that turns least."""
    turned = rotation @ symmetries
    trace = np.trace(turned, axis1=1, axis2=2)
    return turned[int(np.argmax(np.round(trace, 6)))]


def list_turns(axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "T 3 3"]:
    """Return rotations by multiples of 45 degrees about each of three axes (columns), and the 24 of a cube in them."""
    from scipy.spatial.transform import Rotation

    cube = [axes @ turn @ axes.T for turn in Rotation.create_group("O").as_matrix()]
    single = [make_turn(axis, k * np.pi / 4) for axis in axes.T for k in (1, 3, 5, 7)]
    return np.array(_unique([*cube, *single]))


def _close_group(rotations: list[np.ndarray]) -> Float[np.ndarray, "S 3 3"]:
    """Return the products of rotations, each once; a sphere, which has no end of them, keeps those of two axes."""
    group = _unique(rotations)
    while True:
        larger = _unique([*group, *(a @ b for a in group for b in rotations[1:7])])
        if len(larger) == len(group) or len(larger) > 4 * _ROUND_STEPS:
            return np.array(larger)
        group = larger


def _unique(rotations: list[np.ndarray]) -> list[np.ndarray]:
    kept: list[np.ndarray] = []
    for each in rotations:
        if not any(np.abs(each - other).max() < 0.02 for other in kept):
            kept.append(each)
    return kept
