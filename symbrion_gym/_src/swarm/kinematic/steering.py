"""From the speeds of tracks to the motion of single Scouts and of docked groups in their plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym._src.swarm.kinematic.skidding import find_skids, find_track_points, interpolate

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym._src.robot.scout_constants import ScoutConfig


def find_twists(
    tracks: Float[np.ndarray, "N 2"],
    groups: Int[np.ndarray, " N"],
    layout: Float[np.ndarray, "N 3"],
    hinge: Float[np.ndarray, " N"],
    pulls: Float[np.ndarray, "N 2"],
    scout: ScoutConfig,
) -> Float[np.ndarray, "N 3"]:
    """Return the motion of the root of each robot's group: ahead [m/s], left [m/s], turn [rad/s].

    Single robots turn as the balance of Coulomb friction says, and slide downhill as they do. A docked group is one
    rigid body: of all its motions in the plane, that in which its tracks slip least (least squares).

    References:
        Wong and Chiang (2001), Proc. IMechE D 215, for single robots; Mandow et al. (2007), IROS, for groups.
    """
    single = interpolate(find_skids(scout), np.cos(hinge), pulls, tracks[:, 1] - tracks[:, 0])
    single[:, 0] += (tracks[:, 0] + tracks[:, 1]) / 2
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
