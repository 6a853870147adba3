"""Poses that robots could take next, and which of them they get to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import ARM_RADIUS
from symbrion_gym._src.traversability.footprint import STEP_LIMITS

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym._src.robot.scout_constants import ScoutConfig


def compute_headings(rotation: Float[np.ndarray, "N 3 3"]) -> Float[np.ndarray, " N"]:
    """Return the directions of the x axes, seen from above [rad]."""
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])


def make_rotations(
    normal: Float[np.ndarray, "N 3"], heading: Float[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3 3"]:
    """Return attitudes with z along normals and x, seen from above, along headings [rad]."""
    c, s = np.cos(heading), np.sin(heading)
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    rise = -(x * c + y * s) / z
    length = np.sqrt(c * c + s * s + rise * rise)
    c, s, rise = c / length, s / length, rise / length
    result = np.empty((len(normal), 3, 3))
    result[:, 0, 0], result[:, 1, 0], result[:, 2, 0] = c, s, rise
    result[:, 0, 1], result[:, 1, 1], result[:, 2, 1] = y * rise - z * s, z * c - x * rise, x * s - y * c
    result[:, :, 2] = normal
    return result


def compute_spins(
    old: Float[np.ndarray, "N 3 3"], new: Float[np.ndarray, "N 3 3"], duration: float
) -> Float[np.ndarray, "N 3"]:
    """Return the constant rates of rotation that lead from one attitude to another [rad/s], in the arena's frame."""
    change = new @ old.transpose(0, 2, 1)
    axis = np.stack(
        [
            change[:, 2, 1] - change[:, 1, 2],
            change[:, 0, 2] - change[:, 2, 0],
            change[:, 1, 0] - change[:, 0, 1],
        ],
        axis=1,
    )
    sine = np.linalg.norm(axis, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(change, axis1=1, axis2=2) - 1) / 2)
    scale = np.where(sine > 0, angle / np.maximum(2 * sine, np.finfo(float).tiny), 0.5)
    return axis * scale[:, None] / duration


class Outlines(NamedTuple):
    """Robots seen from above."""

    center: Float[np.ndarray, "N 2"]  # of the chassis [m]
    ahead: Float[np.ndarray, "N 2"]  # unit vectors along the headings
    arm: Float[np.ndarray, "N 2"]  # centers of the rounded ends of the arms [m]
    height: Float[np.ndarray, " N"]  # of the centers [m]


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
    position: Float[np.ndarray, "N 3"], reach: float
) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
    """Return the pairs of robots whose centers are no farther apart, the smaller index first."""
    x, y = position[:, 0], position[:, 1]
    near = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 <= reach**2
    first, second = np.nonzero(np.triu(near, k=1))
    return first, second


def find_overlaps(one: Outlines, other: Outlines, scout: ScoutConfig) -> Float[np.ndarray, " P"]:
    """Return how far the robots of pairs reach into each other [m]; negative: the gap between them.

    A chassis is a disc of its half width against other chassis, so that robots that are docked on any sides touch and
    do not overlap; corners may. The end of an arm that is not folded up is a smaller disc, which meets the square
    chassis and other arms.
    """
    half = scout.size[0] / 2
    depth = 2 * half - _compute_lengths(other.center - one.center)
    depth = np.maximum(depth, 2 * ARM_RADIUS - _compute_lengths(other.arm - one.arm))
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


def _compute_lengths(vectors: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, " P"]:
    return np.hypot(vectors[:, 0], vectors[:, 1])


FULL, TURN, STAY = 0, 1, 2  # What a robot does of a wanted motion: all, only its turn on the spot, nothing


class Poses(NamedTuple):
    """Poses of N robots on the ground."""

    position: Float[np.ndarray, "N 3"]  # centers of the chassis [m]
    rotation: Float[np.ndarray, "N 3 3"]  # of the chassis, to the arena
    hinge: Float[np.ndarray, " N"]  # angles of the arms [rad]

    @property
    def heading(self) -> Float[np.ndarray, " N"]:
        """Directions of the robots, seen from above [rad]."""
        return compute_headings(self.rotation)


def choose_roots(
    groups: Int[np.ndarray, " N"], roots: Int[np.ndarray, " N"], speed: Float[np.ndarray, " N"]
) -> Int[np.ndarray, " N"]:
    """Return the robot of each group whose pose leads: that of its largest former part, which a newcomer does not move.

    Of equal parts it is the one that stands: tracks that already slide resist a turn less than parked ones.
    """
    result = np.arange(len(roots))
    for group in np.flatnonzero(np.bincount(groups, minlength=len(groups)) > 1):
        members = np.flatnonzero(groups == group)
        former, sizes = np.unique(roots[members], return_counts=True)
        stays = np.isin(former, members)
        former, sizes = former[stays], sizes[stays]
        result[members] = former[np.lexsort((speed[former], -sizes))[0]] if stays.any() else members[0]
    return result


def find_layout(poses: Poses, groups: Int[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
    """Return x [m], y [m] and heading [rad] of each robot in the frame of its group's root."""
    root = poses.rotation[groups]
    place = np.einsum("nji,nj->ni", root, poses.position - poses.position[groups])
    ahead = np.einsum("nji,nj->ni", root, poses.rotation[:, :, 0])
    return np.column_stack([place[:, :2], np.arctan2(ahead[:, 1], ahead[:, 0])])


def place_members(
    position: Float[np.ndarray, "N 3"],
    rotation: Float[np.ndarray, "N 3 3"],
    layout: Float[np.ndarray, "N 3"],
    hinge: Float[np.ndarray, " N"],
) -> Poses:
    """Return the poses of robots from those of their roots, given once a member."""
    c, s = np.cos(layout[:, 2]), np.sin(layout[:, 2])
    x, y, z = np.moveaxis(rotation, 2, 0)
    place = position + layout[:, :1] * x + layout[:, 1:2] * y
    ahead, left = c[:, None] * x + s[:, None] * y, c[:, None] * y - s[:, None] * x
    return Poses(place, np.stack([ahead, left, z], axis=2), hinge)


def select(level: Int[np.ndarray, " N"], full: Poses, turned: Poses, old: Poses) -> Poses:
    """Return the poses at the level of each robot."""
    if not level.any():
        return full
    chosen = []
    for values in zip(full, turned, old, strict=True):
        at = level.reshape(-1, *[1] * (values[0].ndim - 1))
        chosen.append(np.where(at == FULL, values[0], np.where(at == TURN, values[1], values[2])))
    return Poses(*chosen)


def avoid_overlaps(
    level: Int[np.ndarray, " N"],
    full: Poses,
    turned: Poses,
    old: Poses,
    groups: Int[np.ndarray, " N"],
    scout: ScoutConfig,
    grip: float,
) -> Int[np.ndarray, " N"]:
    """Return what of its motion each robot does, so that none reaches farther into another one than before.

    Who moves into a robot, wherever that one ends up, gives up its way, and if that is not enough its turn. In the end
    all stay, which is allowed, so this comes to an end. Members of a group move together or not at all.
    """
    way = np.abs(full.position[:, :2] - old.position[:, :2]).max(initial=0.0)
    first, second = find_pairs(old.position, 2 * (scout.arm_reach + np.sqrt(2.0) * way + grip))
    is_apart = groups[first] != groups[second]
    pairs = first[is_apart], second[is_apart]
    if not len(pairs[0]):
        return level
    before = outline(old, scout)
    allowed = np.maximum(_measure(before, before, pairs, scout), 0.0) + grip
    is_member = np.bincount(groups, minlength=len(groups))[groups] > 1
    while True:
        now = outline(select(level, full, turned, old), scout)
        is_bad = _measure(now, now, pairs, scout) > allowed
        if not is_bad.any():
            return level
        bad = pairs[0][is_bad], pairs[1][is_bad]
        by_first, by_second = _find_movers(now, before, bad, allowed[is_bad], scout)
        by_first, by_second = by_first & (level[bad[0]] < STAY), by_second & (level[bad[1]] < STAY)
        by_both = ~by_first & ~by_second
        causes = np.concatenate([bad[0][by_first | by_both], bad[1][by_second | by_both]])
        level = _give_way(level, causes, groups, is_member)


def hold_arms(
    new: Poses,
    hinge: Float[np.ndarray, " N"],
    groups: Int[np.ndarray, " N"],
    scout: ScoutConfig,
    grip: float,
) -> Poses:
    """Return poses in which no arm has moved farther into a robot of its own group than it was."""
    is_member = np.bincount(groups, minlength=len(groups))[groups] > 1
    if not (is_member & (new.hinge != hinge)).any():
        return new
    first, second = find_pairs(new.position, 2 * scout.arm_reach)
    is_own = groups[first] == groups[second]
    pairs = first[is_own], second[is_own]
    before = outline(new._replace(hinge=hinge), scout)
    allowed = np.maximum(_measure(before, before, pairs, scout), 0.0) + grip
    held = np.zeros(len(groups), bool)
    while True:
        new = new._replace(hinge=np.where(held, hinge, new.hinge))
        now = outline(new, scout)
        is_bad = _measure(now, now, pairs, scout) > allowed
        more = np.zeros_like(held)
        more[pairs[0][is_bad]] = more[pairs[1][is_bad]] = True
        if not (more & ~held).any():
            return new
        held |= more


def _give_way(
    level: Int[np.ndarray, " N"],
    causes: Int[np.ndarray, " C"],
    groups: Int[np.ndarray, " N"],
    is_member: Bool[np.ndarray, " N"],
) -> Int[np.ndarray, " N"]:
    """Return levels with the robots that cause an overlap, and those docked to them, at the next one."""
    level = level.copy()
    level[causes] = np.where(is_member[causes], STAY, np.minimum(level[causes] + 1, STAY))
    return spread_level(level, groups)


def spread_level(level: Int[np.ndarray, " N"], groups: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Return for each robot the highest level of its group: members move together or not at all."""
    highest = np.zeros_like(level)
    np.maximum.at(highest, groups, level)
    return highest[groups]


def outline(poses: Poses, scout: ScoutConfig) -> Outlines:
    """Return robots seen from above."""
    return find_outlines(poses.position, poses.heading, poses.hinge, scout)


def _find_movers(
    now: Outlines,
    before: Outlines,
    pairs: tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]],
    allowed: Float[np.ndarray, " P"],
    scout: ScoutConfig,
) -> Bool[np.ndarray, "2 P"]:
    """Return whether the first robot of each pair overlaps where the second one was, and the second the first."""
    first, second = pairs
    ones, others = (
        Outlines(*(np.concatenate([a[i], b[i]]) for a, b in zip(*moved, strict=True)))
        for moved, i in (((now, before), first), ((before, now), second))
    )
    return find_overlaps(ones, others, scout).reshape(2, -1) > allowed


def _measure(
    first: Outlines,
    second: Outlines,
    pairs: tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]],
    scout: ScoutConfig,
) -> Float[np.ndarray, " P"]:
    return find_overlaps(take(first, pairs[0]), take(second, pairs[1]), scout)


_QUARTER_TURN = 90.0


@dataclass(frozen=True)
class KinematicConfig:
    """Limits and errors of kinematic motion.

    Raises:
        OptionError: a value is out of range.
    """

    # steepest ground under the tracks [deg]. One Scout climbs 20 in MuJoCo and tips over at 25
    # (`SLOPE_LIMIT`).
    max_slope: float = 20.0
    # highest step up or down at the rim of the chassis [m]. One Scout climbs 10 mm in MuJoCo (`STEP_LIMITS`);
    # what is higher, or a pit, stops it.
    max_step: float = STEP_LIMITS[0][1]
    # largest share of the ground below a robot that may be unknown: scans have small holes. More is the end
    # of the surface.
    max_unknown: float = 0.25
    # surface above this height is not there [m]: the ceiling of a scanned room; None if there is none. A
    # robot drives on the highest surface below it.
    ceiling: float | None = None
    # standard deviation of the speed of each track, as a share of it, in every decision (estimate). Odometry
    # does not notice it.
    slip: float = 0.03
    grip: float = 1e-6  # overlap of two robots that is none [m]: rounding

    def __post_init__(self) -> None:
        check_positive(self, ("max_slope", "max_step", "grip"), OptionError)
        check_not_negative(self, ("max_unknown", "slip"), OptionError)
        if not self.max_slope < _QUARTER_TURN:
            raise OptionError(f"KinematicConfig.max_slope must be below 90 degrees, got {self.max_slope!r}")
        if not self.max_unknown < 1.0:
            raise OptionError(f"KinematicConfig.max_unknown must be below 1, got {self.max_unknown!r}")
        if self.ceiling is not None and not np.isfinite(self.ceiling):
            raise OptionError(f"KinematicConfig.ceiling must be a height [m] or None, got {self.ceiling!r}")
