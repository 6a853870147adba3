"""How fast a robot on two tracks turns, by the balance of Coulomb friction under them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

_LEAST_SLIP = 1e-5
"""Slip below which friction grows in proportion to it [m/s]: keeps the balance smooth."""


def find_turning_rate(
    left: float, right: float, stations: Float[np.ndarray, " S"], gauge: float, width: float
) -> float:
    """Return the rate at which a robot on two tracks turns to the left, on level ground under an even load [rad/s].

    Without slip it would be (right - left) / gauge; but where a robot turns, its belts slip sideways.
    """
    return find_skid_motion(left, right, stations, gauge, width)[2]


def find_skid_motion(
    left: float,
    right: float,
    stations: Float[np.ndarray, " S"],
    gauge: float,
    width: float,
    loads: Float[np.ndarray, " S"] | None = None,
) -> tuple[float, float, float]:
    """Return how a robot on two tracks moves on level ground: ahead [m/s], left [m/s], turn to the left [rad/s].

    At rest in its own motion the forces of friction, each in proportion to its load and against the slip of its place,
    have no sum and no moment. Neither the sum of the loads nor the friction is in the result.

    References:
        Wong and Chiang (2001), A general theory for skid steering of tracked vehicles on firm ground,
        Proc. IMechE D 215, with isotropic Coulomb friction and no centrifugal force.
    """
    edges = np.array([gauge - width, gauge + width, width - gauge, -gauge - width]) / 2
    x, y = (grid.ravel() for grid in np.meshgrid(stations, edges, indexing="ij"))
    load = np.ones(len(x)) if loads is None else np.repeat(loads, len(edges)) / np.mean(loads)
    belt = np.where(y > 0, left, right)
    scale = max(abs(left), abs(right), _LEAST_SLIP)

    def sum_forces(motion: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
        ahead, aside, turn = motion[0] * scale, motion[1] * scale, motion[2] * scale / gauge
        slip = np.stack([ahead - turn * y - belt, aside + turn * x])
        force = load * slip / np.hypot(np.linalg.norm(slip, axis=0), _LEAST_SLIP)
        return np.array([force[0].sum(), force[1].sum(), (x * force[1] - y * force[0]).sum() / gauge])

    guess = np.array([(left + right) / 2, 0.0, right - left]) / scale
    ahead, aside, turn = least_squares(sum_forces, guess, xtol=1e-12, ftol=1e-12).x * scale
    return float(ahead), float(aside), float(turn) / gauge
