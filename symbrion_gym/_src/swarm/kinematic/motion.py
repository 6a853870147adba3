"""Poses that robots could take next, and which of them they get to."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.robot.scout_constants import ARM_RADIUS
from symbrion_gym._src.swarm.docks import SCOUT

Numbers = Int[np.ndarray, " N"]  # Of each robot: its group, its root or how much of a motion it makes
Vectors = Float[np.ndarray, "N 3"]  # Of each robot
Angles = Float[np.ndarray, " N"]  # Of each robot [rad]

FULL, TURN, STAY = 0, 1, 2  # What a robot does of a wanted motion: all, only its turn on the spot, nothing
GRIP = 1e-6  # Overlap of two robots that is none [m]: rounding
_HALF = SCOUT.size[0] / 2


class Poses(NamedTuple):
    """Poses of N robots on the ground."""

    position: Vectors  # centers of the chassis [m]
    rotation: Float[np.ndarray, "N 3 3"]  # of the chassis, to the arena
    hinge: Angles  # angles of the arms [rad]

    @property
    def heading(self) -> Angles:
        """Directions of the robots, seen from above [rad]."""
        return np.arctan2(self.rotation[:, 1, 0], self.rotation[:, 0, 0])

    @property
    def outlines(self) -> Float[np.ndarray, "N 7"]:
        """Robots seen from above: center of the chassis, unit vector ahead, center of the arm's end; their height."""
        heading = self.heading
        ahead = np.column_stack([np.cos(heading), np.sin(heading)])
        reach = (SCOUT.arm_reach - ARM_RADIUS) * np.cos(self.hinge)
        center = self.position[:, :2]
        return np.column_stack([center, ahead, center + reach[:, None] * ahead, self.position[:, 2]])


def make_rotations(normal: Vectors, heading: Angles) -> Float[np.ndarray, "N 3 3"]:
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


def choose_roots(groups: Numbers, roots: Numbers, speed: Angles) -> Numbers:
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


def find_layout(poses: Poses, groups: Numbers) -> Vectors:
    """Return x [m], y [m] and heading [rad] of each robot in the frame of its group's root."""
    root = poses.rotation[groups]
    place = np.einsum("nji,nj->ni", root, poses.position - poses.position[groups])
    ahead = np.einsum("nji,nj->ni", root, poses.rotation[:, :, 0])
    return np.column_stack([place[:, :2], np.arctan2(ahead[:, 1], ahead[:, 0])])


def place_members(
    position: Vectors, rotation: Float[np.ndarray, "N 3 3"], layout: Vectors, hinge: Angles
) -> Poses:
    """Return the poses of robots from those of their roots, given once a member."""
    c, s = np.cos(layout[:, 2]), np.sin(layout[:, 2])
    x, y, z = np.moveaxis(rotation, 2, 0)
    place = position + layout[:, :1] * x + layout[:, 1:2] * y
    ahead, left = c[:, None] * x + s[:, None] * y, c[:, None] * y - s[:, None] * x
    return Poses(place, np.stack([ahead, left, z], axis=2), hinge)


def select(level: Numbers, full: Poses, turned: Poses, old: Poses) -> Poses:
    """Return the poses at the level of each robot."""
    chosen = []
    for values in zip(full, turned, old, strict=True):
        at = level.reshape(-1, *[1] * (values[0].ndim - 1))
        chosen.append(np.where(at == FULL, values[0], np.where(at == TURN, values[1], values[2])))
    return Poses(*chosen)


def find_pairs(position: Vectors, reach: float) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
    """Return the pairs of robots whose centers are no farther apart, the smaller index first."""
    x, y = position[:, 0], position[:, 1]
    near = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 <= reach**2
    first, second = np.nonzero(np.triu(near, k=1))
    return first, second


def find_overlaps(one: Float[np.ndarray, "P 7"], other: Float[np.ndarray, "P 7"]) -> Float[np.ndarray, " P"]:
    """Return how far the robots of pairs of outlines reach into each other [m]; negative: the gap between them.

    A chassis is a disc of its half width against other chassis, so that robots that are docked on any sides touch and
    do not overlap; corners may. The end of an arm that is not folded up is a smaller disc, which meets the square
    chassis and other arms.
    """
    between = other - one
    depth = 2 * _HALF - np.hypot(between[:, 0], between[:, 1])
    depth = np.maximum(depth, 2 * ARM_RADIUS - np.hypot(between[:, 4], between[:, 5]))
    for arm, body in ((one, other), (other, one)):
        way, ahead = arm[:, 4:6] - body[:, :2], body[:, 2:4]
        x = np.abs(way[:, 0] * ahead[:, 0] + way[:, 1] * ahead[:, 1]) - _HALF
        y = np.abs(way[:, 1] * ahead[:, 0] - way[:, 0] * ahead[:, 1]) - _HALF
        distance = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0)) + np.minimum(np.maximum(x, y), 0.0)
        depth = np.maximum(depth, ARM_RADIUS - distance)
    return np.where(np.abs(between[:, 6]) > SCOUT.size[2], -np.inf, depth)


def find_members(groups: Numbers) -> np.ndarray:
    """Return which robots belong to a group of several, `[N]`."""
    return np.bincount(groups, minlength=len(groups))[groups] > 1


def spread_level(level: Numbers, groups: Numbers) -> Numbers:
    """Return for each robot the highest level of its group: members move together or not at all."""
    highest = np.zeros_like(level)
    np.maximum.at(highest, groups, level)
    return highest[groups]


def avoid_overlaps(level: Numbers, full: Poses, turned: Poses, old: Poses, groups: Numbers) -> Numbers:
    """Return what of its motion each robot does, so that none reaches farther into another one than before.

    Who moves into a robot, wherever that one ends up, gives up its way, and if that is not enough its turn. In the end
    all stay, which is allowed, so this comes to an end. Members of a group move together or not at all.
    """
    way = np.abs(full.position[:, :2] - old.position[:, :2]).max(initial=0.0)
    first, second = find_pairs(old.position, 2 * (SCOUT.arm_reach + np.sqrt(2.0) * way + GRIP))
    is_apart = groups[first] != groups[second]
    first, second = first[is_apart], second[is_apart]
    if not len(first):
        return level
    before, is_member = old.outlines, find_members(groups)
    allowed = np.maximum(find_overlaps(before[first], before[second]), 0.0) + GRIP
    while True:
        now = select(level, full, turned, old).outlines
        is_bad = find_overlaps(now[first], now[second]) > allowed
        if not is_bad.any():
            return level
        one, other, most = first[is_bad], second[is_bad], allowed[is_bad]
        by_one = (find_overlaps(now[one], before[other]) > most) & (level[one] < STAY)
        by_other = (find_overlaps(before[one], now[other]) > most) & (level[other] < STAY)
        by_both = ~by_one & ~by_other
        causes = np.concatenate([one[by_one | by_both], other[by_other | by_both]])
        level = level.copy()
        level[causes] = np.where(is_member[causes], STAY, np.minimum(level[causes] + 1, STAY))
        level = spread_level(level, groups)


def hold_arms(new: Poses, hinge: Angles, groups: Numbers) -> Poses:
    """Return poses in which no arm has moved farther into a robot of its own group than it was."""
    if not (find_members(groups) & (new.hinge != hinge)).any():
        return new
    first, second = find_pairs(new.position, 2 * SCOUT.arm_reach)
    is_own = groups[first] == groups[second]
    first, second = first[is_own], second[is_own]
    before = new._replace(hinge=hinge).outlines
    allowed = np.maximum(find_overlaps(before[first], before[second]), 0.0) + GRIP
    held = np.zeros(len(groups), bool)
    while True:
        new = new._replace(hinge=np.where(held, hinge, new.hinge))
        now = new.outlines
        is_bad = find_overlaps(now[first], now[second]) > allowed
        more = np.isin(np.arange(len(held)), [first[is_bad], second[is_bad]])
        if not (more & ~held).any():
            return new
        held |= more
