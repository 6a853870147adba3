"""Laws of a module's wheels: the step that they climb, and the rate at which tracks against each other turn a body."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog, minimize

from benchmarks.material.physics_theory import find_feet, find_largest, find_masses, find_standing
from benchmarks.material.physics_worlds import GRAVITY
from symbrion_gym._src.robot.belts import Contacts
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout import MIDDLE_RISE
from symbrion_gym._src.robot.scout_constants import ScoutConfig

_MIDDLE = 1e-6  # A wheel closer to the middle of its track is the middle one [m]
_STILL = 1e-6
"""Points that slide more slowly, as a share of the belts' speed, rub with a part of their friction."""


def find_step_limit(scout: ScoutConfig) -> float:
    """Return the highest step that a lone module, its arm folded up, climbs slowly [m].

    One wheel after the other meets the edge of the step, unless it is already above it. The first and the middle one
    lean on the last, which is still below; the last on the one that bears on top. The step is climbed if in each of
    these positions forces within the cones of friction balance the weight.
    """
    feet = find_feet(scout)

    def climbs(height: float) -> bool:
        return all(_is_balanced(scout, feet, index, height) for index in range(len(feet)))

    return find_largest(climbs, 1e-4, scout.size[2] / 2)


def _is_balanced(scout: ScoutConfig, feet: Float[np.ndarray, " feet"], climbing: int, height: float) -> bool:
    """Return whether forces balance when a wheel meets the edge and the body leans on one other wheel."""
    radius, last = scout.track_radius, len(feet) - 1
    rises = np.where(np.abs(feet) < _MIDDLE, MIDDLE_RISE, 0.0)
    tilts = np.arcsin(np.clip((height - rises[:climbing]) / (feet[:climbing] - feet[-1]), 0.0, 1.0))
    other = int(tilts.argmax()) if climbing == last else last
    tilt = tilts.max(initial=0.0)
    centers = np.stack([feet * np.cos(tilt), radius + (feet - feet[-1]) * np.sin(tilt) + rises], axis=1)
    if centers[climbing, 1] - radius > height:
        return True
    lean = np.arccos(np.clip((centers[climbing, 1] - height) / radius, 0.0, 1.0))
    contacts = [(climbing, np.array([-np.sin(lean), np.cos(lean)])), (other, np.array([0.0, 1.0]))]
    columns = []
    for index, normal in contacts:
        point = centers[index] - radius * normal
        for side in (scout.friction, -scout.friction):
            force = normal + side * np.array([normal[1], -normal[0]])
            columns.append((*force, point[0] * force[1] - point[1] * force[0]))
    body = find_masses(scout, is_folded=True)
    above = body.z + scout.size[2] / 2 - radius
    moment = (body.x * np.cos(tilt) - above * np.sin(tilt)) @ body.mass
    total = GRAVITY * np.array([0.0, body.mass.sum(), moment])
    found = linprog(np.zeros(len(columns)), A_eq=np.array(columns).T, b_eq=total, bounds=(0, None))
    return found.status == 0


def make_contacts(organism: Organism, speed: float) -> Contacts:
    """Return where a straight snake stands that turns on the spot, its belts at a speed against each other [m/s].

    Each link bears its own weight: hinges are softer than contacts.
    """
    scout, count = organism.scout, organism.num_modules
    feet = find_standing(scout)
    centers = np.zeros((count, 2))
    centers[:, 0] = scout.pitch * ((count - 1) / 2 - np.arange(count))
    points = np.concatenate([feet + center for center in centers])
    weights = np.full(count, scout.chassis_mass + scout.arm_mass)
    weights[0] += (
        scout.arm_mass if count > 1 else 0.0
    )  # its own arm, folded up, and that of the module behind
    weights[-1] -= scout.arm_mass if count > 1 else 0.0
    belts = np.where(points[:, 1] > 0, -speed, speed)
    return Contacts(points, belts, np.repeat(np.arange(count), len(feet)), centers, weights)


def compute_turning_rate(
    points: Float[np.ndarray, "N 2"], loads: Float[np.ndarray, " N"], belts: Float[np.ndarray, " N"]
) -> float:
    """Return the rate at which a body turns whose points of contact all slide with Coulomb friction [rad/s].

    Of all motions (forward, left, turning) it is the one that loses the least power to sliding; there, friction
    balances in force and moment. It does not depend on the coefficient.

    Args:
        points: of contact from the center of the body, x ahead, y left [m].
        loads: normal forces [N].
        belts: speed of the belt at each [m/s].

    References:
        Dixit and Burdick (2020), The quasi-static kinematic modeling of tracked vehicles for urban terrain, arXiv
        2004.05176: the same principle, for belts that bear their load along a line.
    """
    speed, width = float(np.abs(belts).max()), float(np.abs(points[:, 1]).max())

    def find_power(motion: np.ndarray) -> float:
        forward, left, turning = motion[0] * speed, motion[1] * speed, motion[2] * speed / width
        ahead = forward - turning * points[:, 1] - belts
        aside = left + turning * points[:, 0]
        return float(loads @ np.sqrt(ahead**2 + aside**2 + (_STILL * speed) ** 2) / (speed * loads.sum()))

    start, options = np.array([0.0, 0.0, 0.3]), {"xatol": 1e-7, "fatol": 1e-13, "maxiter": 4000}
    for _ in range(3):  # again from where it stopped: a simplex can shrink too early
        start = minimize(find_power, start, method="Nelder-Mead", options=options).x
    return float(start[2] * speed / width)
