"""Ramps on a way: ground that rises or falls evenly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.way import Line, Profile, Way, read_profile
from symbrion_gym._src.traversability.footprint import Footprint


@dataclass(frozen=True)
class RampSearch:
    """What counts as a ramp.

    Raises:
        OptionError: a number is out of range.
    """

    min_slope: float = float(np.deg2rad(4.0))  # smallest slope [rad]; what is flatter is level
    max_slope: float = float(np.deg2rad(40.0))  # largest slope [rad]; what is steeper is a wall
    length: float = 0.3  # shortest ramp in plan [m]
    rise: float = 0.05  # smallest height of a ramp [m]
    roughness: float = 0.006  # largest standard deviation of its ground from an even slope [m]
    # the slope is that over such a stretch [m]; short ones take the noise of a scan for slopes
    window: float = 0.1

    def __post_init__(self) -> None:
        check_positive(self, [each.name for each in fields(self)], OptionError)
        if not self.min_slope < self.max_slope < np.pi / 2:
            raise OptionError(
                f"RampSearch: slopes must be min_slope < max_slope < pi/2, got {self.min_slope}, {self.max_slope}"
            )


@dataclass(frozen=True)
class Ramp:
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

    @property
    def foot_line(self) -> Line:
        """The line across the way at the foot."""
        return self.way.find_line(self.foot)


def find_ramp(
    arena: Arena,
    organism: Organism | None = None,
    direction: Sequence[float] | np.ndarray | None = None,
    search: RampSearch | None = None,
) -> Ramp:
    """Find the first ramp that leads up on the way across a surface."""
    ramps = [ramp for ramp in find_ramps(read_profile(arena, direction), search) if ramp.rise > 0]
    if not ramps:
        raise TaskError(f"no ramp that leads up on the way across arena {arena.name!r}")
    if organism is None:
        return ramps[0]
    limit = Footprint.of(organism, arena.friction).max_slope
    for ramp in ramps:
        if ramp.slope <= limit:
            return ramp
    raise TaskError(
        f"the ramp of arena {arena.name!r} has {np.degrees(ramps[0].slope):.0f} degrees; the organism climbs "
        f"{np.degrees(limit):.0f}; give more modules"
    )


def find_ramps(profile: Profile, search: RampSearch | None = None) -> list[Ramp]:
    """Return the ramps along a way, up and down, in order; their ends where the fitted slope meets the level beyond."""
    search = search or RampSearch()
    s, heights = profile.s, profile.middle
    step = float(s[1] - s[0])
    reach = max(1, round(search.window / step / 2))
    slope = np.full(len(s), np.nan)
    slope[reach:-reach] = (heights[2 * reach :] - heights[: -2 * reach]) / (2 * reach * step)
    low, high = np.tan(search.min_slope), np.tan(search.max_slope)
    ramps = []
    for sign in (1.0, -1.0):
        with np.errstate(invalid="ignore"):
            at = np.flatnonzero((sign * slope > low) & (sign * slope < high))
        for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if len(at) else []:
            ramp = _fit_ramp(profile, int(run[0]), int(run[-1]), reach, search.roughness)
            if ramp is not None and _is_ramp(ramp, sign, search):
                ramps.append(ramp)
    return sorted(ramps, key=lambda ramp: ramp.foot)


def _is_ramp(ramp: Ramp, sign: float, search: RampSearch) -> bool:
    angle = sign * ramp.slope
    return (
        ramp.crest - ramp.foot >= search.length
        and sign * ramp.rise >= search.rise
        and search.min_slope <= angle <= search.max_slope
    )


def _fit_ramp(profile: Profile, first: int, last: int, reach: int, roughness: float) -> Ramp | None:
    """Return the ramp of a run of slopes: its line is fitted inside, its ends are where it meets the level ground."""
    s, heights = profile.s, profile.middle
    inner = slice(first + reach, last - reach + 1)
    if last - first < 3 * reach:
        return None
    gain, offset = np.polyfit(s[inner], heights[inner], 1)
    if np.std(heights[inner] - gain * s[inner] - offset) > roughness:
        return None
    before = _compute_level(heights, first - 2 * reach, first - reach)
    after = _compute_level(heights, last + reach, last + 2 * reach)
    ends = [
        float((level - offset) / gain) if level is not None else float(s[fallback])
        for level, fallback in ((before, first), (after, last))
    ]
    margin = 2 * reach * float(s[1] - s[0])
    foot = float(np.clip(ends[0], s[first] - margin, s[first] + margin))
    crest = float(np.clip(ends[1], s[last] - margin, s[last] + margin))
    return Ramp(profile.way, foot, crest, float(offset + gain * foot), float(offset + gain * crest))


def _compute_level(heights: Float[np.ndarray, " D"], first: int, last: int) -> float | None:
    """Return the median height between two samples [m]; None beyond the profile."""
    if first < 0 or last >= len(heights):
        return None
    return float(np.median(heights[first : last + 1]))
