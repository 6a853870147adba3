"""An organism put on the ground: where its head is, how steep, and how far its hinges are bent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.pose import PlanarPose, make_quaternion
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism, snake

LIFT = 0.002
"""Gap between the tracks and the ground at the start [m]: without one, contacts would begin with a push."""
_SAMPLES = 0.005  # Spacing of the heights along the start line [m], small against a module
_LINE_MARGIN = 0.2  # The line of heights reaches this much farther than the organism at both ends [m]
_FOOTPRINT = 0.06 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
"""Points of a module over which the highest ground is taken where organisms are no snakes [m]: a little beyond its
sides, which are 0.0525 m from its center."""
_NUM_ITERATIONS = 8  # Of the fixed-point iteration that puts a module's end on the ground
_SMALLEST_STEP = 0.2  # A module stands no steeper than this share of its length along the ground
_STRETCH = 20  # The ground on a storey is followed over as many samples at a time: a module's length
_STOREY_RISE = 0.10
"""Ground that rises by more than this over such a stretch is what hangs above, not ground [m]."""


class LaidPose(NamedTuple):
    """An organism at rest on the ground."""

    position: Float[np.ndarray, " 3"]  # center of module 0 [m]
    quaternion: Float[np.ndarray, " 4"]  # its orientation (w, x, y, z)
    hinges: Float[np.ndarray, " h"]  # angles of the working hinges, in the order of `Organism.hinges` [rad]


class GroundPlacement:
    """Lays an organism on the ground of an arena.

    Args:
        arena: arena with the ground.
        organism: who is laid down.
        level: height of the storey of the start [m]; None where there is only one.

    Attributes:
        is_snake: whether the hinges follow the ground; other bodies are laid flat, and `Settler` bends them.
    """

    def __init__(self, arena: Arena, organism: Organism, level: float | None) -> None:
        self._arena, self._organism, self._level = arena, organism, level
        self._poses = organism.compute_poses()
        self.is_snake = organism == snake(organism.num_modules, organism.scout)

    def lay(self, head: PlanarPose) -> LaidPose:
        """Return the organism with module 0 at a place: a snake bent as the ground is, others flat above it."""
        if self.is_snake:
            height, pitch, hinges = self._follow_line(head)
        else:
            height, pitch, hinges = self._find_top(head), 0.0, np.zeros(len(self._organism.hinges))
        position = np.array([head.x, head.y, height])
        return LaidPose(position, make_quaternion(head.heading, -pitch), hinges)

    def _follow_line(self, head: PlanarPose) -> tuple[float, float, Float[np.ndarray, " h"]]:
        """Return head height, head pitch and hinge angles of a snake."""
        organism = self._organism
        back = np.arange(
            -_LINE_MARGIN, (organism.num_modules + 1) * organism.scout.pitch + _LINE_MARGIN, _SAMPLES
        )
        x, y = head.x - np.cos(head.heading) * back, head.y - np.sin(head.heading) * back
        heights = _roll_over(self._compute_heights(x, y), organism.scout.size[2] / 2) + LIFT
        return _follow_ground(back, heights, organism)

    def _find_top(self, head: PlanarPose) -> float:
        """Return the height of module 0 with which a flat body clears the highest ground below it.

        On one of several storeys, the ground below a module is that near the height of the ground below its parent.
        """
        organism = self._organism
        world = [head.compose(pose) for pose in self._poses]
        spots = np.array([(pose.x, pose.y) for pose in world])[:, None] + _FOOTPRINT
        if self._level is None:
            heights = np.asarray(self._arena.height(*spots.reshape(-1, 2).T), dtype=np.float64)
        else:
            heights = self._follow_tree(spots, self._level)
        if not np.isfinite(heights).any():
            raise self._make_error(head.x, head.y)
        return float(np.nanmax(heights)) + organism.scout.size[2] / 2 + LIFT

    def _follow_tree(self, spots: Float[np.ndarray, "n S 2"], level: float) -> Float[np.ndarray, "n S"]:
        """Return ground heights below the modules, from each to its neighbors; nan where there is none."""
        organism = self._organism
        heights = np.full(spots.shape[:2], np.nan)
        levels = np.full(organism.num_modules, level)
        for module in organism.order:
            parent = organism.parents[module]
            levels[module] = level if parent < 0 else levels[parent]
            limit = levels[module] + _STOREY_RISE
            x, y = spots[module].T
            heights[module] = self._arena.elevation.height_below(x, y, limit)
            if np.isfinite(heights[module]).any():
                levels[module] = np.nanmax(heights[module])
        return heights

    def _make_error(self, x: float, y: float) -> ArenaError:
        return ArenaError(f"the start ({x:.2f}, {y:.2f}) lies off the surface of arena {self._arena.name!r}")

    def _compute_heights(
        self, x: Float[np.ndarray, " S"], y: Float[np.ndarray, " S"]
    ) -> Float[np.ndarray, " S"]:
        """Return ground heights; beyond the rim, the nearest known one along the line."""
        level = self._level
        if level is None:
            heights = np.asarray(self._arena.height(x, y), dtype=np.float64)
        else:
            heights = _follow_storey(self._arena, x, y, level)
        known = np.flatnonzero(np.isfinite(heights))
        if not len(known):
            raise self._make_error(x[0], y[0])
        return np.interp(np.arange(len(heights)), known, heights[known])


def _follow_storey(
    arena: Arena, x: Float[np.ndarray, " S"], y: Float[np.ndarray, " S"], level: float
) -> Float[np.ndarray, " S"]:
    """Return heights of the ground on the storey of a start, below what hangs above it; nan where there is none."""
    heights = np.full(len(x), np.nan)
    for first in range(0, len(x), _STRETCH):
        some = slice(first, first + _STRETCH)
        heights[some] = arena.elevation.height_below(x[some], y[some], level + _STOREY_RISE)
        known = heights[some][np.isfinite(heights[some])]
        level = float(known[-1]) if len(known) else level
    return heights


def _roll_over(heights: Float[np.ndarray, " S"], radius: float) -> Float[np.ndarray, " S"]:
    """Return how high the center of a disc rolls over ground heights sampled every `_SAMPLES`."""
    from scipy.ndimage import grey_dilation

    reach = int(radius / _SAMPLES)
    shift = np.arange(-reach, reach + 1)
    rise = np.sqrt(np.maximum(radius**2 - (shift * _SAMPLES) ** 2, 0.0))
    return grey_dilation(heights, structure=rise, mode="nearest")


def _follow_ground(
    back: Float[np.ndarray, " S"], heights: Float[np.ndarray, " S"], organism: Organism
) -> tuple[float, float, Float[np.ndarray, " h"]]:
    """Lay a snake on a height line, head at 0; return head height, head pitch and hinge angles."""
    pitch, count = organism.scout.pitch, organism.num_modules
    s, z = np.zeros(count + 1), np.zeros(count + 1)
    z[0] = np.interp(0.0, back, heights)
    for i in range(1, count + 1):
        step = pitch
        for _ in range(_NUM_ITERATIONS):
            z[i] = np.interp(s[i - 1] + step, back, heights)
            step = np.sqrt(max(pitch**2 - (z[i] - z[i - 1]) ** 2, (_SMALLEST_STEP * pitch) ** 2))
        s[i] = s[i - 1] + step
    nose_up = np.arctan2(z[:-1] - z[1:], s[1:] - s[:-1])
    limit = organism.scout.hinge_range
    return float(z[0]), float(nose_up[0]), np.clip(nose_up[:-1] - nose_up[1:], -limit, limit)
