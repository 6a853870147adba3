"""How far robots reach into each other: discs for chassis and arms."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.robot.scout_constants import ARM_RADIUS

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from symbrion_gym._src.robot.scout_constants import ScoutConfig


class Outlines(NamedTuple):
    """Robots seen from above.

    Attributes:
        center: of the chassis [m].
        ahead: unit vectors along the headings.
        arm: centers of the rounded ends of the arms [m].
        height: of the centers [m].
    """

    center: Float[np.ndarray, "N 2"]
    ahead: Float[np.ndarray, "N 2"]
    arm: Float[np.ndarray, "N 2"]
    height: Float[np.ndarray, " N"]


def find_outlines(
    position: Float[np.ndarray, "N 3"],
    heading: Float[np.ndarray, " N"],
    hinge: Float[np.ndarray, " N"],
    scout: ScoutConfig,
) -> Outlines:
    """Return robots seen from above."""
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    reach = (scout.arm_reach - ARM_RADIUS) * np.cos(hinge)
    return Outlines(position[:, :2], ahead, position[:, :2] + reach[:, None] * ahead, position[:, 2])


def find_pairs(
    position: Float[np.ndarray, "N 3"], reach: float, num_swarms: int = 1
) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
    """Return the pairs of robots whose centers are no farther apart, the smaller index first."""
    x, y = (position[:, axis].reshape(num_swarms, -1) for axis in (0, 1))
    near = (x[:, :, None] - x[:, None]) ** 2 + (y[:, :, None] - y[:, None]) ** 2 <= reach**2
    swarm, first, second = np.nonzero(np.triu(near, k=1))
    begin = swarm * x.shape[1]
    return begin + first, begin + second


def find_overlaps(one: Outlines, other: Outlines, scout: ScoutConfig) -> Float[np.ndarray, " P"]:
    """Return how far the robots of pairs reach into each other [m]; negative: the gap between them.

    A chassis is a disc of its half width against other chassis, so that robots that are docked on any sides touch and
    do not overlap; corners may. The end of an arm that is not folded up is a smaller disc, which meets the square
    chassis and other arms.
    """
    half = scout.size[0] / 2
    depth = 2 * half - _find_lengths(other.center - one.center)
    depth = np.maximum(depth, 2 * ARM_RADIUS - _find_lengths(other.arm - one.arm))
    for arm, body in ((one, other), (other, one)):
        way = arm.arm - body.center
        x = np.abs(way[:, 0] * body.ahead[:, 0] + way[:, 1] * body.ahead[:, 1]) - half
        y = np.abs(way[:, 1] * body.ahead[:, 0] - way[:, 0] * body.ahead[:, 1]) - half
        distance = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0)) + np.minimum(np.maximum(x, y), 0.0)
        depth = np.maximum(depth, ARM_RADIUS - distance)
    return np.where(np.abs(one.height - other.height) > scout.size[2], -np.inf, depth)


def take(outlines: Outlines, robots: Int[np.ndarray, " P"]) -> Outlines:
    """Return the outlines of some robots."""
    return Outlines(*(values[robots] for values in outlines))


def _find_lengths(vectors: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, " P"]:
    return np.hypot(vectors[:, 0], vectors[:, 1])
