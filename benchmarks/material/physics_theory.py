"""Laws that the simulation is compared with: statics of points of contact with Coulomb friction, nothing simulated.

Slopes, and gaps crossed by a straight chain of modules: a row of links, each a chassis with the arm of the module
behind, between hinges at the centers of the modules. Places are along the ground, the head's center at 0, the others
behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog

from benchmarks.material.physics_worlds import GRAVITY
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout import find_road_wheels
from symbrion_gym._src.robot.scout_constants import ARM_RADIUS, ScoutConfig

_LEVEL = 1e-4
"""Wheels whose lowest points differ in height by less all stand on flat ground [m]."""
_TOLERANCE = 1e-4
"""To which widths and heights are found [m]."""


class Masses(NamedTuple):
    """Point masses of a module's parts.

    Attributes:
        x: along the ground from the module's center [m].
        z: above its center [m].
        mass: [kg].
    """

    x: Float[np.ndarray, " parts"]
    z: Float[np.ndarray, " parts"]
    mass: Float[np.ndarray, " parts"]


class Chain(NamedTuple):
    """A straight chain: its weights, where it may stand, its hinges, all from the head's center [m].

    Attributes:
        weight_x: places of the weights.
        weight: [N].
        weight_link: link of each.
        foot_x: places of the wheels.
        foot_link: link of each.
        hinge_x: places of the hinges; hinge i lies between links i and i + 1.
    """

    weight_x: Float[np.ndarray, " weights"]
    weight: Float[np.ndarray, " weights"]
    weight_link: np.ndarray
    foot_x: Float[np.ndarray, " feet"]
    foot_link: np.ndarray
    hinge_x: Float[np.ndarray, " hinges"]


def find_slope_limit(friction: float) -> float:
    """Return the steepest slope that tracks climb when all of the weight is on them [rad]: atan of the friction."""
    return float(np.arctan(friction))


def find_tipping_limit(scout: ScoutConfig) -> float:
    """Return the slope on which a lone module, its arm folded up, tips over backwards at constant speed [rad].

    The center of mass is then above the rearmost wheels that stand on the ground.
    """
    body = find_masses(scout, is_folded=True)
    rear = -find_standing(scout)[:, 0].min()
    height = np.average(body.z, weights=body.mass) + scout.size[2] / 2
    return float(np.arctan((rear + np.average(body.x, weights=body.mass)) / height))


def find_standing(scout: ScoutConfig) -> Float[np.ndarray, "wheels 2"]:
    """Return where a module's wheels stand on flat ground, (x, y) from its center [m]."""
    wheels = np.array(find_road_wheels(scout))
    return wheels[wheels[:, 2] < wheels[:, 2].min() + _LEVEL, :2]


def find_feet(scout: ScoutConfig) -> Float[np.ndarray, " feet"]:
    """Return the places of the lower wheels, front to rear [m]; the middle one, a little higher, bears at edges."""
    return np.unique([round(x, 6) for x, _, z in find_road_wheels(scout) if z < 0.0])[::-1]


def find_masses(scout: ScoutConfig, is_folded: bool) -> Masses:
    """Return the masses of a module: chassis, arm (folded up or straight ahead)."""
    reach = scout.arm_reach - ARM_RADIUS
    arm = (0.0, reach) if is_folded else (reach, 0.0)
    masses = np.array([scout.chassis_mass, scout.arm_mass])
    return Masses(np.array([0.0, arm[0]]), np.array([0.0, arm[1]]), masses)


def make_chain(organism: Organism) -> Chain:
    """Return the chain of a snake."""
    scout, feet, count = organism.scout, find_feet(organism.scout), organism.num_modules
    modules = [find_masses(scout, is_folded=i == 0) for i in range(count)]
    owners = [np.full(len(parts.mass), i) for i, parts in enumerate(modules)]
    for i, owner in enumerate(owners):
        owner[1] = max(i - 1, 0)  # the arm belongs to the link ahead
    starts = -scout.pitch * np.arange(count)
    return Chain(
        np.concatenate([parts.x + start for parts, start in zip(modules, starts, strict=True)]),
        np.concatenate([parts.mass * GRAVITY for parts in modules]),
        np.concatenate(owners),
        np.add.outer(starts, feet).ravel(),
        np.repeat(np.arange(count), len(feet)),
        starts[1:],
    )


def find_holding_torque(chain: Chain, stands: np.ndarray) -> float:
    """Return the least torque with which a straight chain rests on some of its wheels [N m]; infinite if none does.

    There are forces at those wheels, none pulling, which balance all weights with no hinge above its torque, either
    way: a linear program.

    Args:
        chain: the chain.
        stands: whether each wheel has ground below it.
    """
    if not stands.any():
        return np.inf
    feet, owner = chain.foot_x[stands], chain.foot_link[stands]
    balance = np.stack([np.append(np.ones_like(feet), 0.0), np.append(feet, 0.0)])
    total = np.array([chain.weight.sum(), chain.weight @ chain.weight_x])
    rows, loads = [], []
    for i, place in enumerate(chain.hinge_x):
        ahead = chain.weight_link <= i
        arms = np.where(owner <= i, feet - place, 0.0)
        load = (chain.weight * (chain.weight_x - place))[ahead].sum()
        rows += [np.append(arms, -1.0), np.append(-arms, -1.0)]
        loads += [load, -load]
    cost = np.append(np.zeros(len(feet)), 1.0)
    limits: dict[str, Any] = {"A_ub": np.array(rows), "b_ub": np.array(loads)} if rows else {}
    found = linprog(cost, A_eq=balance, b_eq=total, bounds=(0, None), **limits)
    return float(found.fun) if found.status == 0 else np.inf


def find_gap_limit(organism: Organism, is_round: bool = True) -> float:
    """Return the widest gap that a straight chain crosses slowly [m]; see `find_gap_limits`."""
    return find_gap_limits(organism, [organism.scout.hinge_torque], is_round)[0]


def find_gap_limits(organism: Organism, torques: Sequence[float], is_round: bool = True) -> list[float]:
    """Return the widest gaps that a straight chain crosses slowly [m], by the torque of its hinges.

    It must rest in every position. Between two positions at which a wheel leaves the near side or reaches the far one
    the forces on the chain do not change, so one balance is examined for each.

    Args:
        organism: a snake.
        torques: of its hinges [N m].
        is_round: whether wheels roll around the edges: one whose center is less than its radius r beyond the near edge
            still rests on the edge, as the belts behind hold the chain back; one less than r before the far edge
            meets a corner that lifts it, as long as it has sunk by less than r or friction lifts it up the wall (see
            `find_climbing_friction`).
    """
    scout, chain = organism.scout, make_chain(organism)
    radius = scout.track_radius if is_round else 0.0
    near, far = radius, radius
    needed: dict[bytes, float] = {}

    def crosses(gap: float, torque: float) -> bool:
        leaving, reaching = near - chain.foot_x, gap - far - chain.foot_x
        events = np.unique(np.concatenate([leaving, reaching]))
        for shift in (events[:-1] + events[1:]) / 2:
            stands = (shift < leaving) | (shift > reaching)
            key = stands.tobytes()
            if key not in needed:
                needed[key] = find_holding_torque(chain, stands)
            if needed[key] > torque:
                return False
        return True

    widest = organism.num_modules * scout.pitch
    return [find_largest(lambda gap, t=torque: crosses(gap, t), 1e-3, widest) for torque in torques]


def find_climbing_friction(scout: ScoutConfig) -> float:
    """Return the friction above which the head, hanging too low, drives up the far wall of a gap.

    Pressed against the wall by N, its front wheel is lifted by friction N at the arm from the hinge behind it, while N
    itself, at the arm of the hinge's height above the edge, folds it down.
    """
    return scout.size[2] / 2 / (scout.pitch + float(find_feet(scout)[0]))


def find_beam_gap_limit(organism: Organism) -> float:
    """Return the same for an even beam: half its length, or where its weight beyond the edge bends a hinge [m]."""
    scout, count = organism.scout, organism.num_modules
    weight = GRAVITY * (scout.chassis_mass + scout.arm_mass)
    bending = float(np.sqrt(2 * scout.hinge_torque / (weight * scout.pitch)))
    return min(count * scout.pitch / 2, scout.pitch * bending)


def find_largest(
    holds: Callable[[float], bool], low: float, high: float, tolerance: float = _TOLERANCE
) -> float:
    """Return the largest value for which something holds, by bisection.

    Args:
        holds: called with a value.
        low: for which it holds.
        high: for which it does not.
        tolerance: of the value.
    """
    while high - low > tolerance:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
