"""Find the pit in a scanned arena: where the ground along the way drops and rises again like walls."""

from __future__ import annotations

import numpy as np

from symbrion_gym.arenas.arena import Arena

_STEP = 0.01
"""Spacing of the heights along the way [m]."""
_WALL = 4
"""A wall's height is gained or lost within so many steps."""
_DEPTH = 0.08
"""Least height of the walls [m]."""
_WIDEST = 1.5
"""A gap wider than this is no pit to cross but ground to drive on [m]."""
_LANES = (-0.3, -0.15, 0.0, 0.15, 0.3)
"""The profile is the median of these lanes beside the way [m]."""


def find_pit(
    arena: Arena, start: np.ndarray, direction: np.ndarray, length: float
) -> tuple[float, float, float] | None:
    """Return distances of the near and the far edge from the start, and the height of the floor [m].

    Args:
        arena: what was scanned.
        start: (x, y) where the way begins [m].
        direction: `[2]` unit vector of the way.
        length: of the way [m].

    Returns:
        The first pit on the way; None where there is none.
    """
    distance = np.arange(0.0, length, _STEP)
    heights = _read_profile(arena, start, direction, distance)
    change = heights[_WALL:] - heights[:-_WALL]
    falls = np.flatnonzero(change < -_DEPTH)
    if not len(falls):
        return None
    rises = np.flatnonzero(change > _DEPTH)
    rises = rises[rises > falls[0] + _WALL]
    if not len(rises):
        return None
    top, floor = heights[falls[0]], float(np.median(heights[falls[0] + _WALL : rises[0] + 1]))
    inside = np.flatnonzero(heights[falls[0] : rises[0] + 2 * _WALL] < (top + floor) / 2) + falls[0]
    if not len(inside) or distance[inside[-1]] - distance[inside[0]] > _WIDEST:
        return None
    return float(distance[inside[0]]), float(distance[inside[-1]]), floor


def _read_profile(arena: Arena, start: np.ndarray, direction: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return heights `[D]` along the way; gaps in the scan take the height before them."""
    aside = np.array([-direction[1], direction[0]])
    places = start + distance[:, None, None] * direction + np.array(_LANES)[:, None] * aside
    heights = arena.height(places[..., 0].ravel(), places[..., 1].ravel()).reshape(len(distance), -1)
    is_seen = np.isfinite(heights).any(axis=1)
    profile = np.zeros(len(distance))
    profile[is_seen] = np.nanmedian(heights[is_seen], axis=1)
    last_seen = np.maximum.accumulate(np.where(is_seen, np.arange(len(distance)), 0))
    return profile[last_seen]
