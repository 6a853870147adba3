"""The gap on a way: where the ground drops and rises again like walls, across the whole way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_counts, check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.edges import (
    LEAST_LANES,
    Edge,
    Jump,
    find_crossings,
    find_jumps,
    find_lanes,
    fit_edge,
)
from symbrion_gym._src.tasks.features.ramp import RampSearch, find_ramps
from symbrion_gym._src.tasks.features.way import Line, Profile, Way, WaySearch, read_profile

_STRAIGHT = float(np.tan(np.deg2rad(1.0)))  # A way whose edges are skewed by less is perpendicular to them
_SPREAD = 0.02  # Edges whose lanes scatter by this [m] halve the confidence


@dataclass(frozen=True)
class GapSearch:
    """What counts as a gap.

    Raises:
        OptionError: a number is out of range.
    """

    step: float = 0.01  # spacing of the heights along the way [m]
    # a wall's height is gained or lost within this number of steps, as scanned walls lean
    wall_steps: int = 4
    depth: float = 0.08  # smallest height of the walls [m]; what is lower is a step
    max_width: float = 1.5  # a wider gap is ground to drive on [m]; an organism of 8 modules is 1 m long
    # share of the lanes that have to show both edges; where fewer do, an organism drives around it
    agreement: float = 0.6
    ramp: RampSearch | None = None  # what counts as a ramp before the gap, at whose foot the start is

    def __post_init__(self) -> None:
        check_positive(self, ("step", "depth", "max_width", "agreement"), OptionError)
        check_counts(self, ("wall_steps",), OptionError)


@dataclass(frozen=True)
class Gap:
    """A gap, with the way across it; s along that way [m]."""

    way: Way  # the way, perpendicular to the edges unless its direction was given
    start: float  # s of the foot of the ramp before the gap; without a ramp, where the surface begins [m]
    near: float  # s of the near edge, in the middle of the way [m]
    far: float  # s of the far edge [m]
    floor: float  # height of its floor [m]
    top: float  # height of the ground at the near edge [m]
    confidence: float  # from 0 to 1: share of the lanes that show both edges, times how well they agree

    @property
    def width(self) -> float:
        """Distance of the edges along the way [m]."""
        return self.far - self.near

    @property
    def depth(self) -> float:
        """Height of the near wall [m]."""
        return self.top - self.floor

    @property
    def near_edge(self) -> Line:
        """The near edge, across the way."""
        return self.way.find_line(self.near)

    @property
    def far_edge(self) -> Line:
        """The far edge, across the way."""
        return self.way.find_line(self.far)

    def find_finish(self, organism: Organism) -> float:
        """Return s that the center of every module passes once the whole of it is across [m]."""
        return self.far + organism.scout.pitch / 2


class _Crossing(NamedTuple):
    """A gap on one lane: the samples of its two jumps, and the heights of its floor and of the walls [m]."""

    fall: Jump
    rise: Jump
    floor: float


def find_gap(
    arena: Arena,
    organism: Organism | None = None,
    direction: Sequence[float] | np.ndarray | None = None,
    search: GapSearch | None = None,
    start: Sequence[float] | np.ndarray | None = None,
) -> Gap:
    """Find the first gap on the way across a surface.

    Nothing but the surface is looked at: not the course that an arena may know. Every lane of the way is searched by
    itself; the edges are lines through the lanes. The way is turned until it is perpendicular to them, unless its
    direction is given.
    """
    search = search or GapSearch()
    least = (organism or Organism(1)).scout.size[0] / 2

    def read(direction: Sequence[float] | np.ndarray | None) -> Profile:
        return read_profile(arena, direction, WaySearch(step=search.step), start)

    if direction is not None:
        return _find_skewed(arena, read(direction), least, search)[0]
    profile = read(None)
    try:
        gap, skew = _find_skewed(arena, profile, least, search)
    except TaskError as reason:
        c, n = profile.way.direction
        try:
            return _find_skewed(arena, read((-n, c)), least, search)[0]
        except TaskError:
            raise reason from None
    if abs(skew) < _STRAIGHT:
        return gap
    heading = profile.way.heading - np.arctan(skew)
    return _find_skewed(arena, read((np.cos(heading), np.sin(heading))), least, search)[0]


def _find_skewed(arena: Arena, profile: Profile, least: float, search: GapSearch) -> tuple[Gap, float]:
    """Return the gap on a way, and the skew of its edges."""
    lanes = find_lanes(profile)
    if len(lanes) < LEAST_LANES:
        raise TaskError(
            f"no gap across arena {arena.name!r}: its ground is alike on {profile.way.width:.2f} m of the width alone, "
            "as on rough or skewed ground; give another direction"
        )
    found = {int(k): _find_crossing(profile.s, profile.heights[:, k], least, search) for k in lanes}
    known = {k: crossing for k, crossing in found.items() if crossing is not None}
    if not known:
        raise TaskError(
            f"no gap on the way across arena {arena.name!r}: the ground nowhere drops by {search.depth} m and rises "
            f"again within {search.max_width} m"
        )
    floor = float(np.median([crossing.floor for crossing in known.values()]))
    top = float(np.median([profile.heights[crossing.fall.first, k] for k, crossing in known.items()]))
    places = _find_edges(profile, found, floor)
    near, far = (fit_edge(profile, side) for side in places)
    if near is None or far is None or min(near.share, far.share) < search.agreement:
        share = min(near.share if near else 0.0, far.share if far else 0.0)
        raise TaskError(
            f"no gap across the whole way of arena {arena.name!r}: {100 * share:.0f} % of its {len(lanes)} lanes show "
            f"one, fewer than {100 * search.agreement:.0f} %"
        )
    start = _find_start(profile, near, search)
    confidence = min(near.share, far.share) * _find_agreement(profile, places, (near, far))
    gap = Gap(profile.way, start, near.s, far.s, floor, top, round(float(confidence), 3))
    return gap, (near.skew + far.skew) / 2


def _find_crossing(
    s: Float[np.ndarray, " D"], heights: Float[np.ndarray, " D"], least: float, search: GapSearch
) -> _Crossing | None:
    """Return the first fall on a lane that a rise follows within the width of a gap."""
    jumps = find_jumps(heights, search.depth, search.wall_steps)
    for fall, rise in pairwise(jumps):
        width = s[rise.last] - s[fall.first]
        if fall.rise < 0 < rise.rise and least < width <= search.max_width:
            inside = heights[fall.last : max(rise.first, fall.last) + 1]
            return _Crossing(fall, rise, float(np.nanmedian(inside)))
    return None


def _find_edges(
    profile: Profile, found: dict[int, _Crossing | None], floor: float
) -> Float[np.ndarray, "2 W"]:
    """Return s of both edges on every lane, half way up the walls; nan without a gap."""
    lanes = np.array(list(found))
    spans, levels = np.full((2, len(lanes), 2), -1), np.zeros((2, len(lanes)))
    for row, (lane, crossing) in enumerate(found.items()):
        if crossing is None:
            continue
        rims = crossing.fall.first, crossing.rise.last
        for side, (jump, rim) in enumerate(zip((crossing.fall, crossing.rise), rims, strict=True)):
            spans[side, row] = jump.first, jump.last
            levels[side, row] = (profile.heights[rim, lane] + floor) / 2
    return np.array([find_crossings(profile, lanes, spans[side], levels[side]) for side in range(2)])


def _find_agreement(profile: Profile, places: Float[np.ndarray, "2 W"], edges: tuple[Edge, Edge]) -> float:
    """Return how well the lanes agree: 1 on one line, 0.5 where they scatter by 2 cm."""
    left = profile.left[profile.on_way]
    rest = [
        np.nanmedian(np.abs(side - edge.s - edge.skew * left))
        for side, edge in zip(places, edges, strict=True)
    ]
    return 1.0 / (1.0 + max(rest) / _SPREAD)


def _find_start(profile: Profile, near: Edge, search: GapSearch) -> float:
    """Return the foot of the last ramp before an edge [m]; without one, where the surface begins."""
    ramps = [ramp for ramp in find_ramps(profile, search.ramp) if ramp.rise > 0 and ramp.foot < near.s]
    return ramps[-1].foot if ramps else profile.way.begin
