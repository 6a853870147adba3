"""The second judge of tasks at known objects: where the head was, and where the object is, by the arena alone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.placed_objects import find_object
from symbrion_gym._src.tasks.audit import Motion
from symbrion_gym._src.tasks.objects import DockAtObject, ReachObject
from symbrion_gym._src.tasks.scene import Scene

_SLACK_ANGLE = np.deg2rad(1.0)
"""The coordinates are read at the end of a tick, the success check reads poses one physics step older."""
_SLACK = 0.002


def find_not_faced(
    motion: Motion, is_end: Bool[np.ndarray, " T"], scene: Scene, goal: ReachObject
) -> list[str]:
    """Return whether the head does not end near the front of the object, and turned to it."""
    head, ahead, face, _ = _find_end(motion, is_end, scene, goal)
    offset = face - head
    away = np.linalg.norm(offset, axis=1)
    x = np.array([pose.x for pose in scene.organism.find_poses()])
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
    head, ahead, face, front = _find_end(motion, is_end, scene, goal)
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


def _find_end(
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
