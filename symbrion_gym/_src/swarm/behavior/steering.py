"""Where robots steer, as pure functions over all robots at once; angles to the left are positive."""

from __future__ import annotations

from math import pi

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.percepts import BACK, FRONT, LEFT, RIGHT, Heard

SIDE_ANGLES = np.array([ScoutConfig().compute_dock(side)[2] for side in SIDES])
"""Directions of the docks in the frame of a robot [rad], in the order of `SIDES`."""
HALF_GAUGE = 0.0458  # Half the distance of the tracks [m] (S: the authors' simulator)
SLIP = 1.54  # Ideal rate of turning over the real one of a lone Scout on the spot (docs/physics.md)
_FACING = pi / 3  # A robot drives ahead only if it faces its goal to within this angle [rad]
_BEHIND = 0.5  # A guided robot steers for a place so far behind the dock that guides it [m]
_STEEP = 0.08  # A robot on a slope steeper than this drives straight up or down it [rad]
_SLOPE_GAIN = 4.0
"""Rate of turning per roll on a slope [1/s]; roll is small where a robot drives along the gradient."""


def wrap(angle: Float[np.ndarray, " *S"]) -> Float[np.ndarray, " *S"]:
    """Return angles within -pi to pi."""
    return (angle + pi) % (2 * pi) - pi


def drive(
    speed: Float[np.ndarray, " N"] | float, rate: Float[np.ndarray, " N"] | float, most: float
) -> Float[np.ndarray, "N 2"]:
    """Return speeds of the tracks of robots that drive and turn at once [m/s]."""
    half = np.clip(np.asarray(rate) * HALF_GAUGE * SLIP, -most, most)
    return np.stack(np.broadcast_arrays(speed - half, speed + half), axis=-1)


def steer_to(
    ahead: Float[np.ndarray, " N"], left: Float[np.ndarray, " N"], speed: float, gain: float, most: float
) -> Float[np.ndarray, "N 2"]:
    """Return track speeds towards places in the frames of the robots [m/s]."""
    angle = np.arctan2(left, ahead)
    share = np.where(np.abs(angle) < _FACING, np.cos(angle) ** 2, 0.0)
    return drive(speed * share, gain * angle, most)


def find_approach_point(
    heard: Heard, lookahead: float, reach: float
) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]:
    """Return a place on the axis of the dock that is heard, in the frames of the robots [m]."""
    distance = np.maximum(heard.distance, 0.0) + reach
    axis = wrap(heard.bearing + pi - heard.departure)
    along = lookahead * distance
    ahead = distance * np.cos(heard.bearing) + along * np.cos(axis)
    return ahead, distance * np.sin(heard.bearing) + along * np.sin(axis)


def find_way_behind(heard: Heard, offset: float) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]:
    """Return where to go from a call of an organism to get behind its last robot, beside its body [m]."""
    axis = wrap(heard.bearing + pi - heard.departure)
    heading = axis - SIDE_ANGLES[heard.sender_side]
    is_ahead = heard.sender_side == FRONT
    side = np.where(heard.sender_side == RIGHT, -1.0, 1.0)
    side = np.where(is_ahead, np.where(heard.departure < 0.0, -1.0, 1.0), side)
    aside = heading + side * pi / 2
    behind = np.where(is_ahead, 0.0, _BEHIND)
    lateral = np.where(is_ahead, 1.5, 1.0) * offset
    ahead = heard.distance * np.cos(heard.bearing) + lateral * np.cos(aside) - behind * np.cos(heading)
    left = heard.distance * np.sin(heard.bearing) + lateral * np.sin(aside) - behind * np.sin(heading)
    return ahead, left


def follow_slope(pitch: Float[np.ndarray, " N"], roll: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return the rate of turning that leads straight up or down a slope [rad/s]; 0 on level ground."""
    return np.where(np.abs(pitch) > _STEEP, _SLOPE_GAIN * roll * np.sign(pitch), 0.0)


def read_sides(proximity: Float[np.ndarray, "N 8"]) -> Float[np.ndarray, "N 4"]:
    """Return the nearest reading of each side [m]."""
    return proximity.reshape(len(proximity), len(SIDES), 2).min(axis=-1)


def choose_turn(
    proximity: Float[np.ndarray, "N 8"], chance: Float[np.ndarray, " N"]
) -> Float[np.ndarray, " N"]:
    """Return which way to turn away from what is ahead: 1 to the left, -1 to the right."""
    sides = read_sides(proximity)
    room = sides[:, LEFT] - sides[:, RIGHT]
    units = proximity[:, 2 * FRONT + 1] - proximity[:, 2 * FRONT]  # the first unit of a side is its left one
    bias = np.where(np.abs(room) > 1e-3, room, -units)
    return np.where(np.abs(bias) > 1e-3, np.sign(bias), np.where(chance < 0.5, 1.0, -1.0))


def is_free_behind(proximity: Float[np.ndarray, "N 8"], distance: float) -> Bool[np.ndarray, " N"]:
    """Return whether nothing is near behind."""
    return read_sides(proximity)[:, BACK] > distance
