"""How far robots reach into each other: discs for chassis and arms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym.robot.scout_constants import ARM_RADIUS

if TYPE_CHECKING:
    from jaxtyping import Float

    from symbrion_gym.robot.scout_constants import ScoutConfig


def find_overlaps(
    position: Float[np.ndarray, " ..."],
    heading: Float[np.ndarray, " N"],
    hinge: Float[np.ndarray, " N"],
    scout: ScoutConfig,
    other: tuple[Float[np.ndarray, " ..."], Float[np.ndarray, " N"], Float[np.ndarray, " N"]] | None = None,
) -> Float[np.ndarray, " ..."]:
    """Return how far each robot reaches into each other one [m]; negative: the gap between them. -inf on the diagonal.

    A chassis is a disc of its half width against other chassis, so that robots that are docked on any sides touch and
    do not overlap; corners may. The end of an arm that is not folded up is a smaller disc, which meets the square
    chassis and other arms.

    Args:
        position: centers of the chassis [m].
        heading: [rad].
        hinge: angles of the arms [rad]; one at 90 degrees lies within its own chassis.
        scout: constants of the robots.
        other: position, heading and hinge of the second robots, if they are elsewhere; the result is then that of row i
            at the first place against column j at the second.
    """
    position_2, heading_2, hinge_2 = other or (position, heading, hinge)
    half = scout.size[0] / 2
    arm_1, arm_2 = (
        _find_arms(*each, scout) for each in ((position, heading, hinge), (position_2, heading_2, hinge_2))
    )
    between = position_2[None, :, :2] - position[:, None, :2]
    depth = 2 * half - np.hypot(between[..., 0], between[..., 1])
    to_arm = arm_2[None] - arm_1[:, None]
    depth = np.maximum(depth, 2 * ARM_RADIUS - np.hypot(to_arm[..., 0], to_arm[..., 1]))
    arm_in_second = _turn_into(arm_1[:, None] - position_2[None, :, :2], heading_2[None, :])
    arm_in_first = _turn_into(arm_2[None] - position[:, None, :2], heading[:, None])
    for place in (arm_in_second, arm_in_first):
        depth = np.maximum(depth, ARM_RADIUS - _find_distance_from_square(place, half))
    apart = np.abs(position[:, None, 2] - position_2[None, :, 2]) > scout.size[2]
    depth[apart] = -np.inf
    np.fill_diagonal(depth, -np.inf)
    return depth


def _find_arms(
    position: Float[np.ndarray, " ..."],
    heading: Float[np.ndarray, " N"],
    hinge: Float[np.ndarray, " N"],
    scout: ScoutConfig,
) -> Float[np.ndarray, " ..."]:
    """Return the centers of the ends of arms, seen from above [m]."""
    reach = (scout.arm_reach - ARM_RADIUS) * np.cos(hinge)
    return position[:, :2] + reach[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])


def _turn_into(
    vectors: Float[np.ndarray, "N M 2"], heading: Float[np.ndarray, " ..."]
) -> Float[np.ndarray, "N M 2"]:
    c, s = np.cos(heading), np.sin(heading)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def _find_distance_from_square(places: Float[np.ndarray, "N M 2"], half: float) -> Float[np.ndarray, " ..."]:
    """Return distances from a square about the origin; negative inside."""
    beyond = np.abs(places) - half
    outside = np.hypot(*np.moveaxis(np.maximum(beyond, 0.0), -1, 0))
    return outside + np.minimum(beyond.max(axis=-1), 0.0)
