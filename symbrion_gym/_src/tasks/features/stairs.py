"""Steps and stairs on a way: ground that rises like a wall and goes on higher."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_counts, check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.edges import Jump, find_crossings, find_jumps, find_lanes, fit_edge
from symbrion_gym._src.tasks.features.way import Profile, Way, WaySearch, read_profile

_ALIKE = 0.5  # Steps of one staircase differ in rise and run by no more than this share of their mean
_NEAR = 0.08
"""A lane shows a step where it jumps this close to that of the profile [m], and more where the step is skewed."""


@dataclass(frozen=True)
class StepSearch:
    """What counts as a step.

    Raises:
        OptionError: a number is out of range.
    """

    step: float = 0.01  # spacing of the heights along the way [m]
    wall_steps: int = 4  # a step is gained within this number of them, as scanned walls lean
    rise: float = 0.025  # smallest height [m]; what is lower is the roughness of a scan
    tread: float = 0.1  # shortest ground beyond a step [m]; what ends earlier is an obstacle
    # share of the lanes that have to show a step; where fewer do, an organism drives around it
    agreement: float = 0.6
    num_steps: int = 2  # fewest steps of stairs

    def __post_init__(self) -> None:
        check_positive(self, ("step", "rise", "tread", "agreement"), OptionError)
        check_counts(self, ("wall_steps", "num_steps"), OptionError)


@dataclass(frozen=True)
class Step:
    """A step that leads up; s along the way [m]."""

    way: Way  # the way over it
    edge: float  # s of its riser, in the middle of the way [m]
    low: float  # height of the ground before it [m]
    high: float  # height of the ground beyond it [m]
    confidence: float  # share of the lanes that show it

    @property
    def rise(self) -> float:
        """Height of the step [m]."""
        return self.high - self.low


@dataclass(frozen=True)
class Stairs:
    """Steps that follow each other."""

    way: Way  # the way over them
    steps: tuple[Step, ...]  # the steps, from below

    @property
    def rise(self) -> float:
        """Mean height of a step [m]."""
        return float(np.mean([step.rise for step in self.steps]))

    @property
    def run(self) -> float:
        """Mean depth of a step [m]."""
        return float(np.diff([step.edge for step in self.steps]).mean())

    @property
    def confidence(self) -> float:
        """Share of the lanes that show the least certain step."""
        return min(step.confidence for step in self.steps)


def find_step(
    arena: Arena,
    organism: Organism | None = None,
    direction: Sequence[float] | np.ndarray | None = None,
    search: StepSearch | None = None,
) -> Step:
    """Find the first step that leads up on the way across a surface."""
    search = search or StepSearch()
    steps = find_steps(read_profile(arena, direction, WaySearch(step=search.step)), search)
    least = _find_least(organism)
    for step in steps:
        if step.rise > least:
            return step
    raise TaskError(
        f"no step on the way across arena {arena.name!r}: the ground nowhere rises by {max(search.rise, least)} m like "
        f"a wall on {100 * search.agreement:.0f} % of the width and goes on for {search.tread} m"
    )


def find_stairs(
    arena: Arena,
    organism: Organism | None = None,
    direction: Sequence[float] | np.ndarray | None = None,
    search: StepSearch | None = None,
) -> Stairs:
    """Find the first stairs on the way across a surface: steps of about the same rise and run."""
    search = search or StepSearch()
    profile = read_profile(arena, direction, WaySearch(step=search.step))
    steps = [step for step in find_steps(profile, search) if step.rise > _find_least(organism)]
    for flight in _find_flights(steps):
        if len(flight) >= search.num_steps:
            return Stairs(profile.way, tuple(flight))
    raise TaskError(
        f"no stairs on the way across arena {arena.name!r}: {len(steps)} steps on it, no {search.num_steps} of them "
        "alike in a row"
    )


def find_steps(profile: Profile, search: StepSearch | None = None) -> list[Step]:
    """Return the steps that lead up along a way, in order."""
    search = search or StepSearch()
    tread = max(1, round(search.tread / search.step))
    jumps = find_jumps(profile.middle, search.rise, search.wall_steps)
    steps = []
    for number, jump in enumerate(jumps):
        if jump.rise < 0 or _is_in_gap(jumps, number, profile.s, search):
            continue
        beyond = profile.middle[jump.last : jump.last + tread]
        if len(beyond) < tread or np.ptp(beyond) > max(search.rise, jump.rise / 2):
            continue
        step = _fit_step(profile, jump, search)
        if step is not None:
            steps.append(step)
    return steps


def _find_least(organism: Organism | None) -> float:
    """Return the height of a step that an organism drives over without noticing [m]."""
    return 0.0 if organism is None else organism.scout.track_radius


def _is_in_gap(
    jumps: list[Jump], number: int, s: Float[np.ndarray, " D"], search: StepSearch, widest: float = 1.5
) -> bool:
    """Return whether a rise is the far wall of a gap: a fall of at least half of it lies shortly before."""
    if number == 0:
        return False
    before, rise = jumps[number - 1], jumps[number]
    return before.rise < -rise.rise / 2 and s[rise.first] - s[before.last] < widest


def _fit_step(profile: Profile, jump: Jump, search: StepSearch) -> Step | None:
    low, high = float(profile.middle[jump.first]), float(profile.middle[jump.last])
    reach = max(1, round(_NEAR / search.step))
    first, last = max(jump.first - reach, 0), min(jump.last + reach, len(profile.s) - 1)
    lanes = find_lanes(profile)
    spans = np.tile([first, last], (len(lanes), 1))
    edge = fit_edge(profile, find_crossings(profile, lanes, spans, np.full(len(lanes), (low + high) / 2)))
    if edge is None or edge.share < search.agreement:
        return None
    return Step(profile.way, edge.s, low, high, round(edge.share, 3))


def _find_flights(steps: list[Step]) -> list[list[Step]]:
    """Return the steps in groups of neighbors that are alike."""
    flights: list[list[Step]] = []
    for step in steps:
        if flights and _fits(flights[-1], step):
            flights[-1].append(step)
        else:
            flights.append([step])
    return flights


def _fits(flight: list[Step], step: Step) -> bool:
    rise = float(np.mean([each.rise for each in flight]))
    if abs(step.rise - rise) > _ALIKE * rise or abs(step.low - flight[-1].high) > _ALIKE * rise:
        return False
    if len(flight) < 2:
        return True
    run = float(np.diff([each.edge for each in flight]).mean())
    return abs(step.edge - flight[-1].edge - run) <= _ALIKE * run
