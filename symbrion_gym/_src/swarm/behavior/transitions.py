"""When a robot goes over from one behavior to the next: one function a behavior, for all robots at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.swarm.behavior.memory import PART, STAY, Memory, Mode, Plan, read_ticket
from symbrion_gym._src.swarm.behavior.percepts import BACK, FRONT, NOBODY, Percepts
from symbrion_gym._src.swarm.behavior.steering import is_free_behind, read_sides
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights

PIT_DEPTHS = (0.12, 1.0)
"""Ground ahead that lies so much lower is a pit [m]: more than one Scout is high; without ground it is a rim."""
LEVEL, SLOPE = 0.06, 0.12
"""Pitch below which ground is level, and above which it is a slope [rad]: between ±3.4 and ±6.9 degrees."""
ROOM = 0.15  # A seed drives so far back on level ground from the foot of a slope [m]
LONGEST_RETREAT = 1.5  # A robot that has driven back so far from a pit, or from a slope, explores again [m]
LOCKING_TIME = 2.0  # Time that a dock takes to lock [s] (estimate)
PARTING_TIME = 2.0  # Time between the undocking and the first robot that leaves, and from one to the next [s]
LEAVE_DISTANCE = 0.20  # A robot drives so far on after an organism has parted [m] ..
LEAVE_GAP = 0.06  # ... and so much farther for each that comes behind it [m].
LEAVE_TIME = 60.0  # And so long at most [s]
STALL_TIME = 12.0  # A robot that comes no nearer to its beacon for so long backs off, turning [s]


class Situation(NamedTuple):
    """All that a transition depends on."""

    percepts: Percepts  # what robots sense
    memory: Memory  # what they remember, their wires already read
    plan: Plan  # of the organism
    weights: BehaviorWeights  # of the behaviors
    numbers: Int[np.ndarray, " N"]  # of the robots

    @property
    def run(self) -> Float[np.ndarray, " N"]:
        """Mean distance that the tracks have run [m]."""
        return self.percepts.odometry.mean(axis=-1)

    @property
    def is_accepted(self) -> Bool[np.ndarray, " N"]:
        """Whether a beacon is heard that wants this robot."""
        beacon = self.percepts.beacon
        return beacon.is_heard & (beacon.accepts == self.numbers)

    @property
    def is_known(self) -> Bool[np.ndarray, " N"]:
        """Whether a beacon was heard lately, so that the robot knows about where it is."""
        return self.memory.unseen <= self.weights.lost_time

    @property
    def wanted(self) -> Int[np.ndarray, "N 4"]:
        """Places that the plan wants at each dock of the robots; NOBODY without a role."""
        role = self.memory.role
        return np.where((role >= 0)[:, None], self.plan.wanted[np.maximum(role, 0)], NOBODY)

    @property
    def open_docks(self) -> Bool[np.ndarray, "N 4"]:
        """Docks that want a robot and hold none."""
        return (self.wanted >= 0) & ~self.percepts.docked


Next = Int[np.ndarray, " N"]  # The next mode of each robot, were it in the mode of the function


def _choose(now: Mode, *cases: tuple[Any, Mode]) -> Next:
    """Return the mode of the first condition that holds, else the present one."""
    return np.select([condition for condition, _ in cases], [int(mode) for _, mode in cases], int(now))


def explore(here: Situation) -> Next:
    """Return WAIT where a beacon is heard, RETREAT at a pit where nobody recruits."""
    percepts, memory = here.percepts, here.memory
    sees_pit = (percepts.drop > PIT_DEPTHS[0]) & (percepts.drop < PIT_DEPTHS[1])
    is_level = np.abs(percepts.pitch) < SLOPE
    knows_none = memory.silent > here.weights.patience
    return _choose(
        Mode.EXPLORE,
        (percepts.beacon.is_heard, Mode.WAIT),
        (sees_pit & is_level & knows_none, Mode.RETREAT),
    )


def retreat(here: Situation) -> Next:
    """Return RECRUIT where there is room behind, EXPLORE where another recruits or no slope comes."""
    driven = here.memory.mark - here.run
    is_there = here.memory.has_climbed & (driven > ROOM)
    fails = _hears_other(here) | (driven > LONGEST_RETREAT)
    return _choose(Mode.RETREAT, (is_there, Mode.RECRUIT), (fails, Mode.EXPLORE))


def recruit(here: Situation) -> Next:
    """Return IN_ORGANISM once all wanted robots are there; EXPLORE or UNDOCK where it gives up."""
    is_alone = ~here.percepts.docked.any(axis=-1)
    is_tired = here.memory.growth > here.weights.patience
    return _choose(
        Mode.RECRUIT,
        (here.memory.goes > STAY, Mode.UNDOCK),
        (is_alone & (here.memory.role > 0) & (here.memory.since > 1.0), Mode.RECOVER),
        (is_alone & (_hears_other(here) | is_tired) & (here.memory.role == 0), Mode.EXPLORE),
        (~here.open_docks.any(axis=-1), Mode.IN_ORGANISM),
    )


def wait(here: Situation) -> Next:
    """Return LOCATE_BEACON where the beacon accepts this robot, EXPLORE where it is lost."""
    return _choose(
        Mode.WAIT,
        (here.is_accepted, Mode.LOCATE_BEACON),
        (here.memory.unseen > here.weights.lost_time, Mode.EXPLORE),
    )


def locate_beacon(here: Situation) -> Next:
    """Return ALIGN near the dock, WAIT where another is accepted, RECOVER where it comes no nearer."""
    beacon, weights = here.percepts.beacon, here.weights
    is_near = here.is_accepted & (beacon.distance < weights.align_distance)
    other = beacon.is_heard & (beacon.accepts != here.numbers)
    return _choose(
        Mode.LOCATE_BEACON,
        (is_near, Mode.ALIGN),
        (other, Mode.WAIT),
        (here.memory.stalled > STALL_TIME, Mode.RECOVER),
        (here.memory.unseen > weights.lost_time, Mode.EXPLORE),
        (here.memory.since > weights.accept_time, Mode.EXPLORE),
    )


def align(here: Situation) -> Next:
    """Return DOCK where the robot faces the dock, RECOVER where it stands beside the axis."""
    beacon, weights = here.percepts.beacon, here.weights
    faces = here.is_accepted & (np.abs(beacon.bearing) < weights.align_angle)
    is_beside = here.is_accepted & (np.abs(beacon.departure) > weights.align_offset)
    return _choose(
        Mode.ALIGN,
        (is_beside | (here.memory.since > weights.align_time), Mode.RECOVER),
        (faces, Mode.DOCK),
    )


def dock(here: Situation) -> Next:
    """Return LOCK where the front dock holds, RECOVER where it does not in time."""
    return _choose(
        Mode.DOCK,
        (here.percepts.docked[:, FRONT], Mode.LOCK),
        (here.memory.since > here.weights.dock_time, Mode.RECOVER),
    )


def lock(here: Situation) -> Next:
    """Return RECRUIT or IN_ORGANISM after the time of locking."""
    is_locked = here.memory.since > LOCKING_TIME
    return _choose(
        Mode.LOCK,
        (~here.percepts.docked[:, FRONT], Mode.RECOVER),
        (is_locked & here.open_docks.any(axis=-1), Mode.RECRUIT),
        (is_locked, Mode.IN_ORGANISM),
    )


def recover(here: Situation) -> Next:
    """Return LOCATE_BEACON after backing off, EXPLORE where the organism is not heard any more."""
    is_lost = here.memory.unseen > here.weights.lost_time + here.weights.recover_time
    is_done = here.memory.since > here.weights.recover_time
    return _choose(Mode.RECOVER, (is_done & is_lost, Mode.EXPLORE), (is_done, Mode.LOCATE_BEACON))


def in_organism(here: Situation) -> Next:
    """Return UNDOCK where the organism is told to part, RECRUIT where a robot is missing again."""
    is_alone = ~here.percepts.docked.any(axis=-1)
    return _choose(
        Mode.IN_ORGANISM,
        ((here.memory.goes > STAY) | is_alone, Mode.UNDOCK),
        (here.open_docks.any(axis=-1), Mode.RECRUIT),
    )


def undock(here: Situation) -> Next:
    """Return LEAVE or EXPLORE once nothing holds: after a task or an attempt."""
    is_free = ~here.percepts.docked.any(axis=-1)
    turn = PARTING_TIME * (1.0 + np.maximum(here.memory.role, 0))
    return _choose(
        Mode.UNDOCK,
        (is_free & (here.memory.goes == PART) & (here.memory.since > turn), Mode.LEAVE),
        (is_free & (here.memory.goes != PART) & (here.memory.since > PARTING_TIME), Mode.EXPLORE),
    )


def leave(here: Situation) -> Next:
    """Return REST far enough away."""
    behind = here.plan.num_roles - 1 - np.maximum(here.memory.role, 0)
    is_far = here.run - here.memory.mark > LEAVE_DISTANCE + LEAVE_GAP * behind
    return _choose(Mode.LEAVE, (is_far | (here.memory.since > LEAVE_TIME), Mode.REST))


def rest(here: Situation) -> Next:
    """Return REST."""
    return np.full(len(here.numbers), int(Mode.REST))


TRANSITIONS = (
    explore, retreat, recruit, wait, locate_beacon, align, dock, lock, recover, in_organism, undock, leave, rest,
)  # fmt: skip
"""In the order of `Mode`."""


def find_next(here: Situation) -> Next:
    """Return the next mode of every robot."""
    following = here.memory.mode.copy()
    for mode in np.unique(here.memory.mode):
        following = np.where(here.memory.mode == mode, TRANSITIONS[mode](here), following)
    return following


def is_blocked_behind(here: Situation) -> Bool[np.ndarray, " N"]:
    """Return whether something is close behind."""
    return ~is_free_behind(here.percepts.proximity, 0.04) & ~here.percepts.docked[:, BACK]


def _hears_other(here: Situation) -> Bool[np.ndarray, " N"]:
    """Return where the call of another organism is heard that goes before this robot's own attempt.

    One that has robots goes before one without; of two seeds, the one with the smaller number.
    """
    result = np.zeros(len(here.numbers), bool)
    for heard in (here.percepts.beacon, here.percepts.guide):
        is_other = heard.is_heard & (heard.leader >= 0) & (heard.leader != here.numbers)
        result |= is_other & ((heard.size > 1) | (heard.leader < here.numbers))
    return result


def find_obstacles(here: Situation) -> Bool[np.ndarray, " N"]:
    """Return where something is ahead that is not the dock that a robot heads for, or a drop."""
    percepts, weights, mode = here.percepts, here.weights, here.memory.mode
    near = read_sides(percepts.proximity)[:, FRONT]
    to_dock = percepts.beacon.distance - weights.avoid_distance / 2
    heads = (mode == Mode.LOCATE_BEACON) & percepts.beacon.is_heard
    is_near = (near < weights.avoid_distance) & (~heads | (near < to_dock))
    return is_near | (percepts.drop > PIT_DEPTHS[0])


def count_robots(memory: Memory) -> Int[np.ndarray, " N"]:
    """Return how many robots each robot knows in its organism."""
    return np.bitwise_count(memory.roles.astype(np.uint64)).astype(int)


def hears_larger(here: Situation) -> Bool[np.ndarray, " N"]:
    """Return where an organism hears another that has more robots, or as many and the smaller number."""
    size, result = count_robots(here.memory), np.zeros(len(here.numbers), bool)
    for heard in (here.percepts.beacon, here.percepts.guide):
        is_other = heard.is_heard & (heard.leader >= 0) & (heard.leader != here.memory.leader)
        is_first = (heard.size == size) & (heard.leader < here.memory.leader)
        result |= is_other & ((heard.size > size) | is_first)
    return result


def find_accepted(here: Situation) -> Int[np.ndarray, " N"]:
    """Return whom the organism of each robot accepts."""
    return read_ticket(here.memory.ticket)[1]
