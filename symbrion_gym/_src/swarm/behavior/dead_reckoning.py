"""Where a beacon is while it is not heard: its last pose, carried on by the odometry of the robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.behavior.steering import HALF_GAUGE, SLIP, wrap

if TYPE_CHECKING:
    from jaxtyping import Float

    from symbrion_gym._src.swarm.behavior.percepts import Heard

REACH = ScoutConfig().arm_reach
"""From the center of a robot to the dock with which it hears [m]: that of the front, with which it docks."""


def carry(pose: Float[np.ndarray, "N 3"], way: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 3"]:
    """Return poses of docks in the frames of robots that have moved."""
    turn = (way[:, 1] - way[:, 0]) / (2 * HALF_GAUGE * SLIP)
    ahead, left = pose[:, 0] - way.mean(axis=-1), pose[:, 1]
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.stack([cosine * ahead + sine * left, cosine * left - sine * ahead, pose[:, 2] - turn], axis=-1)


def locate(heard: Heard) -> Float[np.ndarray, "N 3"]:
    """Return poses of the docks that are heard, in the frames of the robots."""
    distance = np.maximum(heard.distance, 0.0) + REACH
    axis = wrap(heard.bearing + np.pi - heard.departure)
    return np.stack([distance * np.cos(heard.bearing), distance * np.sin(heard.bearing), axis], axis=-1)


def recall(heard: Heard, pose: Float[np.ndarray, "N 3"]) -> Heard:
    """Return what is heard, with distance, bearing and departure of the remembered dock where nothing is."""
    bearing = np.arctan2(pose[:, 1], pose[:, 0])
    distance = np.maximum(np.hypot(pose[:, 0], pose[:, 1]) - REACH, 0.0)
    departure = wrap(bearing + np.pi - pose[:, 2])
    return heard._replace(
        distance=np.where(heard.is_heard, heard.distance, distance),
        bearing=np.where(heard.is_heard, heard.bearing, bearing),
        departure=np.where(heard.is_heard, heard.departure, departure),
    )
