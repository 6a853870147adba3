"""How a Scout skids as it turns, on level ground and on slopes: the balance of Coulomb friction and gravity."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.robot.scout_constants import ARM_RADIUS
from symbrion_gym._src.robot.tracks import find_driven_wheels

if TYPE_CHECKING:
    from jaxtyping import Float

    from symbrion_gym._src.robot.scout_constants import ScoutConfig

_ROUNDING = 1e-9
"""Heights that differ by less are the same [m]."""
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
_RIDGE = 1e-12
"""Added to the Hessian, so that it can always be solved."""

_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
"""Of a cell of the table."""


class Skids(NamedTuple):
    """Motion of a Scout whose right belt runs at 1 m/s and its left one at -1 m/s, found once for each kind of Scout.

    Attributes:
        most: strongest pull in the table, the tangent of a slope.
        motion: ahead, left [m/s] and turn to the left [rad/s], by reach of the arm (cosine of the hinge's angle, from 0
            to 1), pull (from 0 to `most`) and its direction in the frame of the Scout (a full turn from -180 degrees;
            the last is the first).
    """

    most: float
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
        power, slip, size = _find_power(motion[rows], load, pull, ways, belts)
        along = np.einsum("dmp,dkp->mkp", slip, ways)
        gradient = np.einsum("mp,mkp->mk", load / size, along) - pull
        hessian = np.einsum("mp,pkl->mkl", load / size, squares)
        hessian -= np.einsum("mp,mkp,mlp->mkl", load / size**3, along, along)
        step = -np.linalg.solve(hessian + _RIDGE * np.eye(3), gradient[..., None])[..., 0]
        promised, length = (step * gradient).sum(axis=1), np.ones(len(rows))
        for _ in range(_HALVINGS):
            now = _find_power(motion[rows] + length[:, None] * step, load, pull, ways, belts)[0]
            is_short = now > power + _ENOUGH * length * promised
            if not is_short.any():
                break
            length = np.where(is_short, length / 2, length)
        motion[rows] += length[:, None] * step
        rows = rows[np.abs(gradient).max(axis=1) > _CONVERGED]
        if not len(rows):
            break
    return motion


def _find_power(
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
