"""Poses of an object that OpenCV's surface matching proposes in a region.

References:
    Drost, Ulrich, Navab, Ilic (2010): Model globally, match locally: efficient and robust 3D object recognition. CVPR.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.extras import require_extras
from reconstruction._src.objects.model import SAMPLING, ObjectModel, compute_angle

_SAME_PLACE, _SAME_ANGLE = 0.25, np.radians(20.0)
"""Poses nearer than this share of the radius, and this angle, are one hypothesis."""
_SCENE_STEP = 1.0 / 4.0  # Every fourth point of the region votes for poses
_MAX_POSES = 60
_TRAINED = 600
"""Points of the object with which the detector is trained, at most: its time grows with their square."""


def require_library() -> None:
    """Refuse in one line where the library is not installed."""
    require_extras("`find_objects`", "objects")


def make_detector(model: ObjectModel) -> Any:
    """Train the library's detector with an object, in one thread: results do not depend on the machine."""
    import cv2

    cv2.setNumThreads(1)
    detector = cv2.ppf_match_3d.PPF3DDetector(SAMPLING, SAMPLING, 30)
    rows = np.linspace(0, len(model.points) - 1, min(_TRAINED, len(model.points))).round().astype(np.int64)
    samples = np.hstack([model.points[rows], model.point_normals[rows]]).astype(np.float32)
    detector.trainModel(np.ascontiguousarray(samples))
    return detector


def propose_poses(
    detector: Any,
    model: ObjectModel,
    points: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
) -> list[Float[np.ndarray, "4 4"]]:
    """Return poses of an object in a region, the ones with most votes first, each once."""
    middle = points.mean(axis=0)
    scene = np.ascontiguousarray(np.hstack([points - middle, normals]).astype(np.float32))
    found = detector.match(scene, _SCENE_STEP, 0.03)
    ranked = sorted(found, key=lambda each: -int(each.numVotes))[:_MAX_POSES]
    kept: list[np.ndarray] = []
    for each in ranked:
        pose = np.array(each.pose, dtype=np.float64)
        if not np.isfinite(pose).all():
            continue
        pose[:3, 3] += middle
        if not any(_is_same(pose, other, model) for other in kept):
            kept.append(pose)
    return kept


def _is_same(first: np.ndarray, second: np.ndarray, model: ObjectModel) -> bool:
    away = np.linalg.norm((first - second)[:3] @ np.append(model.center, 1.0))
    if away > _SAME_PLACE * model.radius:
        return False
    return compute_angle(first[:3, :3], second[:3, :3], model.symmetries) < _SAME_ANGLE


_REACHES = (0.4, 0.3, 0.2, 0.15, 0.1, 0.1, 0.07, 0.07)
"""Readings farther than this share of the radius are left out, one iteration after the other."""
_MIN_NORMAL = 0.3  # A reading belongs to a face whose normal deviates from its own by less than 72 degrees
_DAMPING = 1e-3
"""Share of the mean diagonal that is added to the normal equations: readings of one plane leave three ways open."""
_MAX_TURN = 0.5  # Largest turn of one iteration [rad]


def align(
    model: ObjectModel,
    poses: Float[np.ndarray, "K 4 4"],
    points: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
    noise: float,
    reaches: tuple[float, ...] = _REACHES,
    is_exact: bool = False,
) -> tuple[Float[np.ndarray, "K 4 4"], Float[np.ndarray, " K"]]:
    """Return poses that fit the readings better: Gauss-Newton on the distances along the normals of the faces.

    References:
        Chen, Medioni (1992): Object modelling by registration of multiple range images. Tukey's weights.
    """
    poses = poses.copy()
    worth = np.zeros(len(poses))
    for share in reaches:
        rotation = poses[:, :3, :3]
        local = (points[None] - poses[:, None, :3, 3]) @ rotation
        seen = normals[None] @ rotation
        reach = max(share * model.radius, 4 * noise)
        squared, residual, face_normal = _measure(model, local, is_exact)
        facing = (seen * face_normal).sum(axis=2) > _MIN_NORMAL
        weight = np.where(facing, np.maximum(1 - squared / reach**2, 0.0) ** 2, 0.0)
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


def _measure(
    model: ObjectModel, local: np.ndarray, is_exact: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return squared distances and distances along the normal `[K, M]`, and the normals of the nearest faces.

    By the table the distances are those from the planes of the faces, right to a field of the table.
    """
    import igl

    if not is_exact:
        distance, face = model.nearest.find(local)
        normal = model.normals[face]
        return distance**2, ((local - model.vertices[model.faces[face, 0]]) * normal).sum(axis=2), normal
    flat = np.ascontiguousarray(local.reshape(-1, 3))
    squared, face, foot = igl.point_mesh_squared_distance(flat, model.vertices, model.faces)[:3]
    normal = model.normals[np.asarray(face)]
    residual = ((flat - np.asarray(foot)) * normal).sum(axis=1)
    shape = local.shape[:2]
    return np.asarray(squared).reshape(shape), residual.reshape(shape), normal.reshape(*shape, 3)


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
