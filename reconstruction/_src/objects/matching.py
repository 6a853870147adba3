"""Poses of an object that OpenCV's surface matching proposes in a region.

References:
    Drost, Ulrich, Navab, Ilic (2010): Model globally, match locally: efficient and robust 3D object recognition. CVPR.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.extras import require_extras
from reconstruction._src.objects.config import ObjectsConfig
from reconstruction._src.objects.model import ObjectModel
from reconstruction._src.objects.symmetry import find_angle

_SAME_PLACE, _SAME_ANGLE = 0.25, np.radians(20.0)
"""Poses nearer than this share of the radius, and this angle, are one hypothesis."""
_SCENE_STEP = 1.0 / 4.0
"""Every fourth point of the region votes for poses."""
_MAX_POSES = 60
_TRAINED = 600
"""Points of the object with which the detector is trained, at most: its time grows with their square."""


def require_library() -> None:
    """Refuse in one line where the library is not installed."""
    require_extras("`find_objects`", "objects")


def make_detector(model: ObjectModel, config: ObjectsConfig) -> Any:
    """Train the library's detector with an object, in one thread: results do not depend on the machine."""
    import cv2

    cv2.setNumThreads(1)
    detector = cv2.ppf_match_3d.PPF3DDetector(config.sampling, config.sampling, 30)
    rows = np.linspace(0, len(model.points) - 1, min(_TRAINED, len(model.points))).round().astype(np.int64)
    samples = np.hstack([model.points[rows], model.point_normals[rows]]).astype(np.float32)
    detector.trainModel(np.ascontiguousarray(samples))
    return detector


def propose_poses(
    detector: Any,
    model: ObjectModel,
    points: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
    config: ObjectsConfig,
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
    return find_angle(first[:3, :3], second[:3, :3], model.symmetries) < _SAME_ANGLE
