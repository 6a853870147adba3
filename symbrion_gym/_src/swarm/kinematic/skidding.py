"""How Scouts skid as they turn, on level ground and on slopes: the balance of Coulomb friction and gravity."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import RegularGridInterpolator

from symbrion_gym._src.robot.scout import find_road_wheels
from symbrion_gym._src.robot.scout_constants import ARM_RADIUS
from symbrion_gym._src.swarm.docks import SCOUT

Vectors = Float[np.ndarray, "N 3"]  # Of each robot
Pairs = Float[np.ndarray, "N 2"]  # Of each robot

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

_WHEELS = np.array(find_road_wheels(SCOUT))
TRACK_POINTS = _WHEELS[_WHEELS[:, 2] < _WHEELS[:, 2].min() + _ROUNDING, :2]
"""Where the tracks of a Scout touch level ground, left before right, in its frame [m]."""


def compute_twists(
    tracks: Pairs,
    groups: Int[np.ndarray, " N"],
    layout: Vectors,
    hinge: Float[np.ndarray, " N"],
    pulls: Pairs,
    friction: float,
) -> Vectors:
    """Return the motion of the root of each robot's group: ahead [m/s], left [m/s], turn [rad/s].

    Single robots turn as the balance of Coulomb friction says, and slide downhill as they do. A docked group is one
    rigid body: of all its motions in the plane, that in which its tracks slip least (least squares).

    References:
        Wong and Chiang (2001), Proc. IMechE D 215, for single robots; Mandow et al. (2007), IROS, for groups.
    """
    single = skid(np.cos(hinge), pulls, tracks[:, 1] - tracks[:, 0], friction)
    single[:, 0] += (tracks[:, 0] + tracks[:, 1]) / 2
    size = np.bincount(groups, minlength=len(groups))
    if size.max(initial=0) <= 1:
        return single
    return np.where(size[groups, None] > 1, _fit_twists(tracks, groups, layout), single)


def _fit_twists(tracks: Pairs, groups: Int[np.ndarray, " N"], layout: Vectors) -> Vectors:
    ahead, left = TRACK_POINTS.T
    c, s = np.cos(layout[:, 2:]), np.sin(layout[:, 2:])
    x, y = layout[:, :1] + c * ahead - s * left, layout[:, 1:2] + s * ahead + c * left
    speed = tracks[:, np.where(left > 0, 0, 1)]
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


def skid(
    reach: Float[np.ndarray, " N"], pulls: Pairs, difference: Float[np.ndarray, " N"], friction: float
) -> Vectors:
    """Return ahead, left [m/s] and turn [rad/s] of Scouts in a frame that moves with the mean of their belts."""
    side = np.where(difference < 0.0, -1.0, 1.0)
    size = np.minimum(np.hypot(pulls[:, 0], pulls[:, 1]), _MOST_PULL * friction)
    direction = np.arctan2(side * pulls[:, 1], pulls[:, 0])
    motion = find_skids(friction)(np.column_stack([np.clip(reach, 0.0, 1.0), size, direction]))
    motion *= np.abs(difference)[:, None] / 2
    motion[:, 1:] *= side[:, None]
    return motion


@lru_cache(maxsize=32)
def find_skids(friction: float) -> RegularGridInterpolator:
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
    axes = (
        np.linspace(0.0, 1.0, _NUM_REACHES),
        np.linspace(0.0, _MOST_PULL * friction, _NUM_PULLS),
        np.linspace(-np.pi, np.pi, _NUM_DIRECTIONS + 1),
    )
    reach, pull, direction = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
    pulls = pull[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    motion = balance(reach, pulls, friction)
    return RegularGridInterpolator(axes, motion.reshape(*(len(axis) for axis in axes), 3))


def balance(
    reach: Float[np.ndarray, " M"], pulls: Float[np.ndarray, "M 2"], friction: float
) -> Float[np.ndarray, "M 3"]:
    """Return ahead, left [m/s] and turn [rad/s] of Scouts whose right belts run at 1 m/s and left ones at -1 m/s.

    Friction balances gravity where its power, less that of gravity, is least; this is convex in the motion.
    """
    half_length, half_width = np.ptp(TRACK_POINTS, axis=0) / 2
    x, y = half_length * np.array([1, -1, 1, -1]), half_width * np.array([1, 1, -1, -1])
    share = SCOUT.arm_mass / (SCOUT.arm_mass + SCOUT.chassis_mass)
    lever = SCOUT.arm_reach - ARM_RADIUS
    center = share * lever * reach
    height = SCOUT.size[2] / 2 + share * lever * np.sqrt(1.0 - reach**2)
    foot = height[:, None] * pulls + np.column_stack([center, np.zeros(len(center))])
    lean = np.clip(foot / [half_length, half_width], -1.0, 1.0)
    loads = (1.0 + np.sign(x) * lean[:, :1]) * (1.0 + np.sign(y) * lean[:, 1:]) / 4
    force = np.column_stack([pulls, center * pulls[:, 1] / half_width]) / friction
    ways = np.array([[np.ones(4), np.zeros(4), -y / half_width], [np.zeros(4), np.ones(4), x / half_width]])
    return _minimize(loads, force, ways, np.sign(-y)) / [1.0, 1.0, half_width]


def _minimize(
    loads: Float[np.ndarray, "M 4"],
    force: Float[np.ndarray, "M 3"],
    ways: Float[np.ndarray, "2 3 4"],
    belts: Float[np.ndarray, " 4"],
) -> Float[np.ndarray, "M 3"]:
    """Return the motions of least power (Newton's method, with halved steps)."""

    def compute_power(at: Float[np.ndarray, "m 3"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the power of friction less that of gravity, the slip of each place, and its smoothed length."""
        slip = np.einsum("mk,dkp->dmp", at, ways)
        slip[0] -= belts
        size = np.sqrt((slip**2).sum(axis=0) + _LEAST_SLIP**2)
        return (load * size).sum(axis=1) - (pull * at).sum(axis=1), slip, size

    motion = np.tile([0.0, 0.0, 0.5], (len(loads), 1))
    squares = np.einsum("dkp,dlp->pkl", ways, ways)
    rows = np.arange(len(loads))
    for _ in range(_ITERATIONS):
        load, pull = loads[rows], force[rows]
        power, slip, size = compute_power(motion[rows])
        along = np.einsum("dmp,dkp->mkp", slip, ways)
        gradient = np.einsum("mp,mkp->mk", load / size, along) - pull
        hessian = np.einsum("mp,pkl->mkl", load / size, squares)
        hessian -= np.einsum("mp,mkp,mlp->mkl", load / size**3, along, along)
        step = -np.linalg.solve(hessian + _RIDGE * np.eye(3), gradient[..., None])[..., 0]
        promised, length = (step * gradient).sum(axis=1), np.ones(len(rows))
        for _ in range(_HALVINGS):
            now = compute_power(motion[rows] + length[:, None] * step)[0]
            is_short = now > power + _ENOUGH * length * promised
            if not is_short.any():
                break
            length = np.where(is_short, length / 2, length)
        motion[rows] += length[:, None] * step
        rows = rows[np.abs(gradient).max(axis=1) > _CONVERGED]
        if not len(rows):
            break
    return motion
