"""An organism laid on the ground: where its head is, how steep, and how far its hinges are bent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction.geometry.pose import PlanarPose, make_quaternion
from symbrion_gym.arenas.arena import Arena
from symbrion_gym.errors import ArenaError
from symbrion_gym.robot.organism import Organism, snake

_LIFT = 0.002
"""Gap between the tracks and the ground at the start [m]: without one, contacts would begin with a push."""
_SAMPLES = 0.005
"""Spacing of the heights along the start line [m], small against a module."""
_LINE_MARGIN = 0.2
"""The line of heights reaches this much farther than the organism at both ends [m]."""
_FOOTPRINT = 0.06 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
"""Points of a module over which the highest ground is taken where organisms are no snakes [m]: a little beyond its
sides, which are 0.0525 m from its center."""
_NUM_ITERATIONS = 8
"""Of the fixed-point iteration that puts a module's end on the ground."""
_SMALLEST_STEP = 0.2
"""A module stands no steeper than this share of its length along the ground."""
_STRETCH = 20
"""The ground on a storey is followed over as many samples at a time: a module's length."""
_STOREY_RISE = 0.10
"""Ground that rises by more than this over such a stretch is what hangs above, not ground [m]."""


class LaidPose(NamedTuple):
    """An organism at rest on the ground.

    Attributes:
        position: center of module 0 [m].
        quaternion: its orientation (w, x, y, z).
        hinges: angles of the working hinges, in the order of `Organism.hinges` [rad].
    """

    position: Float[np.ndarray, " 3"]
    quaternion: Float[np.ndarray, " 4"]
    hinges: Float[np.ndarray, " h"]


class GroundPlacement:
    """Lays an organism on the ground of an arena.

    Args:
        arena: arena with the ground.
        organism: who is laid down.
        level: height of the storey of the start [m]; None where there is only one.
    """

    def __init__(self, arena: Arena, organism: Organism, level: float | None) -> None:
        self._arena, self._organism, self._level = arena, organism, level
        self._poses = organism.find_poses()
        self._is_snake = organism == snake(organism.num_modules, organism.scout)

    def lay(self, head: PlanarPose) -> LaidPose:
        """Return the organism at rest with module 0 at a place, bent as the ground is.

        Args:
            head: place and heading of module 0.

        Raises:
            ArenaError: the place lies off the surface.
        """
        organism = self._organism
        back = np.arange(
            -_LINE_MARGIN, (organism.num_modules + 1) * organism.scout.pitch + _LINE_MARGIN, _SAMPLES
        )
        x, y = head.x - np.cos(head.heading) * back, head.y - np.sin(head.heading) * back
        heights = _roll_over(self._find_heights(x, y), organism.scout.size[2] / 2) + _LIFT
        if self._is_snake:
            z, pitch, hinges = _follow_ground(back, heights, organism)
        else:
            pitch, hinges = 0.0, np.zeros(len(organism.hinges))
            world = [head.compose(pose) for pose in self._poses]
            xy = np.array([(pose.x, pose.y) for pose in world])
            spots = np.concatenate([xy + point for point in _FOOTPRINT])
            z = (
                float(np.max(self._find_heights(spots[:, 0], spots[:, 1])))
                + organism.scout.size[2] / 2
                + _LIFT
            )
        return LaidPose(np.array([head.x, head.y, z]), make_quaternion(head.heading, -pitch), hinges)

    def _find_heights(
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
            raise ArenaError(
                f"the start ({x[0]:.2f}, {y[0]:.2f}) lies off the surface of arena {self._arena.name!r}"
            )
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
