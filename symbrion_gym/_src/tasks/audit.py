"""The audit, a second check of every task: is a recorded success honest? It shares the definition alone with the first.

It sees generalized coordinates, the surface, and where the task says that the body should be. Where every module was,
it works out by itself (`symbrion_gym._src.tasks.starts`), and it looks for the traces of a cheat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.audit_checks import (
    Audit,
    AuditLimits,
    Motion,
    Trajectory,
    compute_progress,
    find_bad_hinges,
    find_bad_motion,
    find_bad_pace,
    find_end,
    find_last_corners,
    find_not_docked,
    find_not_faced,
    find_overlaps,
    find_unsteady_end,
)
from symbrion_gym._src.tasks.explore import AreaRoute, SeeGround
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.objects import DockAtObject, ReachObject
from symbrion_gym._src.tasks.paths import PathRoute
from symbrion_gym._src.tasks.reach import ReachPlaces
from symbrion_gym._src.tasks.scene import Scene
from symbrion_gym._src.tasks.starts import place_tree
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.traverse import StandUp

_CELL = 0.75  # A body that looks at the ground from the middle of cells may be this many cells off
_TUMBLED = -1.1  # No module leans by more than this z of its up axis: after a tumble any is allowed


@dataclass(frozen=True)
class _Case:
    """An episode that is audited."""

    motion: Motion
    scene: Scene
    limits: AuditLimits

    @property
    def organism(self) -> Organism:
        return self.scene.organism

    @property
    def middle(self) -> Float[np.ndarray, "T 2"]:
        return self.motion.centers[:, :, :2].mean(axis=1)

    @property
    def is_end(self) -> Bool[np.ndarray, " T"]:
        return find_end(self.motion.time, self.limits)

    def compute_along(self, points: Float[np.ndarray, "... 3"]) -> tuple[np.ndarray, np.ndarray]:
        """Return how far along the way and how far left of its middle points are [m]."""
        angle, offset = self.scene.route.heading, self.scene.route.lateral
        ahead = points[..., 0] * np.cos(angle) + points[..., 1] * np.sin(angle)
        return ahead, points[..., 1] * np.cos(angle) - points[..., 0] * np.sin(angle) - offset


def audit(
    trajectory: Trajectory, task: Task, scene: Scene, track_speed: float, limits: AuditLimits | None = None
) -> Audit:
    """Check a recorded success of a task.

    Args:
        trajectory: the episode, to its end.
        task: what was to be done.
        scene: where, by which body.
        track_speed: of the organism [m/s].
        limits: of an honest success; None for the defaults.
    """
    limits = limits or AuditLimits()
    if not np.isfinite(trajectory.qpos).all():
        return Audit(False, ("a coordinate is not finite",))
    organism, scout = scene.organism, scene.organism.scout
    case = _Case(Motion(trajectory.time, *place_tree(trajectory.qpos, organism)), scene, limits)
    goal, height = task.goal, _find_height(scene)
    rolled_over = _TUMBLED if isinstance(goal, StandUp) else limits.rolled_over
    hinges = trajectory.qpos[:, 7 : 7 + len(organism.hinges)]
    faults = [
        *find_bad_hinges(hinges, scout.hinge_range + limits.hinge_slack),
        *find_bad_motion(case.motion, limits, rolled_over),
        *find_bad_pace(case.motion, track_speed, limits, _compute_progress(case, goal)),
        *find_overlaps(case.motion.centers, height, limits),
        *find_unsteady_end(case.motion, height, limits),
        *_find_bad_goal(case, goal),
    ]
    return Audit(not faults, tuple(faults))


def _find_height(scene: Scene):
    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if scene.route.start_height is None:
            return scene.arena.height(x, y)
        return scene.arena.elevation.height_below(x, y, np.full(np.shape(x), scene.route.start_height + 0.25))

    return height


def _compute_progress(case: _Case, goal: object) -> Float[np.ndarray, " T"] | None:
    if not isinstance(goal, PassFinish):
        return None
    return compute_progress(case.compute_along(case.motion.centers)[0], case.scene.route.finish)


def _find_bad_goal(case: _Case, goal: object) -> list[str]:
    if isinstance(goal, PassFinish):
        return _find_not_across(case)
    if isinstance(goal, DockAtObject):
        return find_not_docked(case.motion, case.is_end, case.scene, goal)
    if isinstance(goal, ReachObject):
        faults = find_not_faced(case.motion, case.is_end, case.scene, goal)
        return faults + _find_not_reached(case, goal)
    if isinstance(goal, ReachPlaces):
        return _find_not_reached(case, goal)
    if isinstance(goal, SeeGround):
        return _find_unseen(case, goal)
    if isinstance(goal, StandUp):
        return []
    raise TaskError(f"there is no audit for {goal!r}; write one like `symbrion_gym._src.tasks.audit`")


def _find_not_across(case: _Case) -> list[str]:
    faults, route, motion = [], case.scene.route, case.motion
    corners = find_last_corners(motion, case.limits)
    edge = route.finish - case.organism.scout.pitch / 2
    missing = edge - case.compute_along(corners)[0].min()
    if missing >= 0:
        faults.append(f"a module ends {1000 * missing:.0f} mm before the edge")
    if np.abs(case.compute_along(motion.centers)[1]).max() > route.half_width:
        faults.append("a module left the course at the side")
    return faults


def _find_not_reached(case: _Case, goal: ReachPlaces) -> list[str]:
    route = case.scene.route
    assert isinstance(route, PathRoute)
    tolerance = case.organism.scout.size[0] if goal.tolerance is None else goal.tolerance
    places = np.array([corner for corner, exact in zip(route.corners, route.is_place, strict=True) if exact])
    first = 0
    for number, place in enumerate(places, 1):
        near = np.flatnonzero(np.linalg.norm(case.middle[first:] - place, axis=1) <= tolerance)
        if not len(near):
            return [f"the body never was at place {number}"]
        first += int(near[0])
    away = np.linalg.norm(case.middle[case.is_end] - places[-1], axis=1).max()
    if away > tolerance + case.limits.hold_time * case.organism.scout.track_speed:
        return [f"the body ends {1000 * away:.0f} mm from the place"]
    return []


def _find_unseen(case: _Case, goal: SeeGround) -> list[str]:
    from scipy.spatial import cKDTree

    route = case.scene.route
    assert isinstance(route, AreaRoute)
    reach = route.sight + _CELL * route.edge
    away, _ = cKDTree(case.motion.centers[:, 0, :2]).query(route.places)
    share = float(np.mean(away <= reach))
    return [] if share >= goal.share else [f"only {share:.0%} of the ground was seen"]
