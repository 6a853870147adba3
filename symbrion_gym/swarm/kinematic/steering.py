"""From the speeds of tracks to the motion of single Scouts and of docked groups in their plane."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym.robot.scout_constants import ARM_RADIUS
from symbrion_gym.robot.skid_steering import find_skid_motion
from symbrion_gym.robot.tracks import find_driven_wheels

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym.robot.scout_constants import ScoutConfig

_PROBE_SPEED = 0.05
"""Speed of the tracks with which the turning rate is found [m/s]; the rate is proportional to it."""
_BELT_WIDTH = 1e-6
"""Spheres touch the ground in points [m]."""
_NUM_REACHES = 9
"""Positions of the arm between which its effect is interpolated."""
_ROUNDING = 1e-9
"""Heights that differ by less are the same [m]."""


def find_track_points(scout: ScoutConfig) -> Float[np.ndarray, "P 2"]:
    """Return where the tracks of a Scout touch level ground, left before right, in its frame [m]."""
    wheels = np.array(find_driven_wheels(scout))
    return wheels[wheels[:, 2] < wheels[:, 2].min() + _ROUNDING, :2]


class Turning(NamedTuple):
    """How a Scout turns as its arm moves, found once for each kind of Scout.

    Attributes:
        reach: cosines of the hinge's angle, rising.
        gauge: gauge with which it would turn as fast if its tracks did not slip sideways [m].
        pivot: distance ahead of its center of the place about which it turns on the spot [m].
    """

    reach: Float[np.ndarray, " K"]
    gauge: Float[np.ndarray, " K"]
    pivot: Float[np.ndarray, " K"]


@lru_cache(maxsize=32)
def find_turning(scout: ScoutConfig) -> Turning:
    """Return how a Scout turns, with its arm anywhere between folded up (cosine 0) and level (1).

    The turning rate is (right - left) / gauge for all speeds: in a frame that moves ahead with the mean of both, only
    their difference is left. The ends of the tracks carry the robot; an arm that is not folded up loads the front
    ones. In MuJoCo a Scout turns at 0.768 rad/s with the arm up and at 1.001 about a place 0.020 m ahead with the arm
    level, at 0.05 m/s; this gives 0.769, and 0.986 and 0.022 m.
    """
    points = find_track_points(scout)
    ends, gauge = np.array([points[:, 0].max(), points[:, 0].min()]), float(np.ptp(points[:, 1]))
    reach = np.linspace(0.0, 1.0, _NUM_REACHES)
    rows = []
    for share in reach:
        lever = (
            scout.arm_mass * (scout.arm_reach - ARM_RADIUS) * share / (scout.arm_mass + scout.chassis_mass)
        )
        front = min((lever - ends[1]) / (ends[0] - ends[1]), 1.0)
        loads = np.array([front, 1.0 - front])
        _, aside, turn = find_skid_motion(-_PROBE_SPEED, _PROBE_SPEED, ends, gauge, _BELT_WIDTH, loads)
        rows.append((2.0 * _PROBE_SPEED / turn, -aside / turn))
    return Turning(reach, *np.array(rows).T)


def find_twists(
    tracks: Float[np.ndarray, "N 2"],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, "N 3"],
    hinge: Float[np.ndarray, " N"],
    scout: ScoutConfig,
) -> Float[np.ndarray, "N 3"]:
    """Return the motion of the root of each robot's group: ahead [m/s], left [m/s], turn [rad/s].

    Single robots turn as the balance of Coulomb friction says. A docked group is one rigid body: of all its motions in
    the plane, that in which its tracks slip least (least squares).

    Args:
        tracks: speeds of the left and right tracks [m/s].
        groups: root of each robot's group.
        layout: x [m], y [m] and heading [rad] of each robot in the frame of its root.
        hinge: angles of the arms [rad].
        scout: constants of the robots.

    References:
        Wong and Chiang (2001), Proc. IMechE D 215, for single robots; Mandow et al. (2007), IROS, for groups.
    """
    turning, reach = find_turning(scout), np.cos(hinge)
    turn = (tracks[:, 1] - tracks[:, 0]) / np.interp(reach, turning.reach, turning.gauge)
    aside = -turn * np.interp(reach, turning.reach, turning.pivot)
    single = np.column_stack([(tracks[:, 0] + tracks[:, 1]) / 2, aside, turn])
    size = np.bincount(groups, minlength=len(groups))
    if size.max(initial=0) <= 1:
        return single
    twists = _fit_twists(tracks, groups, layout, find_track_points(scout))
    return np.where(size[groups, None] > 1, twists, single)


def _fit_twists(
    tracks: Float[np.ndarray, "N 2"],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, "N 3"],
    points: Float[np.ndarray, "P 2"],
) -> Float[np.ndarray, "N 3"]:
    c, s = np.cos(layout[:, 2:]), np.sin(layout[:, 2:])
    x = layout[:, :1] + c * points[:, 0] - s * points[:, 1]
    y = layout[:, 1:2] + s * points[:, 0] + c * points[:, 1]
    speed = tracks[:, np.where(points[:, 1] > 0, 0, 1)]
    u, v = c * speed, s * speed

    def average(values: Float[np.ndarray, "N P"]) -> Float[np.ndarray, "N 1"]:
        total = np.bincount(groups, values.mean(axis=1), len(groups)) / np.maximum(
            np.bincount(groups, minlength=len(groups)), 1
        )
        return total[groups, None]

    center_x, center_y, mean_u, mean_v = (average(values) for values in (x, y, u, v))
    x, y = x - center_x, y - center_y
    turn = average(x * v - y * u) / average(x**2 + y**2)
    return np.column_stack([mean_u + turn * center_y, mean_v - turn * center_x, turn])
