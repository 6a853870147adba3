"""The ground below robots: the plane on which their tracks stand, and whether they can stand there."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.swarm.kinematic.rotations import make_rotations
from symbrion_gym._src.swarm.kinematic.skidding import find_track_points

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.kinematic.config import KinematicConfig
    from symbrion_gym._src.swarm.sight import Sight

_NUM_RIM = 16
"""Places on the rim of a chassis whose height is read: 2 cm apart."""
_NUM_WALL_RAYS = 8
"""Rays in the plane of the tracks from the center of a chassis to its rim."""
_LEAST_SPREAD = 1e-10
"""Determinant below which the places of a plane lie on a line [m^4]."""


class GroundFit(NamedTuple):
    """How robots stand; the last four are what may be too much.

    Attributes:
        normal: of the plane below the group of each robot.
        height: of that plane below the center of each robot's group root [m].
        slope: of the plane below the tracks of each robot alone [rad].
        step: largest height of the rim of the chassis above or below that plane [m].
        unknown: share of the places whose height is unknown.
        wall: how far walls reach into the disc of the chassis, at the height of its center [m].
    """

    normal: Float[np.ndarray, "N 3"]
    height: Float[np.ndarray, " N"]
    slope: Float[np.ndarray, " N"]
    step: Float[np.ndarray, " N"]
    unknown: Float[np.ndarray, " N"]
    wall: Float[np.ndarray, " N"]


class Ground:
    """Reads the height of an arena below robots.

    A robot stands on the plane through the places below its tracks (least squares); a docked group on one through
    those of all its members. Steps are found at the rim of the chassis, a circle that does not turn with the robot, so
    that turning on the spot never gets it stuck; walls, however thin, by rays from its center to that rim.

    Args:
        arena: whose exact surface is the ground.
        scout: constants of the robots.
        config: limits.
        sight: rays in that arena.
    """

    def __init__(self, arena: Arena, scout: ScoutConfig, config: KinematicConfig, sight: Sight) -> None:
        self._elevation, self._ceiling, self._sight = arena.elevation, config.ceiling, sight
        self._tracks = find_track_points(scout)
        around = np.arange(_NUM_RIM) * 2 * np.pi / _NUM_RIM
        self._rim = scout.size[0] / 2 * np.column_stack([np.cos(around), np.sin(around)])
        self._half_height, self._radius = scout.size[2] / 2, scout.size[0] / 2
        around = np.arange(_NUM_WALL_RAYS) * 2 * np.pi / _NUM_WALL_RAYS
        self._spokes = np.column_stack([np.cos(around), np.sin(around), np.zeros(_NUM_WALL_RAYS)])

    def fit(
        self,
        position: Float[np.ndarray, "N 3"],
        rotation: Float[np.ndarray, "N 3 3"],
        groups: Int[np.ndarray, " N"],
    ) -> GroundFit:
        """Return how robots stand about where they are."""
        foot = position[:, :2] - self._half_height * rotation[:, :2, 2]
        tracks = foot[:, None] + self._tracks @ rotation[:, :2, :2].transpose(0, 2, 1)
        places = np.concatenate([tracks, foot[:, None] + self._rim], axis=1)
        heights = self._find_heights(places)
        own = _fit_planes(tracks - foot[:, None], heights[:, : len(self._tracks)], np.arange(len(foot)))
        rim = heights[:, len(self._tracks) :]
        level = own[:, 2:] + own[:, :1] * self._rim[:, 0] + own[:, 1:2] * self._rim[:, 1]
        above = rim - level
        step = np.max(np.where(np.isfinite(above), np.abs(above), 0.0), axis=1)
        plane = own
        if (groups != np.arange(len(groups))).any():
            root = foot[groups]
            plane = _fit_planes(tracks - root[:, None], heights[:, : len(self._tracks)], groups)
        normal = np.column_stack([-plane[:, :2], np.ones(len(plane))])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        slope = np.arctan(np.hypot(own[:, 0], own[:, 1]))
        center = np.column_stack([foot, own[:, 2]]) + self._half_height * normal
        wall = self._find_walls(center, normal)
        return GroundFit(normal, plane[:, 2], slope, step, np.isnan(heights).mean(axis=1), wall)

    def _find_walls(
        self, center: Float[np.ndarray, "N 3"], normal: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, " N"]:
        """Return how far the surface reaches into the disc about each center, across the normal [m]."""
        wall, num = np.zeros(len(center)), len(self._spokes)
        flat = np.nan_to_num(normal, nan=0.0)
        flat[flat[:, 2] == 0.0] = [0.0, 0.0, 1.0]
        spokes = self._spokes @ make_rotations(flat, np.zeros(len(flat))).transpose(0, 2, 1)
        origins = np.repeat(np.nan_to_num(center), num, axis=0)
        ranges = np.full(len(origins), self._radius)
        is_near = self._sight.may_hit(origins, spokes.reshape(-1, 3), ranges).reshape(-1, num)
        near = np.flatnonzero(is_near.any(axis=1))
        if len(near):
            distance = self._sight.cast_fans(
                np.nan_to_num(center[near]), spokes[near].reshape(-1, 3), np.full(len(near), num)
            )
            wall[near] = np.maximum(self._radius - distance.reshape(-1, num).min(axis=1), 0.0)
        return wall

    def _find_heights(self, places: Float[np.ndarray, "N P 2"]) -> Float[np.ndarray, "N P"]:
        return self._elevation.find_top(places[..., 0], places[..., 1], self._ceiling)[0]


def _fit_planes(
    places: Float[np.ndarray, "N P 2"], heights: Float[np.ndarray, "N P"], groups: Int[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3"]:
    """Return rise along x, rise along y and height at 0 of the least-squares plane of each robot's group; nan: none."""
    known = np.isfinite(heights)
    x, y, z = (np.where(known, values, 0.0) for values in (places[..., 0], places[..., 1], heights))
    count = len(groups)

    def add_up(values: Float[np.ndarray, "N P"]) -> Float[np.ndarray, " N"]:
        return np.bincount(groups, values.sum(axis=1), count)

    num = np.maximum(add_up(known.astype(np.float64)), 1.0)
    mean_x, mean_y, mean_z = (add_up(values) / num for values in (x, y, z))
    s_xx, s_yy, s_xy = (add_up(p) - num * q for p, q in (
        (x * x, mean_x**2), (y * y, mean_y**2), (x * y, mean_x * mean_y)))  # fmt: skip
    s_xz, s_yz = add_up(x * z) - num * mean_x * mean_z, add_up(y * z) - num * mean_y * mean_z
    spread = s_xx * s_yy - s_xy**2
    with np.errstate(divide="ignore", invalid="ignore"):
        along_x = (s_xz * s_yy - s_yz * s_xy) / spread
        along_y = (s_yz * s_xx - s_xz * s_xy) / spread
    plane = np.column_stack([along_x, along_y, mean_z - along_x * mean_x - along_y * mean_y])
    return np.where(spread[:, None] > _LEAST_SPREAD, plane, np.nan)[groups]
