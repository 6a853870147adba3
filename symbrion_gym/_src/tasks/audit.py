"""The audit, a second check of every task: is a recorded success honest? It shares the definition alone with the first.

It sees generalized coordinates, the surface, and where the task says that the body should be. Where every module was,
it works out by itself, and it looks for the traces of a cheat: modules through each other or through the ground,
jumps, bodies faster than their tracks.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.geometry.pose import make_rotation, to_rotation
from symbrion_gym._src.arenas.placed_objects import find_object
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.paths import PathRoute
from symbrion_gym._src.tasks.reach import ReachObject, ReachPlaces
from symbrion_gym._src.tasks.state import Scene
from symbrion_gym._src.tasks.task import Task

Height = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From x, y and z of places to the height of the ground there [m]."""
_HEADROOM = 0.1  # What lies this much higher than a place, or more, hangs above it [m]
_HOLD_TIME = 0.3  # Length of the end that must be a success throughout [s]
_CORNER = 0.05
"""Half the edge of the cube in a module that must be beyond the edge [m]; its corners may lie this much closer than its
docks."""
_UPRIGHT = float(np.cos(np.deg2rad(61.0)))
"""Smallest z component of the up axis of a module that stands: one degree more than the success check allows."""
_ROLLED_OVER = -0.3  # Below this z component a module has rolled over
_CLEARANCE = 0.045  # The lowest corner of a standing module is no higher above the ground [m]
_SMALLEST_HEIGHT = 0.02  # A center comes no closer to the surface below it [m]
_SMALLEST_GAP = 0.080
"""Centers of two modules come no closer than this [m]; 87 mm thick, they would be inside each other."""
_MAX_SPEED = 2.5  # No module falls faster than this anywhere in an arena 0.25 m high [m/s]
_HINGE_SLACK = 0.12  # How far hinges give beyond their range under load [rad]
_TRACK_SLIP = 1.02  # An organism is faster than its tracks by no more than this factor
_SPEED_SLACK = 0.06  # What it may be ahead of their path besides, for falling forwards [m]
_FALL_LEAD = 1.0
"""What it may be ahead besides until the end is held, per meter by which the mean height of its modules is below that
of the highest: so far it slides at a friction of 1, pulled by what hangs. At the end nothing is excused."""
_SLACK_ANGLE = np.deg2rad(1.0)
"""The coordinates are read at the end of a tick, the success check reads poses one physics step older."""
_SLACK = 0.002
_ROUNDING = 1e-6  # Times that differ by less are the same [s]


class Trajectory(NamedTuple):
    """A recorded episode."""

    time: Float[np.ndarray, " T"]  # [s], the start first
    qpos: Float[np.ndarray, "T Q"]  # position [m] and quaternion (w first) of the head, joint angles [rad]


class Motion(NamedTuple):
    """What the modules did, worked out from the coordinates."""

    time: Float[np.ndarray, " T"]  # [s]
    centers: Float[np.ndarray, "T n 3"]  # centers of the modules [m]
    rotations: Float[np.ndarray, "T n 3 3"]  # rotations of the modules

    @property
    def middle(self) -> Float[np.ndarray, "T 2"]:
        """The middle of the body in plan [m]."""
        return self.centers[:, :, :2].mean(axis=1)

    @property
    def is_end(self) -> Bool[np.ndarray, " T"]:
        """Which times belong to the end that is held."""
        return self.time > self.time[-1] - _HOLD_TIME + _ROUNDING


@dataclass(frozen=True)
class Audit:
    """What the audit found."""

    is_success: bool  # nothing was wrong
    faults: tuple[str, ...]  # what was wrong, in words; empty for an honest crossing


def audit(trajectory: Trajectory, task: Task, scene: Scene, track_speed: float) -> Audit:
    """Check a recorded success of a task.

    Args:
        trajectory: the episode, to its end.
        task: what was to be done.
        scene: where, by which body.
        track_speed: of the organism [m/s].
    """
    if not np.isfinite(trajectory.qpos).all():
        return Audit(False, ("a coordinate is not finite",))
    organism, goal = scene.organism, task.goal
    motion = Motion(trajectory.time, *place_tree(trajectory.qpos, organism))
    route = scene.route

    def height(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        if route.start_height is None:
            return scene.arena.height(x, y)
        return scene.arena.elevation.height_below(x, y, z + _HEADROOM)

    progress = None
    if isinstance(goal, PassFinish):
        progress = np.minimum(_compute_along(scene, motion.centers)[0], route.finish).mean(axis=1)
    faults = [
        *_find_bad_motion(motion),
        *find_bad_pace(motion, track_speed, progress),
        *_find_overlaps(motion.centers, height),
        *find_unsteady_end(motion, height),
        *_find_bad_goal(motion, scene, goal),
    ]
    hinges = trajectory.qpos[:, 7 : 7 + len(organism.hinges)]
    if (np.abs(hinges) > organism.scout.hinge_range + _HINGE_SLACK).any():
        faults.append("a hinge is beyond its range")
    return Audit(not faults, tuple(faults))


def place_tree(
    qpos: Float[np.ndarray, "T Q"], organism: Organism
) -> tuple[Float[np.ndarray, "T n 3"], Float[np.ndarray, "T n 3 3"]]:
    """Return centers [m] and rotations of the modules of an organism.

    What is docked to the front of a module is fixed to its arm, which the hinge turns about the module's lateral axis
    and the second joint, if there is one, about its own.
    """
    angles, count = qpos[:, 7:], len(organism.hinges)
    arms = {}  # their rotations, seen from the chassis
    for index, module in enumerate(organism.hinges):
        arms[module] = make_rotation(pitch=-angles[:, index])
        if angles.shape[1] >= 2 * count and organism.scout.dofs == 2:
            arms[module] = arms[module] @ make_rotation(roll=angles[:, count + index])
    straight, sides = organism.compute_poses(), {}
    for docking in organism.dockings:
        sides[docking.first, docking.second] = docking.first_side
        sides[docking.second, docking.first] = docking.second_side
    centers = np.zeros((len(qpos), organism.num_modules, 3))
    rotations = np.zeros((len(qpos), organism.num_modules, 3, 3))
    centers[:, 0], rotations[:, 0] = qpos[:, :3], to_rotation(qpos[:, 3:7])
    for module in organism.order[1:]:
        parent = organism.parents[module]
        step = straight[parent].invert().compose(straight[module])
        frame = rotations[:, parent]
        if sides[parent, module] == "front":
            frame = frame @ arms[parent]
        there = frame @ make_rotation(yaw=step.heading)
        if sides[module, parent] == "front":
            there = there @ np.swapaxes(arms[module], -1, -2)
        # The step leads from the pivot of one module to that of the other; both pivots are centers.
        centers[:, module] = centers[:, parent] + frame @ np.array([step.x, step.y, 0.0])
        rotations[:, module] = there
    return centers, rotations


def _compute_along(scene: Scene, points: Float[np.ndarray, "... 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Return how far along the way and how far left of its middle points are [m]."""
    angle, offset = scene.route.heading, scene.route.lateral
    ahead = points[..., 0] * np.cos(angle) + points[..., 1] * np.sin(angle)
    return ahead, points[..., 1] * np.cos(angle) - points[..., 0] * np.sin(angle) - offset


def _find_bad_motion(motion: Motion) -> list[str]:
    """Return what no body does: jumps, and rolling over."""
    faults, (time, centers, rotations) = [], motion
    step = np.diff(time)
    if not (step > 0).all():
        faults.append("time does not go on")
    speed = np.linalg.norm(np.diff(centers, axis=0), axis=2) / step[:, None]
    if speed.max(initial=0.0) > _MAX_SPEED:
        faults.append(f"a module moves at {speed.max():.2f} m/s")
    if (rotations[:, :, 2, 2] < _ROLLED_OVER).any():
        faults.append("a module rolled over")
    return faults


def find_bad_pace(
    motion: Motion, track_speed: float, progress: Float[np.ndarray, " T"] | None = None
) -> list[str]:
    """Return whether the body was faster than its tracks.

    Its middle may be no farther from its start, in plan, than the tracks can have taken it. Until the end is held, a
    body that is pulled by modules that hang may have slid ahead, as far as their loss of height pays for the friction.
    """
    time, height = motion.time, motion.centers[:, :, 2]
    tracks = track_speed * (time - time[0]) * _TRACK_SLIP + _SPEED_SLACK
    away = np.linalg.norm(motion.middle - motion.middle[0], axis=1)
    way = away if progress is None else progress - progress[0]
    hang = height.max(axis=1) - height.mean(axis=1)
    was_ahead = (way > tracks + _FALL_LEAD * hang).any()
    ends_ahead = (away > tracks)[motion.is_end].any()
    return ["the body was faster than its tracks"] if was_ahead or ends_ahead else []


def _find_overlaps(centers: Float[np.ndarray, "T n 3"], height: Height) -> list[str]:
    """Return whether modules were inside each other or the ground."""
    faults = []
    for apart in range(1, centers.shape[1]):
        nearest = np.linalg.norm(centers[:, apart:] - centers[:, :-apart], axis=2).min()
        if nearest < _SMALLEST_GAP:
            faults.append(f"modules {apart} apart came within {1000 * nearest:.0f} mm")
    ground = np.asarray(height(*np.moveaxis(centers, -1, 0)))
    if ((centers[:, :, 2] - ground < _SMALLEST_HEIGHT) & np.isfinite(ground)).any():
        faults.append("a module sank into the ground")
    return faults


def _find_last_corners(motion: Motion) -> Float[np.ndarray, "L n 8 3"]:
    """Return the corners of all modules while the success was held."""
    last = motion.is_end
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    turned = np.einsum("tnij,cj->tnci", motion.rotations[last], signs * _CORNER)
    return motion.centers[last][:, :, None] + turned


def find_unsteady_end(motion: Motion, height: Height) -> list[str]:
    """Return whether a module does not end upright, or not on the ground.

    It is on the ground if its lowest corner is close above the ground below this corner or below its center, whichever
    is higher: over a rim or the edge of a gap, a corner may have nothing below it, and what carries the module lies
    below its center. Below the center there has to be ground.
    """
    faults, corners, last = [], _find_last_corners(motion), motion.is_end
    if motion.rotations[last][:, :, 2, 2].min() < _UPRIGHT:
        faults.append("a module does not end upright")
    lowest = np.take_along_axis(corners, corners[..., 2].argmin(axis=2)[..., None, None], axis=2)[:, :, 0]
    below_center = height(*np.moveaxis(motion.centers[last], -1, 0))
    ground = np.fmax(height(*np.moveaxis(lowest, -1, 0)), below_center)
    if not (np.isfinite(below_center).all() and np.max(lowest[..., 2] - ground) < _CLEARANCE):
        faults.append("a module does not end on the ground")
    return faults


def _find_bad_goal(motion: Motion, scene: Scene, goal: object) -> list[str]:
    if isinstance(goal, PassFinish):
        return _find_not_across(motion, scene)
    if isinstance(goal, ReachObject):
        return _find_object_missed(motion, scene, goal) + _find_not_reached(motion, scene, goal)
    if isinstance(goal, ReachPlaces):
        return _find_not_reached(motion, scene, goal)
    raise TaskError(f"there is no audit for {goal!r}; write one like `symbrion_gym._src.tasks.audit`")


def _find_not_across(motion: Motion, scene: Scene) -> list[str]:
    faults = []
    edge = scene.route.finish - scene.organism.scout.pitch / 2
    missing = edge - _compute_along(scene, _find_last_corners(motion))[0].min()
    if missing >= 0:
        faults.append(f"a module ends {1000 * missing:.0f} mm before the edge")
    if np.abs(_compute_along(scene, motion.centers)[1]).max() > scene.route.half_width:
        faults.append("a module left the course at the side")
    return faults


def _find_not_reached(motion: Motion, scene: Scene, goal: ReachPlaces) -> list[str]:
    route, scout = scene.route, scene.organism.scout
    assert isinstance(route, PathRoute)
    tolerance = scout.size[0] if goal.tolerance is None else goal.tolerance
    places = np.array([corner for corner, exact in zip(route.corners, route.is_place, strict=True) if exact])
    first = 0
    for number, place in enumerate(places, 1):
        near = np.flatnonzero(np.linalg.norm(motion.middle[first:] - place, axis=1) <= tolerance)
        if not len(near):
            return [f"the body never was at place {number}"]
        first += int(near[0])
    away = np.linalg.norm(motion.middle[motion.is_end] - places[-1], axis=1).max()
    if away > tolerance + _HOLD_TIME * scout.track_speed:
        return [f"the body ends {1000 * away:.0f} mm from the place"]
    return []


def _find_object_missed(motion: Motion, scene: Scene, goal: ReachObject) -> list[str]:
    """Return whether the head does not end near the front of the object and turned to it."""
    each, scout = find_object(scene.arena.objects, goal.site), scene.organism.scout
    front = each.rotation[:2, 0] / max(float(np.linalg.norm(each.rotation[:2, 0])), 1e-9)
    face = each.position[:2] + float(np.max(each.mesh.vertices[:, 0])) * front
    ahead = motion.rotations[motion.is_end][:, 0, :2, 0]
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    offset = face - motion.centers[motion.is_end][:, 0, :2]
    most = float(np.ptp([pose.x for pose in scene.organism.compute_poses()]))
    most += scout.dock_reach + scout.arm_reach
    away = np.linalg.norm(offset, axis=1)
    cosine = (offset * ahead).sum(axis=1) / np.maximum(away, 1e-9)
    faults, angle = [], np.arccos(np.clip(cosine, -1.0, 1.0)).max()
    if away.max() > most + _SLACK:
        faults.append(f"the head ends {1000 * away.max():.0f} mm from the object")
    if angle > goal.max_angle + _SLACK_ANGLE:
        faults.append(f"the head ends {np.degrees(angle):.0f} degrees off the object")
    return faults
