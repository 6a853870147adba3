"""Where and how a body starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.pose import make_rotation, to_rotation
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.way import Way
from symbrion_gym._src.tasks.route import Point, Route, RouteMargins, StartName
from symbrion_gym._src.traversability.routes import read_place

START_NAMES = ("floor", "pit")


@dataclass(frozen=True)
class Start:
    """Where a body starts, and whether it has been tumbled.

    Raises:
        TaskError: no such place, or angles that are no range.
    """

    # "floor": before the ramp or step, or the beginning of the way; "pit": before the pit; or (x, y) or (x,
    # y, z) of the head [m], where z selects one of several storeys
    place: StartName | Point = "floor"
    # smallest and largest angle by which the body is turned about the axis of its head [rad]; drawn for every
    # episode
    roll: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        place = self.place
        if isinstance(place, str):
            if place not in START_NAMES:
                raise TaskError(f"start must be {' or '.join(START_NAMES)}, or a place, got {place!r}")
        else:
            try:
                point = np.asarray(place, dtype=np.float64).ravel()
            except (TypeError, ValueError):
                point = np.zeros(0)
            if len(point) not in (2, 3) or not np.isfinite(point).all():
                raise TaskError(f"start must be a place (x, y) or (x, y, z) in meters, got {place!r}")
            object.__setattr__(self, "place", tuple(point.tolist()))
        if self.roll is not None:
            low, high = self.roll
            if not -np.pi <= low <= high <= np.pi:
                raise TaskError(f"roll must be (low, high) within -pi to pi, got {self.roll!r}")
            object.__setattr__(self, "roll", (float(low), float(high)))

    def randomize(self) -> Mapping[str, Any]:
        """Return the reset options that belong to the start."""
        return {} if self.roll is None else {"roll": self.roll}


def place_tree(
    qpos: Float[np.ndarray, "T Q"], organism: Organism
) -> tuple[Float[np.ndarray, "T n 3"], Float[np.ndarray, "T n 3 3"]]:
    """Return centers [m] and rotations of the modules of an organism.

    What is docked to the front of a module is fixed to its arm, which the hinge turns about the module's lateral axis
    and the second joint, if there is one, about its own.
    """
    arms = _turn_arms(qpos[:, 7:], organism)
    straight = organism.compute_poses()
    sides = {(one, other): side for one, side, other in _list_dockings(organism)}
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


def _turn_arms(angles: Float[np.ndarray, "T J"], organism: Organism) -> dict[int, Float[np.ndarray, "T 3 3"]]:
    """Return the rotation of the arm of each module with a hinge, seen from its chassis."""
    count = len(organism.hinges)
    arms = {}
    for index, module in enumerate(organism.hinges):
        arm = make_rotation(pitch=-angles[:, index])
        if angles.shape[1] >= 2 * count > 0 and organism.scout.dofs == 2:
            arm = arm @ make_rotation(roll=angles[:, count + index])
        arms[module] = arm
    return arms


def _list_dockings(organism: Organism) -> list[tuple[int, str, int]]:
    """Return (module, its side, its neighbor) of every dock in use."""
    found = []
    for docking in organism.dockings:
        found.append((docking.first, docking.first_side, docking.second))
        found.append((docking.second, docking.second_side, docking.first))
    return found


_NOSE = 0.02  # Room behind the tail at the start of a way, beside half a module [m]


def make_route(
    arena: Arena,
    organism: Organism,
    way: Way,
    start: Start,
    foot: float,
    finish: float,
    pit: tuple[float, float, float] | None = None,
    margins: RouteMargins | None = None,
) -> Route:
    """Make the route along a way to what was found on it."""
    margins = margins or RouteMargins()
    reach, place = organism.scout.arm_reach, start.place
    lateral = way.lateral
    if isinstance(place, str):
        if place == "pit" and pit is None:
            raise ArenaError(f"the way in arena {arena.name!r} has no pit; give start='floor' or (x, y)")
        begin = foot - margins.before_foot - reach
        if place == "pit" and pit is not None:
            begin = pit[0] - margins.before_pit - reach
        begin = max(begin, way.begin + _compute_tail(organism) + organism.scout.size[0] / 2 + _NOSE)
    else:
        c, n = way.direction
        x, y = read_place("start", place)[:2]
        begin, lateral = c * x + n * y, c * y - n * x
        if begin >= finish:
            raise ArenaError(
                f"the start ({x:.2f}, {y:.2f}) lies beyond the finish in arena {arena.name!r}, which is "
                f"{begin - finish:.2f} m behind it; the way leads to ({c:.2f}, {n:.2f})"
            )
    at = way.place(begin, lateral - way.lateral)
    if not np.isfinite(arena.height(*at)):
        raise ArenaError(f"the start ({at[0]:.2f}, {at[1]:.2f}) lies off the surface of arena {arena.name!r}")
    lowest = float(np.asarray(arena.surface.bounds, dtype=np.float64)[0, 2]) - margins.below
    half_width = way.half_width + abs(lateral - way.lateral)
    return Route(way.heading, float(begin), float(lateral), float(finish), half_width, lowest, pit)


def _compute_tail(organism: Organism) -> float:
    """Return how far the organism reaches behind the center of module 0 [m]."""
    return -min(pose.x for pose in organism.compute_poses())
