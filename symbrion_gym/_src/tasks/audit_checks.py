"""What the audit looks for: modules through each other or through the ground, jumps, bodies faster than their tracks.

It sees generalized coordinates alone, of which the places of the modules are worked out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_not_negative
from symbrion_gym._src.arenas.placed_objects import find_object
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.tasks.objects import DockAtObject, ReachObject
from symbrion_gym._src.tasks.scene import Scene

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]  # From x and y [m] to the height of the ground [m]
_ROUNDING = 1e-6  # Times and distances that differ by less are the same [s, m]


@dataclass(frozen=True)
class AuditLimits:
    """What an honest crossing keeps to. Wider limits find fewer faults.

    Raises:
        OptionError: a number is out of range.
    """

    hold_time: float = 0.3  # length of the end that must be a success throughout [s]
    # half the edge of the cube in a module that must be beyond the edge [m]; corners of a module may lie this
    # much closer than its docks
    corner: float = 0.05
    # smallest z component of the up axis of a module that stands: it leans by 61 degrees at most, one more
    # than the success check allows
    upright: float = float(np.cos(np.deg2rad(61.0)))
    rolled_over: float = -0.3  # below this z component a module has rolled over
    clearance: float = 0.045  # the lowest corner of a standing module is no higher above the ground [m]
    smallest_height: float = 0.02  # a center comes no closer to the surface below it [m]
    # centers of two modules come no closer than this [m]; 87 mm thick, they would be inside each other
    smallest_gap: float = 0.080
    max_speed: float = 2.5  # no module falls faster than this anywhere in an arena 0.25 m high [m/s]
    hinge_slack: float = 0.12  # how far hinges give beyond their range under load [rad]
    track_slip: float = 1.02  # an organism is faster than its tracks by no more than this factor
    speed_slack: float = 0.06  # what it may be ahead of their path besides, for falling forwards [m]
    # what it may be ahead besides until the end is held, per meter by which the mean height of its modules is
    # below that of the highest: so far it slides at a friction of 1, pulled by what hangs. At the end nothing
    # is excused.
    fall_lead: float = 1.0

    def __post_init__(self) -> None:
        names = [each.name for each in fields(self) if each.name not in ("upright", "rolled_over")]
        check_not_negative(self, names, OptionError)
        for name in ("upright", "rolled_over"):
            if not -1.0 <= getattr(self, name) <= 1.0:
                raise OptionError(f"AuditLimits: {name} must lie in [-1, 1], got {getattr(self, name)!r}")


class Trajectory(NamedTuple):
    """A recorded episode."""

    time: Float[np.ndarray, " T"]  # [s], the start first
    qpos: Float[np.ndarray, "T Q"]  # position [m] and quaternion (w first) of the head, joint angles [rad]


class Motion(NamedTuple):
    """What the modules did, worked out from the coordinates."""

    time: Float[np.ndarray, " T"]  # [s]
    centers: Float[np.ndarray, "T n 3"]  # centers of the modules [m]
    rotations: Float[np.ndarray, "T n 3 3"]  # rotations of the modules


@dataclass(frozen=True)
class Audit:
    """What the audit found."""

    is_success: bool  # nothing was wrong
    faults: tuple[str, ...]  # what was wrong, in words; empty for an honest crossing


def find_bad_hinges(angles: Float[np.ndarray, "T h"], largest: float) -> list[str]:
    """Return whether a hinge is beyond its range [rad]."""
    return ["a hinge is beyond its range"] if (np.abs(angles) > largest).any() else []


def find_bad_motion(motion: Motion, limits: AuditLimits, rolled_over: float | None = None) -> list[str]:
    """Return what no body does: jumps, and rolling over."""
    faults, (time, centers, rotations) = [], motion
    step = np.diff(time)
    if not (step > 0).all():
        faults.append("time does not go on")
    speed = np.linalg.norm(np.diff(centers, axis=0), axis=2) / step[:, None]
    if speed.max(initial=0.0) > limits.max_speed:
        faults.append(f"a module moves at {speed.max():.2f} m/s")
    if (rotations[:, :, 2, 2] < (limits.rolled_over if rolled_over is None else rolled_over)).any():
        faults.append("a module rolled over")
    return faults


def compute_progress(ahead: Float[np.ndarray, "T n"], finish: float) -> Float[np.ndarray, " T"]:
    """Return the mean position of the modules along a way, each counted up to the finish [m]."""
    return np.minimum(ahead, finish).mean(axis=1)


def find_bad_pace(
    motion: Motion,
    track_speed: float,
    limits: AuditLimits,
    progress: Float[np.ndarray, " T"] | None = None,
) -> list[str]:
    """Return whether the body was faster than its tracks.

    Its middle may be no farther from its start, in plan, than the tracks can have taken it. Until the end is held, a
    body that is pulled by modules that hang may have slid ahead, as far as their loss of height pays for the friction.
    """
    time, middle, height = motion.time, motion.centers.mean(axis=1), motion.centers[:, :, 2]
    tracks = track_speed * (time - time[0]) * limits.track_slip + limits.speed_slack
    away = np.linalg.norm(middle[:, :2] - middle[0, :2], axis=1)
    way = away if progress is None else progress - progress[0]
    hang = height.max(axis=1) - height.mean(axis=1)
    was_ahead = (way > tracks + limits.fall_lead * hang).any()
    ends_ahead = (away > tracks)[find_end(time, limits)].any()
    return ["the body was faster than its tracks"] if was_ahead or ends_ahead else []


def find_end(time: Float[np.ndarray, " T"], limits: AuditLimits) -> Bool[np.ndarray, " T"]:
    """Return which times belong to the end that is held."""
    return time > time[-1] - limits.hold_time + _ROUNDING


def find_overlaps(centers: Float[np.ndarray, "T n 3"], height: Height, limits: AuditLimits) -> list[str]:
    """Return whether modules were inside each other or the ground."""
    faults = []
    for apart in range(1, centers.shape[1]):
        nearest = np.linalg.norm(centers[:, apart:] - centers[:, :-apart], axis=2).min()
        if nearest < limits.smallest_gap:
            faults.append(f"modules {apart} apart came within {1000 * nearest:.0f} mm")
    ground = np.asarray(height(centers[:, :, 0], centers[:, :, 1]))
    sunk = (centers[:, :, 2] - ground < limits.smallest_height) & np.isfinite(ground)
    if sunk.any():
        faults.append("a module sank into the ground")
    return faults


def find_last_corners(motion: Motion, limits: AuditLimits) -> Float[np.ndarray, "L n 8 3"]:
    """Return the corners of all modules while the success was held."""
    last = find_end(motion.time, limits)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    turned = np.einsum("tnij,cj->tnci", motion.rotations[last], signs * limits.corner)
    return motion.centers[last][:, :, None] + turned


def find_unsteady_end(motion: Motion, height: Height, limits: AuditLimits) -> list[str]:
    """Return whether a module does not end upright, or not on the ground.

    It is on the ground if its lowest corner is close above the ground below this corner or below its center, whichever
    is higher: over a rim or the edge of a gap, a corner may have nothing below it, and what carries the module lies
    below its center. Below the center there has to be ground.
    """
    faults, corners = [], find_last_corners(motion, limits)
    last = find_end(motion.time, limits)
    if motion.rotations[last][:, :, 2, 2].min() < limits.upright:
        faults.append("a module does not end upright")
    lowest = np.take_along_axis(corners, corners[..., 2].argmin(axis=2)[..., None, None], axis=2)[:, :, 0]
    below_center = height(*np.moveaxis(motion.centers[last][..., :2], -1, 0))
    ground = np.fmax(height(lowest[..., 0], lowest[..., 1]), below_center)
    if not (np.isfinite(below_center).all() and np.max(lowest[..., 2] - ground) < limits.clearance):
        faults.append("a module does not end on the ground")
    return faults


_SLACK_ANGLE = np.deg2rad(1.0)
"""The coordinates are read at the end of a tick, the success check reads poses one physics step older."""
_SLACK = 0.002


def find_not_faced(
    motion: Motion, is_end: Bool[np.ndarray, " T"], scene: Scene, goal: ReachObject
) -> list[str]:
    """Return whether the head does not end near the front of the object, and turned to it."""
    head, ahead, face, _ = _find_object_end(motion, is_end, scene, goal)
    offset = face - head
    away = np.linalg.norm(offset, axis=1)
    x = np.array([pose.x for pose in scene.organism.compute_poses()])
    scout = scene.organism.scout
    length = float(np.ptp(x)) + scout.dock_reach + scout.arm_reach
    angle = np.arccos(np.clip((offset * ahead).sum(axis=1) / np.maximum(away, 1e-9), -1.0, 1.0))
    faults = []
    if away.max() > length + _SLACK:
        faults.append(f"the head ends {1000 * away.max():.0f} mm from the object")
    if angle.max() > goal.max_angle + _SLACK_ANGLE:
        faults.append(f"the head ends {np.degrees(angle.max()):.0f} degrees off the object")
    return faults


def find_not_docked(
    motion: Motion, is_end: Bool[np.ndarray, " T"], scene: Scene, goal: DockAtObject
) -> list[str]:
    """Return whether the dock does not end at the front of the object, or not aligned with it."""
    head, ahead, face, front = _find_object_end(motion, is_end, scene, goal)
    offset = head + scene.organism.scout.arm_reach * ahead - face
    side = np.array([-front[1], front[0]])
    off = np.abs(np.stack([offset @ front, offset @ side])).max()
    angle = np.arccos(np.clip(-(ahead @ front), -1.0, 1.0)).max()
    faults = []
    if off > goal.find_tolerance() + _SLACK:
        faults.append(f"the dock ends {1000 * off:.0f} mm from the object")
    if angle > goal.max_angle + _SLACK_ANGLE:
        faults.append(f"the head ends {np.degrees(angle):.0f} degrees off the front of the object")
    return faults


def _find_object_end(
    motion: Motion, is_end: Bool[np.ndarray, " T"], scene: Scene, goal: ReachObject
) -> tuple[
    Float[np.ndarray, "L 2"], Float[np.ndarray, "L 2"], Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]
]:
    """Return places and directions of the head at the end, and the middle and direction of the object's front."""
    each = find_object(scene.arena.objects, goal.site)
    front = each.rotation[:2, 0] / max(float(np.linalg.norm(each.rotation[:2, 0])), 1e-9)
    face = each.position[:2] + float(np.max(each.mesh.vertices[:, 0])) * front
    ahead = motion.rotations[is_end][:, 0, :2, 0]
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    return motion.centers[is_end][:, 0, :2], ahead, face, front
