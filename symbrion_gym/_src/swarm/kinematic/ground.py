"""How robots stand on the ground of an arena: planes below their tracks, steps, slopes and walls."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.swarm.docks import SCOUT
from symbrion_gym._src.swarm.kinematic.motion import make_rotations
from symbrion_gym._src.swarm.kinematic.skidding import TRACK_POINTS
from symbrion_gym._src.swarm.sight import Sight

_NUM_RIM = 16  # Places on the rim of a chassis whose height is read: 2 cm apart
_NUM_SPOKES = 8  # Rays in the plane of the tracks from the center of a chassis to its rim
_LEAST_SPREAD = 1e-10  # Determinant below which the places of a plane lie on a line [m^4]
_RADIUS, _HALF_HEIGHT = SCOUT.size[0] / 2, SCOUT.size[2] / 2


def _make_circle(count: int) -> Float[np.ndarray, "C 2"]:
    angle = np.arange(count) * 2 * np.pi / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


_RIM = _RADIUS * _make_circle(_NUM_RIM)
_SPOKES = np.column_stack([_make_circle(_NUM_SPOKES), np.zeros(_NUM_SPOKES)])


class GroundFit(NamedTuple):
    """How robots stand; the last four are what may be too much."""

    normal: Float[np.ndarray, "N 3"]  # of the plane below the group of each robot
    height: Float[np.ndarray, " N"]  # of the center of its group's root, where it stands on that plane [m]
    slope: Float[np.ndarray, " N"]  # of the plane below the tracks of each robot alone [rad]
    step: Float[np.ndarray, " N"]  # largest height of the rim of the chassis above or below that plane [m]
    unknown: Float[np.ndarray, " N"]  # share of the places whose height is unknown
    wall: Float[np.ndarray, " N"]  # how far walls reach into the disc of the chassis, at half its height [m]


def fit_ground(
    arena: Arena,
    sight: Sight,
    position: Float[np.ndarray, "N 3"],
    rotation: Float[np.ndarray, "N 3 3"],
    groups: Int[np.ndarray, " N"],
) -> GroundFit:
    """Return how robots stand about where they are.

    A robot stands on the plane through the places below its tracks (least squares); a docked group on one through
    those of all its members. Steps are found at the rim of the chassis, a circle that does not turn with the robot, so
    that turning on the spot never gets it stuck; walls, however thin, by rays from its center to that rim.
    """
    foot = position[:, :2] - _HALF_HEIGHT * rotation[:, :2, 2]
    tracks = foot[:, None] + TRACK_POINTS @ rotation[:, :2, :2].transpose(0, 2, 1)
    places = np.concatenate([tracks, foot[:, None] + _RIM], axis=1)
    heights = arena.elevation.find_top(places[..., 0], places[..., 1], None)[0]
    below, rim = heights[:, : len(TRACK_POINTS)], heights[:, len(TRACK_POINTS) :]
    plane = own = _fit_planes(tracks - foot[:, None], below, np.arange(len(foot)))
    if (groups != np.arange(len(groups))).any():
        plane = _fit_planes(tracks - foot[groups][:, None], below, groups)
    above = rim - (own[:, 2:] + own[:, :1] * _RIM[:, 0] + own[:, 1:2] * _RIM[:, 1])
    step = np.max(np.where(np.isfinite(above), np.abs(above), 0.0), axis=1)
    normal = np.column_stack([-plane[:, :2], np.ones(len(plane))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    center = np.column_stack([foot, own[:, 2]]) + _HALF_HEIGHT * normal
    return GroundFit(
        normal,
        plane[:, 2] + _HALF_HEIGHT * normal[:, 2],
        np.arctan(np.hypot(own[:, 0], own[:, 1])),
        step,
        np.isnan(heights).mean(axis=1),
        _find_walls(sight, center, normal),
    )


def _find_walls(
    sight: Sight, center: Float[np.ndarray, "N 3"], normal: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, " N"]:
    """Return how far the surface reaches into the disc about each center, across the normal [m]."""
    wall, center = np.zeros(len(center)), np.nan_to_num(center)
    flat = np.nan_to_num(normal, nan=0.0)
    flat[flat[:, 2] == 0.0] = [0.0, 0.0, 1.0]
    spokes = _SPOKES @ make_rotations(flat, np.zeros(len(flat))).transpose(0, 2, 1)
    origins = np.repeat(center, _NUM_SPOKES, axis=0)
    is_near = sight.may_hit(origins, spokes.reshape(-1, 3), _RADIUS).reshape(-1, _NUM_SPOKES)
    near = np.flatnonzero(is_near.any(axis=1))
    counts = np.full(len(near), _NUM_SPOKES)
    distance = sight.cast_fans(center[near], spokes[near].reshape(-1, 3), counts)
    wall[near] = np.maximum(_RADIUS - distance.reshape(-1, _NUM_SPOKES).min(axis=1, initial=np.inf), 0.0)
    return wall


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
