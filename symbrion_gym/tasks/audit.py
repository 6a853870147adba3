"""A second judge: is a recorded crossing honest? It shares nothing with the first but the definition.

It sees generalised coordinates alone, works out where every module was by itself, and looks for what a cheat
would leave behind: modules through each other or through the ground, jumps, bodies faster than their tracks,
hinges beyond their range, energy from nowhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from reconstruction.geometry.pose import make_rotation, to_rotation
from symbrion_gym.robot.scout_constants import ScoutConfig

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From x and y [m] to the height of the ground [m]."""

_HOLD_TIME = 0.3
_REACH = 0.05
"""Corners of a module may lie this much closer than its docks [m]."""
_TILT = np.cos(np.deg2rad(61.0))
_CLEARANCE = 0.045
"""The lowest corner of a standing module is no higher above the ground [m]."""
_SINKING = 0.02
"""A centre may come no closer to the surface below it [m]."""
_NEAREST = 0.080
"""Centres of two modules may come no closer than this [m]; bodies 87 mm thick would be inside each other."""
_FASTEST = 2.5
"""No module falls faster than this anywhere in an arena 0.25 m high [m/s]."""
_HINGE_SLACK = 0.12
_SPEED_SLACK = 0.06


class Trajectory(NamedTuple):
    """A recorded episode of a snake.

    Attributes:
        time: `[T]` [s], the start first.
        qpos: `[T, 7 + hinges]` position [m] and quaternion (w first) of the head, hinge angles [rad].
    """

    time: np.ndarray
    qpos: np.ndarray


@dataclass(frozen=True)
class Audit:
    """What the second judge found.

    Attributes:
        is_success: the body crossed and nothing was wrong.
        faults: what was wrong, in words; empty for an honest crossing.
    """

    is_success: bool
    faults: tuple[str, ...]


def place_modules(qpos: np.ndarray, pitch: float = ScoutConfig.pitch) -> tuple[np.ndarray, np.ndarray]:
    """Return centres `[T, n, 3]` [m] and rotations `[T, n, 3, 3]` of a snake's modules.

    Args:
        qpos: `[T, 7 + hinges]`.
        pitch: distance of neighbours at straight hinges [m].
    """
    rotation = to_rotation(qpos[:, 3:7])
    center, centers, rotations = qpos[:, :3], [qpos[:, :3]], [rotation]
    for angle in qpos[:, 7:].T:
        center = center - pitch * rotation[:, :, 0]
        rotation = rotation @ make_rotation(pitch=angle)
        centers.append(center)
        rotations.append(rotation)
    return np.stack(centers, axis=1), np.stack(rotations, axis=1)


def audit(
    trajectory: Trajectory,
    height: Height,
    far_edge: float,
    track_speed: float,
    half_width: float = np.inf,
    scout: ScoutConfig | None = None,
) -> Audit:
    """Judge a recorded episode on a course along x.

    Args:
        trajectory: the episode, to its end.
        height: of the ground.
        far_edge: x of the edge that every module must have behind it [m].
        track_speed: of the body [m/s].
        half_width: of the course [m].
        scout: constants of the modules.
    """
    scout = scout or ScoutConfig()
    if not np.isfinite(trajectory.qpos).all():
        return Audit(False, ("a coordinate is not finite",))
    centers, rotations = place_modules(trajectory.qpos, scout.pitch)
    faults = [
        *_find_bad_hinges(trajectory.qpos[:, 7:], scout),
        *_find_bad_motion(trajectory.time, centers, rotations, track_speed, half_width),
        *_find_overlaps(centers, height),
        *_find_bad_end(trajectory.time, centers, rotations, height, far_edge),
    ]
    return Audit(not faults, tuple(faults))


def _find_bad_hinges(angles: np.ndarray, scout: ScoutConfig) -> list[str]:
    return (
        ["a hinge is beyond its range"] if (np.abs(angles) > scout.hinge_range + _HINGE_SLACK).any() else []
    )


def _find_bad_motion(
    time: np.ndarray, centers: np.ndarray, rotations: np.ndarray, track_speed: float, half_width: float
) -> list[str]:
    faults = []
    step = np.diff(time)
    if not (step > 0).all():
        faults.append("time does not go on")
    speed = np.linalg.norm(np.diff(centers, axis=0), axis=2) / step[:, None]
    if speed.max(initial=0.0) > _FASTEST:
        faults.append(f"a module moves at {speed.max():.2f} m/s")
    if (rotations[:, :, 2, 2] < -0.3).any():
        faults.append("a module rolled over")
    if np.abs(centers[:, :, 1]).max() > half_width:
        faults.append("a module left the course at the side")
    middle = centers[:, :, 0].mean(axis=1)
    if ((middle - middle[0]) > track_speed * (time - time[0]) * 1.02 + _SPEED_SLACK).any():
        faults.append("the body was faster than its tracks")
    return faults


def _find_overlaps(centers: np.ndarray, height: Height) -> list[str]:
    faults = []
    count = centers.shape[1]
    for gap in range(1, count):
        nearest = np.linalg.norm(centers[:, gap:] - centers[:, :-gap], axis=2).min()
        if nearest < _NEAREST:
            faults.append(f"modules {gap} apart came within {1000 * nearest:.0f} mm")
    ground = np.asarray(height(centers[:, :, 0], centers[:, :, 1]))
    sunk = (centers[:, :, 2] - ground < _SINKING) & np.isfinite(ground)
    if sunk.any():
        faults.append("a module sank into the ground")
    return faults


def _find_bad_end(
    time: np.ndarray,
    centers: np.ndarray,
    rotations: np.ndarray,
    height: Height,
    far_edge: float,
) -> list[str]:
    """Look at the last 0.3 s: every corner of every module beyond the edge, standing, upright."""
    last = time > time[-1] - _HOLD_TIME + 1e-6
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * _REACH
    corners = centers[last][:, :, None] + np.einsum("tnij,cj->tnci", rotations[last], corner)
    faults = []
    if corners[..., 0].min() <= far_edge:
        faults.append(f"a module ends {1000 * (far_edge - corners[..., 0].min()):.0f} mm before the edge")
    if rotations[last][:, :, 2, 2].min() < _TILT:
        faults.append("a module does not end upright")
    lowest = np.take_along_axis(corners, corners[..., 2].argmin(axis=2)[..., None, None], axis=2)[:, :, 0]
    above = lowest[..., 2] - height(lowest[..., 0], lowest[..., 1])
    if not np.max(above) < _CLEARANCE:
        faults.append("a module does not end on the ground")
    return faults
