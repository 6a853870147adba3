"""Steps and stairs on a way: ground that rises like a wall and goes on higher."""

from typing import NamedTuple

import numpy as np

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.features.way import (
    AGREEMENT,
    STEP,
    Direction,
    Jump,
    Profile,
    Way,
    find_edge,
    find_jumps,
    read_profile,
)

_MIN_RISE = 0.025  # Smallest height of a step [m]; what is lower is the roughness of a scan
_TREAD = 0.1  # Shortest ground beyond a step [m]; what ends earlier is an obstacle
_NUM_STEPS = 2  # Fewest steps of stairs
_WIDEST_GAP = 1.5  # A rise this shortly after a fall is the far wall of a gap [m]
_ALIKE = 0.5  # Steps of one staircase differ in rise and run by no more than this share of their mean
_NEAR = 0.08
"""A lane shows a step where it jumps this close to that of the profile [m], and more where the step is skewed."""


class Step(NamedTuple):
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


class Stairs(NamedTuple):
    """Steps that follow each other."""

    way: Way  # the way over them
    steps: tuple[Step, ...]  # the steps, from below


def find_step(arena: Arena, organism: Organism | None = None, direction: Direction | None = None) -> Step:
    """Find the first step that leads up on the way across a surface."""
    steps = _find_steps(read_profile(arena, direction), organism)
    if steps:
        return steps[0]
    raise TaskError(
        f"no step on the way across arena {arena.name!r}: the ground nowhere rises by {_MIN_RISE} m like a wall on "
        f"{100 * AGREEMENT:.0f} % of the width and goes on for {_TREAD} m"
    )


def find_stairs(arena: Arena, organism: Organism | None = None, direction: Direction | None = None) -> Stairs:
    """Find the first stairs on the way across a surface: steps of about the same rise and run."""
    profile = read_profile(arena, direction)
    steps = _find_steps(profile, organism)
    flights: list[list[Step]] = []
    for step in steps:
        if flights and _fits(flights[-1], step):
            flights[-1].append(step)
        else:
            flights.append([step])
    for flight in flights:
        if len(flight) >= _NUM_STEPS:
            return Stairs(profile.way, tuple(flight))
    raise TaskError(
        f"no stairs on the way across arena {arena.name!r}: {len(steps)} steps on it, no {_NUM_STEPS} of them alike in "
        "a row"
    )


def _find_steps(profile: Profile, organism: Organism | None) -> list[Step]:
    """Return the steps that lead up along a way, in order; not those that a body drives over without noticing."""
    tread = round(_TREAD / STEP)
    jumps = find_jumps(profile.middle, _MIN_RISE)
    steps = []
    for number, jump in enumerate(jumps):
        if jump.rise < 0 or (number and _is_gap(profile, jumps[number - 1], jump)):
            continue
        beyond = profile.middle[jump.last : jump.last + tread]
        if len(beyond) < tread or np.ptp(beyond) > max(_MIN_RISE, jump.rise / 2):
            continue
        step = _fit_step(profile, jump)
        if step is not None and (organism is None or step.rise > organism.scout.track_radius):
            steps.append(step)
    return steps


def _is_gap(profile: Profile, before: Jump, rise: Jump) -> bool:
    """Return whether a rise is the far wall of a gap: a fall of at least half of it lies shortly before."""
    return before.rise < -rise.rise / 2 and profile.s[rise.first] - profile.s[before.last] < _WIDEST_GAP


def _fit_step(profile: Profile, jump: Jump) -> Step | None:
    low, high = float(profile.middle[jump.first]), float(profile.middle[jump.last])
    reach, lanes = round(_NEAR / STEP), profile.lanes
    span = max(jump.first - reach, 0), min(jump.last + reach, len(profile.s) - 1)
    edge = find_edge(profile, lanes, [span] * len(lanes), np.full(len(lanes), (low + high) / 2))
    if edge is None or edge.share < AGREEMENT:
        return None
    return Step(profile.way, edge.s, low, high, round(edge.share, 3))


def _fits(flight: list[Step], step: Step) -> bool:
    rise = float(np.mean([each.rise for each in flight]))
    if abs(step.rise - rise) > _ALIKE * rise or abs(step.low - flight[-1].high) > _ALIKE * rise:
        return False
    if len(flight) < 2:
        return True
    run = float(np.diff([each.edge for each in flight]).mean())
    return abs(step.edge - flight[-1].edge - run) <= _ALIKE * run
