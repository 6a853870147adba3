"""Poses: where a frame is and how it is turned. One set of conventions for all packages.

- Frames are right-handed: x ahead, y left, z up. Lengths in meters, angles in radians.
- A pose is a homogeneous matrix `[4, 4]` that takes coordinates of the inner frame (sensor) to the outer (robot).
- R = Rz(yaw) Ry(pitch) Rx(roll); a positive pitch lowers what is ahead.
- Quaternions have w first, as MuJoCo has them.
- On level ground a pose is x, y and yaw: a `PlanarPose`, or a row `[3]` of an array.

Matrices come from sines and cosines as the formulas have them: SciPy's `Rotation` takes a detour by quaternions, which
changes the last bit of most entries and takes 1.6 times as long for one pose. Quaternions that were measured become
matrices by `Rotation`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

Array = np.ndarray


def make_rotation(
    roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0, yaw: ArrayLike = 0.0
) -> Float[Array, "*batch 3 3"]:
    """Return Rz(yaw) Ry(pitch) Rx(roll) for angles [rad] that broadcast."""
    roll, pitch, yaw = np.broadcast_arrays(*(np.asarray(angle, float) for angle in (roll, pitch, yaw)))
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    cr, sr = np.cos(roll), np.sin(roll)
    rotation = np.empty((*yaw.shape, 3, 3))
    rotation[..., 0, 0] = cy * cp
    rotation[..., 0, 1] = cy * sp * sr - sy * cr
    rotation[..., 0, 2] = cy * sp * cr + sy * sr
    rotation[..., 1, 0] = sy * cp
    rotation[..., 1, 1] = sy * sp * sr + cy * cr
    rotation[..., 1, 2] = sy * sp * cr - cy * sr
    rotation[..., 2, 0], rotation[..., 2, 1], rotation[..., 2, 2] = -sp, cp * sr, cp * cr
    return rotation


def rotate_about(axis: Float[Array, " 3"], angles: Float[Array, " S"]) -> Float[Array, "S 3 3"]:
    """Return the rotations by angles [rad] about one axis of unit length: Rodrigues' formula."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    c, s = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    return c * np.eye(3) + s * cross + (1 - c) * np.outer(axis, axis)


def to_rotation(quaternions: Float[Array, "N 4"]) -> Float[Array, "N 3 3"]:
    """Return the rotation matrices of quaternions, w first, of any length."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(quaternions, scalar_first=True).as_matrix()


def make_pose(
    x: ArrayLike, y: ArrayLike, yaw: ArrayLike, roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0
) -> Float[Array, "*batch 4 4"]:
    """Return poses at (x, y, 0) [m], turned by `make_rotation`; all arguments broadcast."""
    x, y, yaw, roll, pitch = np.broadcast_arrays(*(np.asarray(v, float) for v in (x, y, yaw, roll, pitch)))
    pose = np.zeros((*x.shape, 4, 4))
    pose[..., :3, :3] = make_rotation(roll, pitch, yaw)
    pose[..., 0, 3], pose[..., 1, 3], pose[..., 3, 3] = x, y, 1.0
    return pose


def to_planar(poses: Float[Array, "S 4 4"]) -> Float[Array, "S 3"]:
    """Return x, y [m] and yaw [rad] of poses."""
    return np.stack([poses[:, 0, 3], poses[:, 1, 3], np.arctan2(poses[:, 1, 0], poses[:, 0, 0])], axis=1)


def make_quaternion(yaw: float, pitch: float) -> Float[Array, " 4"]:
    """Return the quaternion of Rz(yaw) Ry(pitch)."""
    cy, sy, cp, sp = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return np.array([cy * cp, -sy * sp, cy * sp, sy * cp])


def make_quarter_turn(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Float[Array, " 4"]:
    """Return the quaternion of a turn by 90 degrees about the axis (x, y, z) of unit length."""
    return np.sqrt(0.5) * np.array([1.0, x, y, z])


def rotate_planar(vectors: Float[Array, "S 2"], angles: Float[Array, " S"]) -> Float[Array, "S 2"]:
    """Return each vector turned by its angle [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def transform_planar(points: Float[Array, "N 2"], pose: Float[Array, " 3"]) -> Float[Array, "N 2"]:
    """Return points of the frame at a planar pose (x, y, yaw) in the frame that the pose is given in."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]


def compose_planar(pose: Float[Array, " 3"], step: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Return the planar pose that is reached from `pose` by `step`, given in its frame."""
    return np.append(transform_planar(step[None, :2], pose)[0], pose[2] + step[2])


def compute_planar_step(first: Float[Array, " 3"], second: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Return the step from one planar pose to another, in the frame of the first: the inverse of `compose_planar`."""
    c, s = np.cos(first[2]), np.sin(first[2])
    d = second - first
    return np.array([c * d[0] + s * d[1], -s * d[0] + c * d[1], d[2]])


@dataclass(frozen=True)
class PlanarPose:
    """A pose in the x-y plane of another frame."""

    x: float = 0.0  # [m]
    y: float = 0.0  # [m]
    heading: float = 0.0  # about z [rad]; composed headings add up, they are not wrapped

    @property
    def position(self) -> list[float]:
        """Position `[3]` [m] as MuJoCo takes it."""
        return [self.x, self.y, 0.0]

    @property
    def quaternion(self) -> list[float]:
        """Quaternion `[4]` as MuJoCo takes it, w first."""
        return [np.cos(self.heading / 2), 0.0, 0.0, np.sin(self.heading / 2)]

    def compose(self, other: PlanarPose) -> PlanarPose:
        """Return the pose of `other`, given in this frame, in the frame of this one's parent."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return PlanarPose(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            self.heading + other.heading,
        )

    def invert(self) -> PlanarPose:
        """Return the pose of the parent in this frame."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return PlanarPose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.heading)
