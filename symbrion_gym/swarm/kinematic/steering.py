"""From the speeds of tracks to the motion of single Scouts and of docked groups in their plane."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym.robot.skid_steering import find_turning_rate
from symbrion_gym.robot.tracks import find_driven_wheels

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym.robot.scout_constants import ScoutConfig

_PROBE_SPEED = 0.05
"""Speed of the tracks with which the turning rate is found [m/s]; the rate is proportional to it."""
_BELT_WIDTH = 1e-6
"""Spheres touch the ground in points [m]."""
_ROUNDING = 1e-9
"""Heights that differ by less are the same [m]."""


def find_track_points(scout: ScoutConfig) -> Float[np.ndarray, " ..."]:
    """Return where the tracks of a Scout touch level ground, left before right, in its frame [m]."""
    wheels = np.array(find_driven_wheels(scout))
    return wheels[wheels[:, 2] < wheels[:, 2].min() + _ROUNDING, :2]


@lru_cache(maxsize=32)
def find_effective_gauge(scout: ScoutConfig) -> float:
    """Return the gauge with which a Scout would turn as fast if its tracks did not slip sideways [m].

    The turning rate is (right - left) / gauge for all speeds: in a frame that moves ahead with the mean of both, only
    their difference is left.
    """
    points = find_track_points(scout)
    stations, gauge = np.unique(points[:, 0]), float(np.ptp(points[:, 1]))
    rate = find_turning_rate(-_PROBE_SPEED, _PROBE_SPEED, stations, gauge, _BELT_WIDTH)
    return 2.0 * _PROBE_SPEED / rate


def find_twists(
    tracks: Float[np.ndarray, " ..."],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, " ..."],
    scout: ScoutConfig,
) -> Float[np.ndarray, " ..."]:
    """Return the motion of the root of each robot's group: ahead [m/s], left [m/s], turn [rad/s].

    Single robots turn as the balance of Coulomb friction says. A docked group is one rigid body: of all its motions in
    the plane, that in which its tracks slip least (least squares).

    Args:
        tracks: speeds of the left and right tracks [m/s].
        groups: root of each robot's group.
        layout: x [m], y [m] and heading [rad] of each robot in the frame of its root.
        scout: constants of the robots.

    References:
        Wong and Chiang (2001), Proc. IMechE D 215, for single robots; Mandow et al. (2007), IROS, for groups.
    """
    mean, turn = tracks.mean(axis=1), (tracks[:, 1] - tracks[:, 0]) / find_effective_gauge(scout)
    single = np.column_stack([mean, np.zeros(len(tracks)), turn])
    size = np.bincount(groups, minlength=len(groups))
    if size.max(initial=0) <= 1:
        return single
    twists = _fit_twists(tracks, groups, layout, find_track_points(scout))
    return np.where(size[groups, None] > 1, twists, single)


def _fit_twists(
    tracks: Float[np.ndarray, " ..."],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, " ..."],
    points: Float[np.ndarray, " ..."],
) -> Float[np.ndarray, " ..."]:
    c, s = np.cos(layout[:, 2:]), np.sin(layout[:, 2:])
    x = layout[:, :1] + c * points[:, 0] - s * points[:, 1]
    y = layout[:, 1:2] + s * points[:, 0] + c * points[:, 1]
    speed = tracks[:, np.where(points[:, 1] > 0, 0, 1)]
    u, v = c * speed, s * speed

    def average(values: Float[np.ndarray, " ..."]) -> Float[np.ndarray, "N 1"]:
        total = np.bincount(groups, values.mean(axis=1), len(groups)) / np.maximum(
            np.bincount(groups, minlength=len(groups)), 1
        )
        return total[groups, None]

    center_x, center_y, mean_u, mean_v = (average(values) for values in (x, y, u, v))
    x, y = x - center_x, y - center_y
    turn = average(x * v - y * u) / average(x**2 + y**2)
    return np.column_stack([mean_u + turn * center_y, mean_v - turn * center_x, turn])
