"""Poses of an object, fitted to the readings of a region by least squares: point to plane, robust, many at a time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from reconstruction.objects.model import ObjectModel

_REACHES = (0.4, 0.3, 0.2, 0.15, 0.1, 0.1, 0.07, 0.07)
"""Readings farther than this share of the radius are left out, one iteration after the other."""
_MIN_NORMAL = 0.3
"""A reading belongs to a face whose normal deviates from its own by less than 72 degrees."""
_DAMPING = 1e-3
"""Share of the mean diagonal that is added to the normal equations: readings of one plane leave three ways open."""
_MAX_TURN = 0.5
"""Largest turn of one iteration [rad]."""


def align(
    model: ObjectModel,
    poses: Float[np.ndarray, "K 4 4"],
    points: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
    noise: float,
    reaches: tuple[float, ...] = _REACHES,
) -> tuple[Float[np.ndarray, "K 4 4"], Float[np.ndarray, " K"]]:
    """Return poses that fit the readings better: Gauss-Newton on the distances along the normals of the faces.

    Args:
        model: the object.
        poses: where to begin.
        points: readings about the object, without walls and floor [m].
        normals: theirs, turned to the sensor.
        noise: of the ranges [m]; readings are kept within four times as much.
        reaches: shares of the radius beyond which readings are left out, one for each iteration.

    Returns:
        The poses, and of each the sum of the weights of the readings that belong to it.

    References:
        Chen, Medioni (1992): Object modelling by registration of multiple range images. Tukey's weights.
    """
    poses = poses.copy()
    worth = np.zeros(len(poses))
    for share in reaches:
        rotation = poses[:, :3, :3]
        local = np.einsum("kmi,kij->kmj", points[None] - poses[:, None, :3, 3], rotation)
        seen = np.einsum("mi,kij->kmj", normals, rotation)
        reach = max(share * model.radius, 4 * noise)
        squared, foot, face_normal = _find_feet(model, local)
        facing = (seen * face_normal).sum(axis=2) > _MIN_NORMAL
        weight = np.where(facing, np.maximum(1 - squared / reach**2, 0.0) ** 2, 0.0)
        residual = ((local - foot) * face_normal).sum(axis=2)
        arm = (local - model.center) / model.radius
        jacobian = np.concatenate([np.cross(arm, face_normal), face_normal], axis=2)
        weighted = jacobian * weight[:, :, None]
        matrix = weighted.transpose(0, 2, 1) @ jacobian
        trace = np.trace(matrix, axis1=1, axis2=2)
        matrix += (_DAMPING * trace / 6 + 1e-9)[:, None, None] * np.eye(6)
        step = np.linalg.solve(matrix, (weighted * residual[:, :, None]).sum(axis=1)[:, :, None])[:, :, 0]
        poses = poses @ _make_steps(step[:, :3] / model.radius, step[:, 3:], model.center)
        worth = weight.sum(axis=1)
    return poses, worth


def _find_feet(model: ObjectModel, local: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return squared distances `[K, M]`, nearest points and normals of their faces `[K, M, 3]`."""
    import igl

    flat = np.ascontiguousarray(local.reshape(-1, 3))
    squared, face, foot = igl.point_mesh_squared_distance(flat, model.vertices, model.faces)[:3]
    shape = local.shape[:2]
    return (
        np.asarray(squared).reshape(shape),
        np.asarray(foot).reshape(*shape, 3),
        model.normals[np.asarray(face)].reshape(*shape, 3),
    )


def _make_steps(
    turns: Float[np.ndarray, "K 3"], shifts: Float[np.ndarray, "K 3"], center: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "K 4 4"]:
    """Return motions of an object in its own frame: turns about the center [rad] and shifts [m]."""
    from scipy.spatial.transform import Rotation

    angles = np.linalg.norm(turns, axis=1, keepdims=True)
    turns = turns * np.minimum(1.0, _MAX_TURN / np.maximum(angles, 1e-12))
    steps = np.tile(np.eye(4), (len(turns), 1, 1))
    steps[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    steps[:, :3, 3] = center - steps[:, :3, :3] @ center + shifts
    return steps
