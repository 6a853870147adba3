"""How a Scout skids as it turns, on level ground and on slopes: the balance of Coulomb friction and gravity."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.robot.scout_constants import ARM_RADIUS
from symbrion_gym._src.robot.tracks import find_driven_wheels
from symbrion_gym._src.swarm.kinematic.motion import make_rotations

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.kinematic.motion import KinematicConfig
    from symbrion_gym._src.swarm.sight import Sight

_ROUNDING = 1e-9  # Heights that differ by less are the same [m]
_LEAST_SLIP = 0.01
"""Slip below which friction grows in proportion to it, as a share of the speed of the belts; MuJoCo's contacts give way
about as much."""
_MOST_PULL = 0.9
"""Gravity along the ground counts as no more than this share of the largest friction: beyond it nothing holds."""
_NUM_REACHES, _NUM_PULLS, _NUM_DIRECTIONS = 5, 10, 36
"""Positions of the arm, strengths and directions of gravity's pull between which motions are interpolated."""
_ITERATIONS, _HALVINGS, _ENOUGH = 30, 30, 0.1
"""Of Newton's method: steps, halvings of a step, share of the promised decrease that a step has to bring."""
_CONVERGED = 1e-9
_RIDGE = 1e-12  # Added to the Hessian, so that it can always be solved

_CORNERS = np.array(list(np.ndindex(2, 2, 2)))  # Of a cell of the table


class Skids(NamedTuple):
    """Motion of a Scout whose right belt runs at 1 m/s and its left one at -1 m/s, found once a kind of Scout."""

    most: float  # strongest pull in the table, the tangent of a slope
    # ahead, left [m/s] and turn to the left [rad/s], by reach of the arm (cosine of the hinge's angle, from 0
    # to 1), pull (from 0 to `most`) and its direction in the frame of the Scout (a full turn from -180
    # degrees; the last is the first)
    motion: Float[np.ndarray, "K L D 3"]


def find_track_points(scout: ScoutConfig) -> Float[np.ndarray, "P 2"]:
    """Return where the tracks of a Scout touch level ground, left before right, in its frame [m]."""
    wheels = np.array(find_driven_wheels(scout))
    return wheels[wheels[:, 2] < wheels[:, 2].min() + _ROUNDING, :2]


@lru_cache(maxsize=32)
def find_skids(scout: ScoutConfig) -> Skids:
    """Return how a Scout skids, with its arm between folded up (reach 0) and level (1) and on any slope.

    In a frame that moves ahead with the mean of both belts only their difference is left, and to a multiple of it
    belongs the same multiple of the motion. Friction, in proportion to the load of each place and against its slip,
    balances what gravity pulls along the ground: a robot that turns slides downhill, one that drives straight does not.
    The four ends of the tracks carry the robot; loads follow from where its weight, leaning with the slope, meets
    the ground. In MuJoCo a Scout turns at 0.768 rad/s with the arm up and at 1.001 about a place 0.020 m ahead with the
    arm level, on level ground at 0.05 m/s; this gives 0.769, and 0.986 and 0.022 m.

    References:
        Wong and Chiang (2001), A general theory for skid steering of tracked vehicles on firm ground, Proc. IMechE D
        215, with isotropic Coulomb friction, without centrifugal force, and with the weight's part along the slope.
    """
    reach = np.linspace(0.0, 1.0, _NUM_REACHES)
    pull = np.linspace(0.0, _MOST_PULL * scout.friction, _NUM_PULLS)
    direction = np.linspace(-np.pi, np.pi, _NUM_DIRECTIONS + 1)
    shape = (_NUM_REACHES, _NUM_PULLS, _NUM_DIRECTIONS + 1)
    reach, pull, direction = (grid.ravel() for grid in np.meshgrid(reach, pull, direction, indexing="ij"))
    pulls = pull[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    motion = balance(reach, pulls, scout).reshape(*shape, 3)
    return Skids(_MOST_PULL * scout.friction, motion)


def balance(
    reach: Float[np.ndarray, " M"], pulls: Float[np.ndarray, "M 2"], scout: ScoutConfig
) -> Float[np.ndarray, "M 3"]:
    """Return ahead, left [m/s] and turn [rad/s] of Scouts whose right belts run at 1 m/s and left ones at -1 m/s.

    Friction balances gravity where its power, less that of gravity, is least; this is convex in the motion.
    """
    points = find_track_points(scout)
    x, y = (
        np.ptp(points[:, 0]) / 2 * np.array([1, -1, 1, -1]),
        np.ptp(points[:, 1]) / 2 * np.array([1, 1, -1, -1]),
    )
    share = scout.arm_mass / (scout.arm_mass + scout.chassis_mass)
    lever = scout.arm_reach - ARM_RADIUS
    center = share * lever * reach
    height = scout.size[2] / 2 + share * lever * np.sqrt(1.0 - reach**2)
    foot = height[:, None] * pulls + np.column_stack([center, np.zeros(len(center))])
    lean = np.clip(foot / [x[0], y[0]], -1.0, 1.0)
    loads = (1.0 + np.sign(x) * lean[:, :1]) * (1.0 + np.sign(y) * lean[:, 1:]) / 4
    force = np.column_stack([pulls, center * pulls[:, 1] / y[0]]) / scout.friction
    ways = np.array([[np.ones(4), np.zeros(4), -y / y[0]], [np.zeros(4), np.ones(4), x / y[0]]])
    return _minimize(loads, force, ways, np.sign(-y)) / [1.0, 1.0, y[0]]


def _minimize(
    loads: Float[np.ndarray, "M 4"],
    force: Float[np.ndarray, "M 3"],
    ways: Float[np.ndarray, "2 3 4"],
    belts: Float[np.ndarray, " 4"],
) -> Float[np.ndarray, "M 3"]:
    """Return the motions of least power (Newton's method, with halved steps)."""
    motion = np.zeros((len(loads), 3))
    motion[:, 2] = 0.5
    squares = np.einsum("dkp,dlp->pkl", ways, ways)
    rows = np.arange(len(loads))
    for _ in range(_ITERATIONS):
        load, pull = loads[rows], force[rows]
        power, slip, size = _compute_power(motion[rows], load, pull, ways, belts)
        along = np.einsum("dmp,dkp->mkp", slip, ways)
        gradient = np.einsum("mp,mkp->mk", load / size, along) - pull
        hessian = np.einsum("mp,pkl->mkl", load / size, squares)
        hessian -= np.einsum("mp,mkp,mlp->mkl", load / size**3, along, along)
        step = -np.linalg.solve(hessian + _RIDGE * np.eye(3), gradient[..., None])[..., 0]
        promised, length = (step * gradient).sum(axis=1), np.ones(len(rows))
        for _ in range(_HALVINGS):
            now = _compute_power(motion[rows] + length[:, None] * step, load, pull, ways, belts)[0]
            is_short = now > power + _ENOUGH * length * promised
            if not is_short.any():
                break
            length = np.where(is_short, length / 2, length)
        motion[rows] += length[:, None] * step
        rows = rows[np.abs(gradient).max(axis=1) > _CONVERGED]
        if not len(rows):
            break
    return motion


def _compute_power(
    motion: Float[np.ndarray, "M 3"],
    loads: Float[np.ndarray, "M 4"],
    force: Float[np.ndarray, "M 3"],
    ways: Float[np.ndarray, "2 3 4"],
    belts: Float[np.ndarray, " 4"],
) -> tuple[Float[np.ndarray, " M"], Float[np.ndarray, "2 M 4"], Float[np.ndarray, "M 4"]]:
    """Return the power of friction less that of gravity, the slip of each place, and its smoothed length."""
    slip = np.einsum("mk,dkp->dmp", motion, ways)
    slip[0] -= belts
    size = np.sqrt((slip**2).sum(axis=0) + _LEAST_SLIP**2)
    return (loads * size).sum(axis=1) - (force * motion).sum(axis=1), slip, size


def interpolate(
    skids: Skids,
    reach: Float[np.ndarray, " N"],
    pulls: Float[np.ndarray, "N 2"],
    difference: Float[np.ndarray, " N"],
) -> Float[np.ndarray, "N 3"]:
    """Return ahead, left [m/s] and turn [rad/s] of Scouts in a frame that moves with the mean of their belts."""
    side = np.where(difference < 0.0, -1.0, 1.0)
    size = np.hypot(pulls[:, 0], pulls[:, 1])
    angle = np.arctan2(side * pulls[:, 1], pulls[:, 0]) / (2.0 * np.pi) + 0.5
    places = np.stack([np.clip(reach, 0.0, 1.0), np.minimum(size / skids.most, 1.0), angle])
    shape = np.array(skids.motion.shape[:3])
    scaled = places * (shape - 1)[:, None]
    low = np.minimum(scaled.astype(np.int64), (shape - 2)[:, None])
    part = scaled - low
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    index = strides @ low + (_CORNERS @ strides)[:, None]
    weights = np.where(_CORNERS[:, :, None], part, 1.0 - part).prod(axis=1)
    motion = (weights[..., None] * skids.motion.reshape(-1, 3)[index]).sum(axis=0)
    motion *= np.abs(difference)[:, None] / 2
    motion[:, 1:] *= side[:, None]
    return motion


_NUM_RIM = 16  # Places on the rim of a chassis whose height is read: 2 cm apart
_NUM_WALL_RAYS = 8  # Rays in the plane of the tracks from the center of a chassis to its rim
_LEAST_SPREAD = 1e-10  # Determinant below which the places of a plane lie on a line [m^4]


class GroundFit(NamedTuple):
    """How robots stand; the last four are what may be too much."""

    normal: Float[np.ndarray, "N 3"]  # of the plane below the group of each robot
    height: Float[np.ndarray, " N"]  # of that plane below the center of each robot's group root [m]
    slope: Float[np.ndarray, " N"]  # of the plane below the tracks of each robot alone [rad]
    step: Float[np.ndarray, " N"]  # largest height of the rim of the chassis above or below that plane [m]
    unknown: Float[np.ndarray, " N"]  # share of the places whose height is unknown
    # how far walls reach into the disc of the chassis, at the height of its center [m]
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
        heights = self._compute_heights(places)
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

    def _compute_heights(self, places: Float[np.ndarray, "N P 2"]) -> Float[np.ndarray, "N P"]:
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
