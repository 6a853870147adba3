"""An organism laid down tumbled: turned about the axis of its head, just above the ground."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.environment.laying import LIFT
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.scene import Scene

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def tumble(scene: Scene, qpos: Float[np.ndarray, " nq"], yaw: float, roll: float) -> Float[np.ndarray, " nq"]:
    """Return qpos of an organism that is turned about the axis of its head, its hinges straight.

    It is as low as it can be with all corners of its modules above the ground, as a body that fell over.
    """
    turned = qpos.copy()
    turned[7:] = 0.0
    upright, about, matrix = np.zeros(4), np.zeros(4), np.zeros(9)
    mujoco.mju_axisAngle2Quat(upright, np.array([0.0, 0.0, 1.0]), yaw)
    mujoco.mju_axisAngle2Quat(about, np.array([1.0, 0.0, 0.0]), roll)
    mujoco.mju_mulQuat(turned[3:7], upright, about)
    mujoco.mju_quat2Mat(matrix, turned[3:7])
    corners = _find_corners(scene.organism) @ matrix.reshape(3, 3).T
    x, y = (corners + turned[:3])[:, :2].T
    edge = scene.organism.scout.size[2]
    ground = scene.find_ground(x, y, np.full(len(x), turned[2] + edge))
    ground = np.where(np.isfinite(ground), ground, turned[2] - edge / 2)
    turned[2] = float(np.max(ground - corners[:, 2])) + LIFT
    return turned


def _find_corners(organism: Organism) -> Float[np.ndarray, "C 3"]:
    """Return the corners of all modules about the center of module 0, hinges straight [m]."""
    half = np.array(organism.scout.size) / 2
    places = np.array([(pose.x, pose.y, 0.0) for pose in organism.find_poses()])
    return (places[:, None] + _CORNERS * half).reshape(-1, 3)
