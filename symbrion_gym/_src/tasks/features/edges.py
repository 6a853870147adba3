"""Edges across a way: where the ground jumps, as lines through all lanes that show them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.tasks.features.way import Profile

_NEAR = 0.05  # A lane shows an edge where it jumps this close to the line through the others [m]
LEAST_LANES = 3  # A line is drawn through at least as many lanes
_HALVINGS = 7  # Intervals of 1 cm are halved as often: 0.1 mm


class Jump(NamedTuple):
    """A jump of the ground along a lane: it changes like a wall."""

    first: int  # sample before it
    last: int  # sample after it
    rise: float  # what the ground gains there [m]; below 0 for a fall


class Edge(NamedTuple):
    """An edge across a way."""

    s: float  # where it crosses the middle of the way [m]
    skew: float  # gain of s to the left: tangent of the angle from the perpendicular of the way
    share: float  # share of the lanes that show it


def find_jumps(heights: Float[np.ndarray, " D"], least: float, wall: int) -> list[Jump]:
    """Return the jumps along a lane, in order."""
    change = heights[wall:] - heights[:-wall]
    jumps = []
    for sign in (-1.0, 1.0):
        at = np.flatnonzero(sign * change > least)
        for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if len(at) else []:
            first, last = int(run[0]), int(run[-1]) + wall
            if len(run) <= 2 * wall:  # what goes on like this is a slope
                jumps.append(Jump(first, last, float(heights[last] - heights[first])))
    return sorted(jumps)


def find_crossings(
    profile: Profile,
    lanes: Int[np.ndarray, " W"],
    spans: Int[np.ndarray, "W 2"],
    levels: Float[np.ndarray, " W"],
) -> Float[np.ndarray, " W"]:
    """Return s where lanes pass a level between two samples, to 0.1 mm [m]; nan where they do not."""
    brackets = [_find_bracket(profile, *case) for case in zip(lanes, spans, levels, strict=True)]
    low, high = np.array(brackets).reshape(-1, 2).T
    known, left = np.isfinite(low), profile.left[lanes]
    is_falling = np.zeros(len(lanes), dtype=bool)
    is_falling[known] = profile.read(low[known], left[known]) >= levels[known]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        is_above = np.zeros(len(lanes), dtype=bool)
        is_above[known] = profile.read(middle[known], left[known]) >= levels[known]
        is_before = is_above == is_falling
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return (low + high) / 2


def _find_bracket(
    profile: Profile, lane: int, span: Int[np.ndarray, " 2"], level: float
) -> tuple[float, float]:
    """Return the samples between which a lane passes a level [m]; the middle one of several passes."""
    if span[0] < 0:
        return np.nan, np.nan
    window = profile.heights[span[0] : span[1] + 1, lane] - level
    is_seen = np.isfinite(window[:-1]) & np.isfinite(window[1:])
    passes = np.flatnonzero(((window[:-1] < 0) != (window[1:] < 0)) & is_seen)
    if not len(passes):
        return np.nan, np.nan
    k = int(span[0]) + int(passes[len(passes) // 2])
    return float(profile.s[k]), float(profile.s[k + 1])


def fit_edge(profile: Profile, places: Float[np.ndarray, " L"]) -> Edge | None:
    """Return the line through the places where lanes jump; None where fewer than three lanes agree.

    Theil-Sen: the median slope between two lanes, then least squares over the lanes within 5 cm.
    """
    left = profile.left[profile.on_way]
    known = np.flatnonzero(np.isfinite(places))
    if len(known) < LEAST_LANES:
        return None
    x, y = left[known], places[known]
    first, second = np.triu_indices(len(x), 1)
    skew = float(np.median((y[second] - y[first]) / (x[second] - x[first])))
    offset = float(np.median(y - skew * x))
    is_near = np.abs(y - skew * x - offset) < _NEAR
    if is_near.sum() < LEAST_LANES:
        return None
    skew, offset = np.polyfit(x[is_near], y[is_near], 1)
    return Edge(float(offset), float(skew), float(is_near.sum()) / len(left))


def find_lanes(profile: Profile) -> Int[np.ndarray, " W"]:
    """Return the numbers of the lanes on the way."""
    return np.flatnonzero(profile.on_way)
