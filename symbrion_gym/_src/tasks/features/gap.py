"""Gaps and ramps on a way: where the ground drops and rises again like walls, and where it rises or falls evenly."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.way import (
    AGREEMENT,
    LEAST_LANES,
    Direction,
    Jump,
    Profile,
    Way,
    find_edge,
    find_jumps,
    read_profile,
    split_runs,
)

_DEPTH = 0.08  # Smallest height of the walls of a gap [m]; what is lower is a step
_MAX_WIDTH = 1.5  # A wider gap is ground to drive on [m]; an organism of 8 modules is 1 m long
_STRAIGHT = float(np.tan(np.deg2rad(1.0)))  # A way whose edges are skewed by less is perpendicular to them
_SPREAD = 0.02  # Edges whose lanes scatter by this [m] halve the confidence


class Gap(NamedTuple):
    """A gap, with the way across it; s along that way [m]."""

    way: Way  # the way, perpendicular to the edges unless its direction was given
    start: float  # s of the foot of the ramp before the gap; without a ramp, where the surface begins [m]
    near: float  # s of the near edge, in the middle of the way [m]
    far: float  # s of the far edge [m]
    floor: float  # height of its floor [m]
    top: float  # height of the ground at the near edge [m]
    confidence: float  # from 0 to 1: share of the lanes that show both edges, times how well they agree

    def find_finish(self, organism: Organism) -> float:
        """Return s that the center of every module passes once the whole of it is across [m]."""
        return self.far + organism.scout.pitch / 2


class _Crossing(NamedTuple):
    """A gap on one lane."""

    fall: Jump
    rise: Jump
    floor: float  # height of its floor [m]


def find_gap(
    arena: Arena,
    organism: Organism | None = None,
    direction: Direction | None = None,
    start: Sequence[float] | np.ndarray | None = None,
) -> Gap:
    """Find the first gap on the way across a surface.

    Nothing but the surface is looked at: not the course that an arena may know. Every lane of the way is searched by
    itself; the edges are lines through the lanes. The way is turned until it is perpendicular to them, unless its
    direction is given.
    """
    least = (organism or Organism(1)).scout.size[0] / 2

    def find(direction: Direction | None) -> tuple[Gap, float]:
        return _find_skewed(read_profile(arena, direction, start), least)

    if direction is not None:
        return find(direction)[0]
    profile = read_profile(arena, None, start)
    try:
        gap, skew = _find_skewed(profile, least)
    except TaskError as reason:
        c, n = profile.way.direction
        try:
            return find((-n, c))[0]
        except TaskError:
            raise reason from None
    if abs(skew) < _STRAIGHT:
        return gap
    heading = profile.way.heading - np.arctan(skew)
    return find((np.cos(heading), np.sin(heading)))[0]


def _find_skewed(profile: Profile, least: float) -> tuple[Gap, float]:
    """Return the gap on a way, and the skew of its edges."""
    name, lanes, heights = profile.arena.name, profile.lanes, profile.heights
    if len(lanes) < LEAST_LANES:
        raise TaskError(
            f"no gap across arena {name!r}: its ground is alike on {profile.way.width:.2f} m of the width alone, as on "
            "rough or skewed ground; give another direction"
        )
    found = {k: _find_crossing(profile.s, heights[:, k], least) for k in lanes.tolist()}
    crossings = [crossing for crossing in found.values() if crossing is not None]
    if not crossings:
        raise TaskError(
            f"no gap on the way across arena {name!r}: the ground nowhere drops by {_DEPTH} m at an edge and rises "
            f"again at another within {_MAX_WIDTH} m; a hollow with gentle sides is none"
        )
    known = np.array([k for k, crossing in found.items() if crossing is not None])
    floor = float(np.median([crossing.floor for crossing in crossings]))
    rims = [
        heights[[crossing.fall.first for crossing in crossings], known],
        heights[[crossing.rise.last for crossing in crossings], known],
    ]
    jumps = [crossing.fall[:2] for crossing in crossings], [crossing.rise[:2] for crossing in crossings]
    near, far = (
        find_edge(profile, known, *wall)
        for wall in zip(jumps, [(rim + floor) / 2 for rim in rims], strict=True)
    )
    share = min(edge.share if edge else 0.0 for edge in (near, far))
    if near is None or far is None or share < AGREEMENT:
        raise TaskError(
            f"no gap across the whole way of arena {name!r}: {100 * share:.0f} % of its {len(lanes)} lanes show one, "
            f"fewer than {100 * AGREEMENT:.0f} %"
        )
    ramps = [ramp for ramp in find_ramps(profile) if ramp.rise > 0 and ramp.foot < near.s]
    start = ramps[-1].foot if ramps else profile.way.begin
    confidence = share / (1.0 + max(near.spread, far.spread) / _SPREAD)
    gap = Gap(
        profile.way, start, near.s, far.s, floor, float(np.median(rims[0])), round(float(confidence), 3)
    )
    return gap, (near.skew + far.skew) / 2


def _find_crossing(
    s: Float[np.ndarray, " D"], heights: Float[np.ndarray, " D"], least: float
) -> _Crossing | None:
    """Return the first fall on a lane that a rise follows within the width of a gap."""
    for fall, rise in pairwise(find_jumps(heights, _DEPTH)):
        width = s[rise.last] - s[fall.first]
        if fall.rise < 0 < rise.rise and least < width <= _MAX_WIDTH:
            inside = heights[fall.last : max(rise.first, fall.last) + 1]
            return _Crossing(fall, rise, float(np.nanmedian(inside)))
    return None


_MIN_SLOPE = float(np.deg2rad(4.0))  # Smallest slope of a ramp [rad]; what is flatter is level
_MAX_SLOPE = float(np.deg2rad(40.0))  # Largest slope of a ramp [rad]; what is steeper is a wall
_MIN_LENGTH = 0.3  # Shortest ramp in plan [m]
_MIN_RISE = 0.05  # Smallest height of a ramp [m]
_ROUGHNESS = 0.006  # Largest standard deviation of a ramp's ground from an even slope [m]
_WINDOW = 0.1  # The slope is that over such a stretch [m]; short ones take the noise of a scan for slopes


class Ramp(NamedTuple):
    """A ramp; s along the way [m]."""

    way: Way  # the way over it
    foot: float  # s where it begins [m]
    crest: float  # s where it ends [m]
    low: float  # height of the ground at the foot [m]
    high: float  # height of the ground at the crest [m]; lower than at the foot where it leads down

    @property
    def rise(self) -> float:
        """Height that it gains [m]; below 0 where it leads down."""
        return self.high - self.low

    @property
    def slope(self) -> float:
        """Angle from the level [rad], below 0 where it leads down."""
        return float(np.arctan2(self.rise, self.crest - self.foot))


def find_ramp(arena: Arena, direction: Direction | None = None) -> Ramp:
    """Find the first ramp that leads up on the way across a surface."""
    for ramp in find_ramps(read_profile(arena, direction)):
        if ramp.rise > 0:
            return ramp
    raise TaskError(f"no ramp that leads up on the way across arena {arena.name!r}")


def find_ramps(profile: Profile) -> list[Ramp]:
    """Return the ramps along a way, up and down, in order; their ends where the fitted slope meets the level beyond."""
    s, heights = profile.s, profile.middle
    step = float(s[1] - s[0])
    reach = max(1, round(_WINDOW / step / 2))
    slope = np.full(len(s), np.nan)
    slope[reach:-reach] = (heights[2 * reach :] - heights[: -2 * reach]) / (2 * reach * step)
    low, high = np.tan(_MIN_SLOPE), np.tan(_MAX_SLOPE)
    ramps = []
    for sign in (1.0, -1.0):
        with np.errstate(invalid="ignore"):
            runs = split_runs((sign * slope > low) & (sign * slope < high))
        ramps += [_fit_ramp(profile, int(run[0]), int(run[-1]), reach) for run in runs]
    return sorted(filter(None, ramps), key=lambda ramp: ramp.foot)


def _fit_ramp(profile: Profile, first: int, last: int, reach: int) -> Ramp | None:
    """Return the ramp of a run of slopes: its line is fitted inside, its ends are where it meets the level ground."""
    s, heights = profile.s, profile.middle
    inner = slice(first + reach, last - reach + 1)
    if last - first < 3 * reach:
        return None
    gain, offset = np.polyfit(s[inner], heights[inner], 1)
    if np.std(heights[inner] - gain * s[inner] - offset) > _ROUGHNESS:
        return None
    margin = 2 * reach * float(s[1] - s[0])

    def find_end(at: int, level: slice) -> float:
        is_known = level.start >= 0 and level.stop <= len(heights)
        end = (np.median(heights[level]) - offset) / gain if is_known else s[at]
        return float(np.clip(end, s[at] - margin, s[at] + margin))

    foot = find_end(first, slice(first - 2 * reach, first - reach + 1))
    crest = find_end(last, slice(last + reach, last + 2 * reach + 1))
    ramp = Ramp(profile.way, foot, crest, float(offset + gain * foot), float(offset + gain * crest))
    is_large = crest - foot >= _MIN_LENGTH and abs(ramp.rise) >= _MIN_RISE
    return ramp if is_large and _MIN_SLOPE <= abs(ramp.slope) <= _MAX_SLOPE else None
