"""Planar poses as rows x, y [m] and yaw [rad], and their steps."""

import numpy as np
from jaxtyping import Float


def rotate_planar(
    vectors: Float[np.ndarray, "S 2"], angles: Float[np.ndarray, " S"]
) -> Float[np.ndarray, "S 2"]:
    """Return each vector turned by its angle [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def transform_planar(
    points: Float[np.ndarray, "N 2"], pose: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "N 2"]:
    """Return points of the frame at a planar pose (x, y, yaw) in the frame that the pose is given in."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]


def compose_planar(pose: Float[np.ndarray, " 3"], step: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return the planar pose that is reached from `pose` by `step`, given in its frame."""
    return np.append(transform_planar(step[None, :2], pose)[0], pose[2] + step[2])


def find_planar_step(
    first: Float[np.ndarray, " 3"], second: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, " 3"]:
    """Return the step from one planar pose to another, in the frame of the first: the inverse of `compose_planar`."""
    c, s = np.cos(first[2]), np.sin(first[2])
    d = second - first
    return np.array([c * d[0] + s * d[1], -s * d[0] + c * d[1], d[2]])
