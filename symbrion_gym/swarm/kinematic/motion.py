"""Poses that robots could take next, and which of them they get to."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym.swarm.kinematic.collisions import find_overlaps

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym.robot.scout_constants import ScoutConfig

FULL, TURN, STAY = 0, 1, 2
"""What a robot does of a wanted motion: all, only its turn on the spot, nothing."""


class Poses(NamedTuple):
    """Poses of N robots on the ground.

    Attributes:
        position: centers of the chassis [m].
        rotation: of the chassis, to the arena.
        hinge: angles of the arms [rad].
    """

    position: Float[np.ndarray, " ..."]
    rotation: Float[np.ndarray, "N 3 3"]
    hinge: Float[np.ndarray, " N"]

    @property
    def heading(self) -> Float[np.ndarray, " N"]:
        """Directions of the robots, seen from above [rad]."""
        return find_headings(self.rotation)


def find_headings(rotation: Float[np.ndarray, "N 3 3"]) -> Float[np.ndarray, " N"]:
    """Return the directions of the x axes, seen from above [rad]."""
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])


def make_rotations(
    normal: Float[np.ndarray, " ..."], heading: Float[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3 3"]:
    """Return attitudes with z along normals and x, seen from above, along headings [rad]."""
    c, s = np.cos(heading), np.sin(heading)
    ahead = np.column_stack([c, s, -(normal[:, 0] * c + normal[:, 1] * s) / normal[:, 2]])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.stack([ahead, np.cross(normal, ahead), normal], axis=2)


def find_layout(poses: Poses, groups: Int[np.ndarray, " N"]) -> Float[np.ndarray, " ..."]:
    """Return x [m], y [m] and heading [rad] of each robot in the frame of its group's root."""
    root = poses.rotation[groups]
    place = np.einsum("nji,nj->ni", root, poses.position - poses.position[groups])
    ahead = np.einsum("nji,nj->ni", root, poses.rotation[:, :, 0])
    return np.column_stack([place[:, :2], np.arctan2(ahead[:, 1], ahead[:, 0])])


def place_members(
    position: Float[np.ndarray, " ..."],
    rotation: Float[np.ndarray, "N 3 3"],
    layout: Float[np.ndarray, " ..."],
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
    return Poses(
        *(
            np.where(
                level.reshape(-1, *[1] * (a.ndim - 1)) == FULL,
                a,
                np.where(level.reshape(-1, *[1] * (a.ndim - 1)) == TURN, b, c),
            )
            for a, b, c in zip(full, turned, old, strict=True)
        )
    )


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

    Args:
        level: what the ground allows.
        full: where robots would be after all of their motion.
        turned: where they would be after turning on the spot.
        old: where they are.
        groups: root of each robot's group.
        scout: constants of the robots.
        grip: overlap that is none [m].
    """
    is_apart = groups[:, None] != groups[None, :]
    allowed = np.maximum(_measure(old, old, scout), 0.0) + grip
    is_member = np.bincount(groups, minlength=len(groups))[groups] > 1
    level = level.copy()
    while True:
        poses = select(level, full, turned, old)
        is_bad = (_measure(poses, poses, scout) > allowed) & is_apart
        if not is_bad.any():
            return level
        is_own = (_measure(poses, old, scout) > allowed) & is_bad
        is_own |= is_bad & ~(is_own | is_own.T)
        level = _give_way(level, is_own.any(axis=1), is_bad.any(axis=1), groups, is_member)


def _give_way(
    level: Int[np.ndarray, " N"],
    is_own: Bool[np.ndarray, " N"],
    is_bad: Bool[np.ndarray, " N"],
    groups: Int[np.ndarray, " N"],
    is_member: Bool[np.ndarray, " N"],
) -> Int[np.ndarray, " N"]:
    """Return levels with the robots that cause an overlap at the next one; if those stay already, all that overlap."""
    moving = is_own & (level < STAY)
    if not moving.any():
        moving = is_bad & (level < STAY)
    level = np.where(moving, np.where(is_member, STAY, level + 1), level)
    highest = np.zeros(len(level), dtype=level.dtype)
    np.maximum.at(highest, groups, level)
    return highest[groups]


def _measure(first: Poses, second: Poses, scout: ScoutConfig) -> Float[np.ndarray, " ..."]:
    return find_overlaps(
        first.position,
        first.heading,
        first.hinge,
        scout,
        None if second is first else (second.position, second.heading, second.hinge),
    )
