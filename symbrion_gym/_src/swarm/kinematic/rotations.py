"""Attitudes of robots on the ground, many at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float


def find_headings(rotation: Float[np.ndarray, "N 3 3"]) -> Float[np.ndarray, " N"]:
    """Return the directions of the x axes, seen from above [rad]."""
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])


def make_rotations(
    normal: Float[np.ndarray, "N 3"], heading: Float[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3 3"]:
    """Return attitudes with z along normals and x, seen from above, along headings [rad]."""
    c, s = np.cos(heading), np.sin(heading)
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    rise = -(x * c + y * s) / z
    length = np.sqrt(c * c + s * s + rise * rise)
    c, s, rise = c / length, s / length, rise / length
    result = np.empty((len(normal), 3, 3))
    result[:, 0, 0], result[:, 1, 0], result[:, 2, 0] = c, s, rise
    result[:, 0, 1], result[:, 1, 1], result[:, 2, 1] = y * rise - z * s, z * c - x * rise, x * s - y * c
    result[:, :, 2] = normal
    return result


def find_spins(
    old: Float[np.ndarray, "N 3 3"], new: Float[np.ndarray, "N 3 3"], duration: float
) -> Float[np.ndarray, "N 3"]:
    """Return the constant rates of rotation that lead from one attitude to another [rad/s], in the arena's frame."""
    change = new @ old.transpose(0, 2, 1)
    axis = np.stack(
        [
            change[:, 2, 1] - change[:, 1, 2],
            change[:, 0, 2] - change[:, 2, 0],
            change[:, 1, 0] - change[:, 0, 1],
        ],
        axis=1,
    )
    sine = np.linalg.norm(axis, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(change, axis1=1, axis2=2) - 1) / 2)
    scale = np.where(sine > 0, angle / np.maximum(2 * sine, np.finfo(float).tiny), 0.5)
    return axis * scale[:, None] / duration
