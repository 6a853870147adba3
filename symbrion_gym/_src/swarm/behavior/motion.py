"""How fast the tracks of a robot run in each behavior, for all robots at once."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.swarm.behavior.memory import REACH, Mode
from symbrion_gym._src.swarm.behavior.percepts import FRONT, NOBODY
from symbrion_gym._src.swarm.behavior.steering import (
    drive,
    find_approach_point,
    find_way_behind,
    follow_slope,
    read_sides,
    steer_to,
    wrap,
)
from symbrion_gym._src.swarm.behavior.transitions import (
    PIT_DEPTHS,
    STALL_TIME,
    Situation,
    find_obstacles,
    is_blocked_behind,
)

Tracks = Float[np.ndarray, "N 2"]  # Speeds of the left and the right track of every robot [m/s]
KEEP_CLEAR = 1.2
"""A robot that waits for another to dock leaves the way to the beacon, up to this distance [m] ..."""
WAY = 0.7  # ... and within this angle from its axis [rad].
APART = 0.45  # And it stays so far from the beacon on all sides [m]
IN_VAIN = 5.0  # A robot that asks for so long while nobody is accepted is not heard, and draws nearer [s] ..
HEARD_WELL = 0.40  # ... up to this distance [m].
STALL_TURN = 0.4  # Rate of turning of one that backs off as it came no nearer to its beacon [rad/s]
CLOSE = 0.06  # A robot that leaves stops for what is nearer ahead than this [m]


def explore(here: Situation) -> Tracks:
    """Drive ahead, straight on slopes, behind an organism that calls; turn away from obstacles and drops."""
    percepts, weights, memory = here.percepts, here.weights, here.memory
    tracks = drive(weights.explore_speed, follow_slope(percepts.pitch, percepts.roll), weights.turn_speed)
    way = find_way_behind(percepts.guide, weights.guide_offset)
    guided = steer_to(*way, weights.explore_speed, weights.turn_gain, weights.turn_speed)
    is_guided = percepts.guide.is_heard & (memory.alone <= 0.0)
    tracks = np.where(is_guided[:, None], guided, tracks)
    away = drive(np.zeros(len(memory.mode)), memory.turn * 10.0, weights.turn_speed)
    return np.where((memory.avoiding > 0.0)[:, None], away, tracks)


def retreat(here: Situation) -> Tracks:
    """Drive back, straight down slopes, and wait for what is behind."""
    percepts, weights = here.percepts, here.weights
    rate = follow_slope(percepts.pitch, percepts.roll)
    speed = np.where(is_blocked_behind(here), 0.0, -weights.explore_speed)
    return drive(speed, np.where(speed < 0.0, rate, 0.0), weights.turn_speed)


def wait(here: Situation) -> Tracks:
    """Face the beacon; leave the way to it for another that is accepted; draw nearer where asking has no success."""
    beacon, weights, memory = here.percepts.beacon, here.weights, here.memory
    is_taken = beacon.is_heard & (beacon.accepts != NOBODY)
    aside = _find_aside(here)
    leaves = is_taken & (np.hypot(*aside) > 0.0)
    comes = ~is_taken & (memory.asking > IN_VAIN) & (beacon.distance > HEARD_WELL)
    point = find_approach_point(beacon, weights.lookahead, REACH)
    goal = (np.where(leaves, aside[0], point[0]), np.where(leaves, aside[1], point[1]))
    tracks = steer_to(*goal, weights.locate_speed, weights.turn_gain, weights.turn_speed)
    tracks = np.where(_is_free_ahead(here)[:, None], tracks, tracks - tracks.mean(axis=-1, keepdims=True))
    is_off = np.abs(beacon.bearing) > weights.align_angle
    facing = drive(0.0, np.where(is_off, weights.turn_gain * beacon.bearing, 0.0), weights.turn_speed)
    return np.where((leaves | comes)[:, None], tracks, facing)


def _find_aside(here: Situation) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]:
    """Return directions out of the way to the beacon, in the frames of the robots; 0 where one waits well."""
    beacon = here.percepts.beacon
    axis = wrap(beacon.bearing + np.pi - beacon.departure)
    across = axis + np.where(beacon.departure < 0.0, -1.0, 1.0) * np.pi / 2
    is_in_way = (beacon.distance < KEEP_CLEAR) & (np.abs(beacon.departure) < WAY)
    is_close = beacon.distance < APART
    ahead = is_in_way * np.cos(across) - is_close * np.cos(beacon.bearing)
    return ahead, is_in_way * np.sin(across) - is_close * np.sin(beacon.bearing)


def _is_free_ahead(here: Situation) -> Bool[np.ndarray, " N"]:
    percepts = here.percepts
    return (read_sides(percepts.proximity)[:, FRONT] > CLOSE) & (percepts.drop < PIT_DEPTHS[0])


def locate_beacon(here: Situation) -> Tracks:
    """Drive to the axis of the beacon, then along it; past what is in the way."""
    beacon, weights = here.percepts.beacon, here.weights
    point = find_approach_point(beacon, weights.lookahead, REACH)
    tracks = steer_to(*point, weights.locate_speed, weights.turn_gain, weights.turn_speed)
    tracks = np.where(here.is_known[:, None], tracks, 0.0)
    past = drive(weights.locate_speed + 0.0 * beacon.distance, 0.0, weights.turn_speed)
    tracks = np.where((here.memory.avoiding > 0.0)[:, None], past, tracks)
    away = drive(0.0 * beacon.distance, here.memory.turn * 10.0, weights.turn_speed)
    return np.where(find_obstacles(here)[:, None], away, tracks)


def align(here: Situation) -> Tracks:
    """Turn to the dock on the spot."""
    beacon, weights = here.percepts.beacon, here.weights
    rate = np.where(here.is_known, weights.turn_gain * beacon.bearing, 0.0)
    return drive(0.0 * rate, rate, weights.turn_speed)


def dock(here: Situation) -> Tracks:
    """Drive slowly on, steering for the dock."""
    beacon, weights = here.percepts.beacon, here.weights
    rate = np.where(here.is_known, weights.turn_gain * beacon.bearing, 0.0)
    return drive(weights.dock_speed, rate, weights.turn_speed)


def recover(here: Situation) -> Tracks:
    """Back off; turn where the way to the beacon is obstructed."""
    weights, memory = here.weights, here.memory
    speed = np.where(is_blocked_behind(here), 0.0, -weights.recover_speed)
    rate = np.where(memory.stalled > STALL_TIME, STALL_TURN * memory.turn, 0.0)
    return drive(speed, rate, weights.turn_speed)


def leave(here: Situation) -> Tracks:
    """Drive on, stop for what is close ahead, turn away from drops."""
    percepts, weights = here.percepts, here.weights
    is_close = read_sides(percepts.proximity)[:, FRONT] < CLOSE
    speed = np.where(is_close, 0.0, weights.explore_speed)
    rate = np.where(is_close, 0.0, follow_slope(percepts.pitch, percepts.roll))
    tracks = drive(speed, rate, weights.turn_speed)
    away = drive(0.0 * speed, here.memory.turn * 10.0, weights.turn_speed)
    return np.where((percepts.drop > PIT_DEPTHS[0])[:, None], away, tracks)


def stand(here: Situation) -> Tracks:
    """Stand still."""
    return np.zeros((len(here.numbers), 2))


_MOTIONS = {
    Mode.EXPLORE: explore,
    Mode.RETREAT: retreat,
    Mode.WAIT: wait,
    Mode.LOCATE_BEACON: locate_beacon,
    Mode.ALIGN: align,
    Mode.DOCK: dock,
    Mode.RECOVER: recover,
    Mode.LEAVE: leave,
}


def find_tracks(here: Situation) -> Tracks:
    """Return the track speeds of all robots in their present modes."""
    tracks = np.zeros((len(here.numbers), 2))
    for mode in np.unique(here.memory.mode):
        moves = _MOTIONS.get(Mode(mode), stand)(here)
        tracks = np.where((here.memory.mode == mode)[:, None], moves, tracks)
    return tracks
