"""How MuJoCo shares a robot's weight among belts that slide, and how fast the robot turns because of it.

How rigid ground bears a robot on many points is not determined by statics. MuJoCo's convex model of friction determines
it: a contact that slides faster presses harder.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import least_squares

_GRAVITY = 9.81
"""[m/s²]."""
_TIME_CONSTANT, _LEAST_IMPEDANCE, _LARGEST_IMPEDANCE = 0.02, 0.9, 0.95
"""MuJoCo's defaults of `solref` [s] and `solimp`."""
_LEAST_SLIP = 1e-5
"""Slip below which friction grows in proportion to it [m/s]: keeps the balance smooth."""
_STAGES = 12
"""The gain is reached in as many stages, so that each balance starts near its solution."""


class Contacts(NamedTuple):
    """Where a robot's belts touch the ground.

    Attributes:
        points: x ahead and y left of the robot's middle [m].
        belts: speed of the belt at each [m/s].
        owner: index of the body that each belongs to.
        centers: (x, y) of the center of mass of each body [m].
        weights: of each body; their sum does not matter.
    """

    points: Float[np.ndarray, "N 2"]
    belts: Float[np.ndarray, " N"]
    owner: Int[np.ndarray, " N"]
    centers: Float[np.ndarray, "bodies 2"]
    weights: Float[np.ndarray, " bodies"]


def find_load_gain(friction: float, impratio: float = 1.0, time_constant: float = _TIME_CONSTANT) -> float:
    """Return by how much the share of a body's weight at a contact grows with the speed of sliding [s/m].

    A contact is a damped spring of acceleration, b = 2 / (d_max time_constant), that bears its share with impedance d.
    In an elliptic cone, sliding with s acts like approaching with friction s, so the share grows by
    friction b d / ((1 - d) g (1 + friction² / impratio)). Nothing in it is fitted.

    References:
        MuJoCo's documentation, Computation, sections Constraint model and Solver parameters: impedance, reference
        acceleration, elliptic cones. Anitescu (2006), Math. Programming 105: why a convex model of friction couples
        sliding to the normal.
    """
    damping = 2.0 / (_LARGEST_IMPEDANCE * time_constant)
    stiff = _LEAST_IMPEDANCE / ((1.0 - _LEAST_IMPEDANCE) * _GRAVITY)
    return friction * damping * stiff / (1.0 + friction**2 / impratio)


def find_sliding_rate(contacts: Contacts, gain: float) -> float:
    """Return the rate at which a robot turns to the left whose points of contact all slide [rad/s].

    Unknown are its motion and, for each body, how it lies on the ground: height and two tilts. Loads grow with depth
    and with sliding, none pulls; in each body they balance its weight; in the whole, friction balances.
    """
    speed, reach = float(np.abs(contacts.belts).max()), float(np.abs(contacts.points).max())
    if speed == 0.0:
        return 0.0
    bodies = len(contacts.weights)
    left = contacts.points[:, 1] > 0
    sides = [contacts.belts[side].mean() / speed for side in (left, ~left)]
    guess = np.concatenate(
        [[np.mean(sides), 0.0, (sides[1] - sides[0]) / 2], np.tile([1.0, 0.0, 0.0], bodies)]
    )
    for each in np.geomspace(1e-2, 1.0, _STAGES) * gain if gain > 0 else [0.0]:
        guess = least_squares(
            _sum_forces, guess, args=(contacts, each, speed, reach), xtol=1e-12, ftol=1e-12
        ).x
    return float(guess[2] * speed / reach)


def _sum_forces(
    unknown: Float[np.ndarray, " U"], contacts: Contacts, gain: float, speed: float, reach: float
) -> Float[np.ndarray, " U"]:
    """Return what is not balanced: friction in the plane, then weight and tilting of each body."""
    x, y = contacts.points.T
    ahead, left, turn = unknown[0] * speed, unknown[1] * speed, unknown[2] * speed / reach
    slip = np.stack([ahead - turn * y - contacts.belts, left + turn * x])
    size = np.hypot(np.linalg.norm(slip, axis=0), _LEAST_SLIP)
    loads, sums = np.zeros(len(x)), []
    for body, (lying, center) in enumerate(zip(unknown[3:].reshape(-1, 3), contacts.centers, strict=True)):
        mine = contacts.owner == body
        arms = (contacts.points[mine] - center) / reach
        share = (lying[0] + arms @ lying[1:]) / mine.sum() + gain * (size[mine] - size[mine].mean())
        share = np.maximum(share, 0.0)
        loads[mine] = share * contacts.weights[body] / contacts.weights.sum()
        sums += [share.sum() - 1.0, *(share @ arms)]
    force = loads * slip / size
    moment = (x * force[1] - y * force[0]).sum() / reach
    return np.array([*force.sum(axis=1), moment, *sums])
