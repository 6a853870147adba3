"""The states of a robot of a swarm: how its tracks run in each, and when it goes over to the next.

Every function is for all robots at once, as if all were in that state; angles to the left are positive. All numbers are
estimates but `LOCATE_SPEED`, which was fitted to docking trials of real robots.
"""

from math import pi, radians
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.memory import NOBODY, PART, STAY, Heard, Memory, Mode, Percepts, Plan
from symbrion_gym._src.swarm.behavior.sensing import SIDE_ANGLES, wrap
from symbrion_gym._src.swarm.world import BACK, FRONT, LEFT, RIGHT

EXPLORE_SPEED = 0.08  # [m/s]; faster robots find each other sooner, and run farther into what they meet
TURN_GAIN = 1.5  # Rate of turning per angle to the place that is steered for [1/s]
TURN_SPEED = 0.05  # Largest difference of a track from the mean of both [m/s]
AVOID_DISTANCE = 0.10  # A reading below it is an obstacle [m]
LOCATE_SPEED = 0.035  # On the way to a beacon [m/s]
LOOKAHEAD = 0.6
"""Share of the distance to the beacon at which the place on its axis lies that is steered for: at 0 straight to the
beacon, at 1 first to its axis."""
ALIGN_DISTANCE = 0.10  # Where driving ends and aligning begins, from dock to dock [m]
ALIGN_ANGLE = radians(5)  # Bearing of the beacon at which the robot goes in [rad]
ALIGN_OFFSET = radians(20)  # From the beacon's axis; beyond it the robot does not go in but recovers [rad]
ALIGN_TIME = 6.0  # After this without success the robot recovers [s]
DOCK_SPEED = 0.025  # On the last stretch [m/s]
DOCK_TIME = 8.0  # After this without a latch the robot recovers [s]
LOCKING_TIME = 2.0  # That a dock takes to lock [s]
RECOVER_SPEED, RECOVER_TIME = 0.05, 4.0  # Of backing off [m/s], and for how long [s]
LOST_TIME = 8.0  # A beacon not heard for this long is lost [s]
ACCEPT_TIME = 60.0  # A recruiter waits for a robot that it has accepted for this long [s]
GUIDE_OFFSET = 0.35  # Distance at which a robot passes an organism on the way to the beacon [m]
PATIENCE = 600.0  # An organism that does not grow for this long dissolves [s]
PIT_DEPTHS = (0.12, 1.0)
"""Ground ahead that lies so much lower is a pit [m]: more than one Scout is high; without ground it is a rim."""
SLOPE = 0.12  # Pitch above which ground is a slope [rad]
ROOM = 0.15  # A seed drives so far back on level ground from the foot of a slope [m]
LONGEST_RETREAT = 1.5  # A robot that has driven back so far from a pit, or from a slope, explores again [m]
PARTING_TIME = 2.0  # Time between the undocking and the first robot that leaves, and from one to the next [s]
LEAVE_DISTANCE = 0.20  # A robot drives so far on after an organism has parted [m] ..
LEAVE_GAP = 0.06  # ... and so much farther for each that comes behind it [m].
LEAVE_TIME = 60.0  # And so long at most [s]
STALL_TIME = 12.0  # A robot that comes no nearer to its beacon for so long backs off, turning [s] ...
STALL_TURN = 0.4  # ... at this rate [rad/s].
KEEP_CLEAR = 1.2
"""A robot that waits for another to dock leaves the way to the beacon, up to this distance [m] .."""
WAY = 0.7  # ... and within this angle from its axis [rad].
APART = 0.45  # And it stays so far from the beacon on all sides [m]
IN_VAIN = 5.0  # A robot that asks for so long while nobody is accepted is not heard, and draws nearer [s] ..
HEARD_WELL = 0.40  # ... up to this distance [m].
CLOSE = 0.06  # A robot that leaves stops for what is nearer ahead than this [m]
BLOCKED = 0.04  # A robot does not back into what is nearer behind [m]
REACH = ScoutConfig().arm_reach
"""From the center of a robot to the dock with which it hears [m]: that of the front, with which it docks."""
HALF_GAUGE = 0.0458  # Half the distance of the tracks [m] (S: the authors' simulator)
SLIP = 1.54  # Ideal rate of turning over the real one of a lone Scout on the spot (docs/physics.md)
_FACING = pi / 3  # A robot drives ahead only if it faces its goal to within this angle [rad]
_BEHIND = 0.5  # A guided robot steers for a place so far behind the dock that guides it [m]
_STEEP = 0.08  # A robot on a slope steeper than this drives straight up or down it [rad]
_SLOPE_GAIN = 4.0
"""Rate of turning per roll on a slope [1/s]; roll is small where a robot drives along the gradient."""
_AWAY = 10.0  # Rate of turning away [rad/s]: as fast as `TURN_SPEED` allows

Next = Int[np.ndarray, " N"]  # The next mode of each robot, were it in the mode of the function
Tracks = Float[np.ndarray, "N 2"]  # Speeds of the left and the right track of every robot [m/s]
Point = tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]
"""Ahead and left, in the frames of the robots [m]."""
Values = Float[np.ndarray, " N"] | float


class Situation(NamedTuple):
    """All that a transition depends on."""

    percepts: Percepts  # what robots sense
    memory: Memory  # what they remember, their wires already read
    plan: Plan  # of the organism
    numbers: Int[np.ndarray, " N"]  # of the robots

    def remember(self, **values: object) -> "Situation":
        """Return the situation with another memory."""
        return self._replace(memory=self.memory._replace(**values))

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
    def wanted(self) -> Int[np.ndarray, "N 4"]:
        """Places that the plan wants at each dock of the robots; NOBODY without a role."""
        role = self.memory.role
        return np.where((role >= 0)[:, None], self.plan.wanted[np.maximum(role, 0)], NOBODY)

    @property
    def open_docks(self) -> Bool[np.ndarray, "N 4"]:
        """Docks that want a robot and hold none."""
        return (self.wanted >= 0) & ~self.percepts.docked

    @property
    def is_alone(self) -> Bool[np.ndarray, " N"]:
        """Whether nothing is docked."""
        return np.asarray(~self.percepts.docked.any(axis=-1))

    @property
    def sides(self) -> Float[np.ndarray, "N 4"]:
        """Nearest reading of each side [m]."""
        return self.percepts.proximity.reshape(-1, len(SIDES), 2).min(axis=-1)

    @property
    def meets(self) -> Bool[np.ndarray, " N"]:
        """Whether something is ahead that is not the dock that a robot heads for, or a drop."""
        beacon, near = self.percepts.beacon, self.sides[:, FRONT]
        heads = (self.memory.mode == Mode.LOCATE_BEACON) & beacon.is_heard
        is_near = (near < AVOID_DISTANCE) & (~heads | (near < beacon.distance - AVOID_DISTANCE / 2))
        return is_near | (self.percepts.drop > PIT_DEPTHS[0])

    def hears_other(
        self, leader: Int[np.ndarray, " N"], size: Int[np.ndarray, " N"] | int
    ) -> Bool[np.ndarray, " N"]:
        """Return where the call of another organism is heard that goes before this one.

        One that has more robots goes before one with fewer; of two alike, the one whose seed has the smaller number.
        """
        result = np.zeros(len(self.numbers), bool)
        for heard in (self.percepts.beacon, self.percepts.guide):
            is_other = heard.is_heard & (heard.leader >= 0) & (heard.leader != leader)
            result |= is_other & ((heard.size > size) | ((heard.size == size) & (heard.leader < leader)))
        return result


def drive(speed: Values, rate: Values) -> Tracks:
    """Return speeds of the tracks of robots that drive and turn at once [m/s]."""
    half = np.clip(np.asarray(rate) * HALF_GAUGE * SLIP, -TURN_SPEED, TURN_SPEED)
    return np.stack(np.broadcast_arrays(speed - half, speed + half), axis=-1)


def steer_to(point: Point, speed: float) -> Tracks:
    """Return track speeds towards places [m/s]."""
    angle = np.arctan2(point[1], point[0])
    share = np.where(np.abs(angle) < _FACING, np.cos(angle) ** 2, 0.0)
    return drive(speed * share, TURN_GAIN * angle)


def find_axis(heard: Heard) -> Float[np.ndarray, " N"]:
    """Return the directions in which the docks look that are heard, in the frames of the robots [rad]."""
    return wrap(heard.bearing + pi - heard.departure)


def find_approach_point(heard: Heard) -> Point:
    """Return a place on the axis of the dock that is heard."""
    distance, axis = np.maximum(heard.distance, 0.0) + REACH, find_axis(heard)
    along = LOOKAHEAD * distance
    ahead = distance * np.cos(heard.bearing) + along * np.cos(axis)
    return ahead, distance * np.sin(heard.bearing) + along * np.sin(axis)


def find_way_behind(heard: Heard) -> Point:
    """Return where to go from a call of an organism to get behind its last robot, beside its body."""
    heading = find_axis(heard) - SIDE_ANGLES[heard.sender_side]
    is_ahead = heard.sender_side == FRONT
    side = np.where(heard.sender_side == RIGHT, -1.0, 1.0)
    side = np.where(is_ahead, np.where(heard.departure < 0.0, -1.0, 1.0), side)
    aside = heading + side * pi / 2
    behind = np.where(is_ahead, 0.0, _BEHIND)
    lateral = np.where(is_ahead, 1.5, 1.0) * GUIDE_OFFSET
    ahead = heard.distance * np.cos(heard.bearing) + lateral * np.cos(aside) - behind * np.cos(heading)
    left = heard.distance * np.sin(heard.bearing) + lateral * np.sin(aside) - behind * np.sin(heading)
    return ahead, left


def follow_slope(here: Situation) -> Float[np.ndarray, " N"]:
    """Return the rate of turning that leads straight up or down a slope [rad/s]; 0 on level ground."""
    pitch = here.percepts.pitch
    return np.where(np.abs(pitch) > _STEEP, _SLOPE_GAIN * here.percepts.roll * np.sign(pitch), 0.0)


def back_off(here: Situation, speed: float, rate: Values) -> Tracks:
    """Drive back, wait for what is close behind."""
    is_blocked = (here.sides[:, BACK] <= BLOCKED) & ~here.percepts.docked[:, BACK]
    return drive(np.where(is_blocked, 0.0, -speed), rate)


def choose_turn(here: Situation, chance: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return which way to turn away from what is ahead: 1 to the left, -1 to the right."""
    room = here.sides[:, LEFT] - here.sides[:, RIGHT]
    # The first unit of a side is its left one.
    units = here.percepts.proximity[:, 2 * FRONT + 1] - here.percepts.proximity[:, 2 * FRONT]
    bias = np.where(np.abs(room) > 1e-3, room, -units)
    return np.where(np.abs(bias) > 1e-3, np.sign(bias), np.where(chance < 0.5, 1.0, -1.0))


def _choose(now: Mode, *cases: tuple[Any, Mode]) -> Next:
    """Return the mode of the first condition that holds, else the present one."""
    return np.select([condition for condition, _ in cases], [int(mode) for _, mode in cases], int(now))


def after_explore(here: Situation) -> Next:
    """Return WAIT where a beacon is heard, RETREAT at a pit where nobody recruits."""
    percepts = here.percepts
    sees_pit = (percepts.drop > PIT_DEPTHS[0]) & (percepts.drop < PIT_DEPTHS[1])
    knows_none = here.memory.silent > PATIENCE
    is_first = sees_pit & (np.abs(percepts.pitch) < SLOPE) & knows_none
    return _choose(Mode.EXPLORE, (percepts.beacon.is_heard, Mode.WAIT), (is_first, Mode.RETREAT))


def explore(here: Situation) -> Tracks:
    """Drive ahead, straight on slopes, behind an organism that calls; turn away from obstacles and drops."""
    memory, guide = here.memory, here.percepts.guide
    tracks = drive(EXPLORE_SPEED, follow_slope(here))
    is_guided = guide.is_heard & (memory.alone <= 0.0)
    tracks = np.where(is_guided[:, None], steer_to(find_way_behind(guide), EXPLORE_SPEED), tracks)
    return np.where((memory.avoiding > 0.0)[:, None], drive(0.0, memory.turn * _AWAY), tracks)


def after_retreat(here: Situation) -> Next:
    """Return RECRUIT where there is room behind, EXPLORE where another recruits or no slope comes."""
    driven = here.memory.mark - here.run
    is_there = here.memory.has_climbed & (driven > ROOM)
    fails = here.hears_other(here.numbers, 1) | (driven > LONGEST_RETREAT)
    return _choose(Mode.RETREAT, (is_there, Mode.RECRUIT), (fails, Mode.EXPLORE))


def retreat(here: Situation) -> Tracks:
    """Drive back, straight down slopes, and wait for what is behind."""
    tracks = back_off(here, EXPLORE_SPEED, follow_slope(here))
    return np.where(tracks.mean(axis=-1, keepdims=True) < 0.0, tracks, 0.0)


def after_recruit(here: Situation) -> Next:
    """Return IN_ORGANISM once all wanted robots are there; EXPLORE or UNDOCK where it gives up."""
    memory = here.memory
    gives_up = here.hears_other(here.numbers, 1) | (memory.growth > PATIENCE)
    return _choose(
        Mode.RECRUIT,
        (memory.goes > STAY, Mode.UNDOCK),
        (here.is_alone & (memory.role > 0) & (memory.since > 1.0), Mode.RECOVER),
        (here.is_alone & gives_up & (memory.role == 0), Mode.EXPLORE),
        (~here.open_docks.any(axis=-1), Mode.IN_ORGANISM),
    )


def after_wait(here: Situation) -> Next:
    """Return LOCATE_BEACON where the beacon accepts this robot, EXPLORE where it is lost."""
    is_lost = here.memory.unseen > LOST_TIME
    return _choose(Mode.WAIT, (here.is_accepted, Mode.LOCATE_BEACON), (is_lost, Mode.EXPLORE))


def wait(here: Situation) -> Tracks:
    """Face the beacon; leave the way to it for another that is accepted; draw nearer where asking has no success."""
    beacon = here.percepts.beacon
    is_taken = beacon.is_heard & (beacon.accepts != NOBODY)
    aside, point = _find_aside(beacon), find_approach_point(beacon)
    leaves = is_taken & (np.hypot(*aside) > 0.0)
    comes = ~is_taken & (here.memory.asking > IN_VAIN) & (beacon.distance > HEARD_WELL)
    goal = (np.where(leaves, aside[0], point[0]), np.where(leaves, aside[1], point[1]))
    tracks = steer_to(goal, LOCATE_SPEED)
    is_free = (here.sides[:, FRONT] > CLOSE) & (here.percepts.drop < PIT_DEPTHS[0])
    tracks = np.where(is_free[:, None], tracks, tracks - tracks.mean(axis=-1, keepdims=True))
    is_off = np.abs(beacon.bearing) > ALIGN_ANGLE
    facing = drive(0.0, np.where(is_off, TURN_GAIN * beacon.bearing, 0.0))
    return np.where((leaves | comes)[:, None], tracks, facing)


def _find_aside(beacon: Heard) -> Point:
    """Return directions out of the way to the beacon; 0 where one waits well."""
    across = find_axis(beacon) + np.where(beacon.departure < 0.0, -1.0, 1.0) * pi / 2
    is_in_way = (beacon.distance < KEEP_CLEAR) & (np.abs(beacon.departure) < WAY)
    is_close = beacon.distance < APART
    ahead = is_in_way * np.cos(across) - is_close * np.cos(beacon.bearing)
    return ahead, is_in_way * np.sin(across) - is_close * np.sin(beacon.bearing)


def after_locate_beacon(here: Situation) -> Next:
    """Return ALIGN near the dock, WAIT where another is accepted, RECOVER where it comes no nearer."""
    beacon, memory = here.percepts.beacon, here.memory
    return _choose(
        Mode.LOCATE_BEACON,
        (here.is_accepted & (beacon.distance < ALIGN_DISTANCE), Mode.ALIGN),
        (beacon.is_heard & (beacon.accepts != here.numbers), Mode.WAIT),
        (memory.stalled > STALL_TIME, Mode.RECOVER),
        ((memory.unseen > LOST_TIME) | (memory.since > ACCEPT_TIME), Mode.EXPLORE),
    )


def locate_beacon(here: Situation) -> Tracks:
    """Drive to the axis of the beacon, then along it; past what is in the way."""
    tracks = steer_to(find_approach_point(here.percepts.beacon), LOCATE_SPEED)
    tracks = np.where((here.memory.unseen <= LOST_TIME)[:, None], tracks, 0.0)
    tracks = np.where((here.memory.avoiding > 0.0)[:, None], LOCATE_SPEED, tracks)
    return np.where(here.meets[:, None], drive(0.0, here.memory.turn * _AWAY), tracks)


def after_align(here: Situation) -> Next:
    """Return DOCK where the robot faces the dock, RECOVER where it stands beside the axis."""
    beacon = here.percepts.beacon
    faces = here.is_accepted & (np.abs(beacon.bearing) < ALIGN_ANGLE)
    is_beside = here.is_accepted & (np.abs(beacon.departure) > ALIGN_OFFSET)
    fails = is_beside | (here.memory.since > ALIGN_TIME)
    return _choose(Mode.ALIGN, (fails, Mode.RECOVER), (faces, Mode.DOCK))


def align(here: Situation) -> Tracks:
    """Turn to the dock on the spot."""
    is_known = here.memory.unseen <= LOST_TIME
    return drive(0.0, np.where(is_known, TURN_GAIN * here.percepts.beacon.bearing, 0.0))


def after_dock(here: Situation) -> Next:
    """Return LOCK where the front dock holds, RECOVER where it does not in time."""
    is_late = here.memory.since > DOCK_TIME
    return _choose(Mode.DOCK, (here.percepts.docked[:, FRONT], Mode.LOCK), (is_late, Mode.RECOVER))


def dock(here: Situation) -> Tracks:
    """Drive slowly on, steering for the dock."""
    return DOCK_SPEED + align(here)


def after_lock(here: Situation) -> Next:
    """Return RECRUIT or IN_ORGANISM after the time of locking."""
    is_locked = here.memory.since > LOCKING_TIME
    return _choose(
        Mode.LOCK,
        (~here.percepts.docked[:, FRONT], Mode.RECOVER),
        (is_locked & here.open_docks.any(axis=-1), Mode.RECRUIT),
        (is_locked, Mode.IN_ORGANISM),
    )


def after_recover(here: Situation) -> Next:
    """Return LOCATE_BEACON after backing off, EXPLORE where the organism is not heard any more."""
    is_lost = here.memory.unseen > LOST_TIME + RECOVER_TIME
    is_done = here.memory.since > RECOVER_TIME
    return _choose(Mode.RECOVER, (is_done & is_lost, Mode.EXPLORE), (is_done, Mode.LOCATE_BEACON))


def recover(here: Situation) -> Tracks:
    """Back off; turn where the way to the beacon is obstructed."""
    is_stalled = here.memory.stalled > STALL_TIME
    return back_off(here, RECOVER_SPEED, np.where(is_stalled, STALL_TURN * here.memory.turn, 0.0))


def after_in_organism(here: Situation) -> Next:
    """Return UNDOCK where the organism is told to part, RECRUIT where a robot is missing again."""
    parts = (here.memory.goes > STAY) | here.is_alone
    return _choose(Mode.IN_ORGANISM, (parts, Mode.UNDOCK), (here.open_docks.any(axis=-1), Mode.RECRUIT))


def after_undock(here: Situation) -> Next:
    """Return LEAVE or EXPLORE once nothing holds: after a task or an attempt."""
    memory, has_task = here.memory, here.memory.goes == PART
    turn = PARTING_TIME * np.where(has_task, 1.0 + np.maximum(memory.role, 0), 1.0)
    goes = here.is_alone & (memory.since > turn)
    return _choose(Mode.UNDOCK, (goes & has_task, Mode.LEAVE), (goes, Mode.EXPLORE))


def after_leave(here: Situation) -> Next:
    """Return REST far enough away."""
    behind = here.plan.num_roles - 1 - np.maximum(here.memory.role, 0)
    is_far = here.run - here.memory.mark > LEAVE_DISTANCE + LEAVE_GAP * behind
    return _choose(Mode.LEAVE, (is_far | (here.memory.since > LEAVE_TIME), Mode.REST))


def leave(here: Situation) -> Tracks:
    """Drive on, stop for what is close ahead, turn away from drops."""
    is_close = here.sides[:, FRONT] < CLOSE
    tracks = np.where(is_close[:, None], 0.0, drive(EXPLORE_SPEED, follow_slope(here)))
    is_rim = here.percepts.drop > PIT_DEPTHS[0]
    return np.where(is_rim[:, None], drive(0.0, here.memory.turn * _AWAY), tracks)


def after_rest(here: Situation) -> Next:
    """Return REST."""
    return np.full(len(here.numbers), int(Mode.REST))


def stand(here: Situation) -> Tracks:
    """Stand still."""
    return np.zeros((len(here.numbers), 2))


STATES = {
    Mode.EXPLORE: (explore, after_explore),
    Mode.RETREAT: (retreat, after_retreat),
    Mode.RECRUIT: (stand, after_recruit),
    Mode.WAIT: (wait, after_wait),
    Mode.LOCATE_BEACON: (locate_beacon, after_locate_beacon),
    Mode.ALIGN: (align, after_align),
    Mode.DOCK: (dock, after_dock),
    Mode.LOCK: (stand, after_lock),
    Mode.RECOVER: (recover, after_recover),
    Mode.IN_ORGANISM: (stand, after_in_organism),
    Mode.UNDOCK: (stand, after_undock),
    Mode.LEAVE: (leave, after_leave),
    Mode.REST: (stand, after_rest),
}
"""What the tracks do in each state, and which state follows."""


def find_next(here: Situation) -> Next:
    """Return the next mode of every robot."""
    mode = here.memory.mode
    following = mode.copy()
    for each in np.unique(mode):
        following = np.where(mode == each, STATES[Mode(each)][1](here), following)
    return following


def find_tracks(here: Situation) -> Tracks:
    """Return the track speeds of all robots in their present modes."""
    mode, tracks = here.memory.mode, stand(here)
    for each in np.unique(mode):
        tracks = np.where((mode == each)[:, None], STATES[Mode(each)][0](here), tracks)
    return tracks
