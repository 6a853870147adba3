"""Find the pit in a scanned arena: where the ground along the way drops and rises again like walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from reconstruction.range_checks import check_counts, check_positive
from symbrion_gym.arenas.arena import Arena
from symbrion_gym.errors import OptionError


@dataclass(frozen=True)
class PitSearch:
    """What counts as a pit.

    Attributes:
        step: spacing of the heights along the way [m]; near and far edge are exact to this.
        wall_steps: a wall's height is gained or lost within this number of steps, as scanned walls lean.
        depth: smallest height of the walls [m]; what is lower is a step.
        max_width: a wider gap is ground to drive on [m]; an organism of 8 modules is 1 m long.
        lanes: offsets to the left of the way [m]; the profile is their median, so that one lane through a
            hole of the scan does not count.

    Raises:
        OptionError: a number is out of range.
    """

    step: float = 0.01
    wall_steps: int = 4
    depth: float = 0.08
    max_width: float = 1.5
    lanes: tuple[float, ...] = (-0.3, -0.15, 0.0, 0.15, 0.3)

    def __post_init__(self) -> None:
        check_positive(self, ("step", "depth", "max_width"), OptionError)
        check_counts(self, ("wall_steps",), OptionError)
        if not len(self.lanes):
            raise OptionError("PitSearch: lanes are empty; give at least one offset")


def find_pit(
    arena: Arena,
    start: Float[np.ndarray, " 2"],
    direction: Float[np.ndarray, " 2"],
    length: float,
    search: PitSearch | None = None,
) -> tuple[float, float, float] | None:
    """Return distances of the near and the far edge from the start, and the height of the floor [m].

    Args:
        arena: what was scanned.
        start: (x, y) where the way begins [m].
        direction: unit vector of the way.
        length: length of the way [m].
        search: what counts as a pit; None for the defaults.

    Returns:
        The first pit on the way; None where there is none.
    """
    search = search or PitSearch()
    wall = search.wall_steps
    distance = np.arange(0.0, length, search.step)
    heights = _read_profile(arena, start, direction, distance, search.lanes)
    change = heights[wall:] - heights[:-wall]
    falls = np.flatnonzero(change < -search.depth)
    if not len(falls):
        return None
    rises = np.flatnonzero(change > search.depth)
    rises = rises[rises > falls[0] + wall]
    if not len(rises):
        return None
    top, floor = heights[falls[0]], float(np.median(heights[falls[0] + wall : rises[0] + 1]))
    inside = np.flatnonzero(heights[falls[0] : rises[0] + 2 * wall] < (top + floor) / 2) + falls[0]
    if not len(inside) or distance[inside[-1]] - distance[inside[0]] > search.max_width:
        return None
    return float(distance[inside[0]]), float(distance[inside[-1]]), floor


def _read_profile(
    arena: Arena,
    start: Float[np.ndarray, " 2"],
    direction: Float[np.ndarray, " 2"],
    distance: Float[np.ndarray, " D"],
    lanes: tuple[float, ...],
) -> Float[np.ndarray, " D"]:
    """Return heights along the way; gaps in the scan take the height before them."""
    left = np.array([-direction[1], direction[0]])
    positions = start + distance[:, None, None] * direction + np.array(lanes)[:, None] * left
    heights = arena.height(positions[..., 0].ravel(), positions[..., 1].ravel()).reshape(len(distance), -1)
    is_seen = np.isfinite(heights).any(axis=1)
    profile = np.zeros(len(distance))
    profile[is_seen] = np.nanmedian(heights[is_seen], axis=1)
    last_seen = np.maximum.accumulate(np.where(is_seen, np.arange(len(distance)), 0))
    return profile[last_seen]
