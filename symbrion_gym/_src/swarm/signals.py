"""What robots tell each other: beacons and messages of docks by infrared, and messages by wire within organisms.

Light: [F] is a fit of ours to the 82 passes of a robot in front of a Scout's front beacon, 1 cm apart, in
symbrion-morph (`data/data_set10`, `data_set11`), beyond 15 cm: reading = gain (share of the lobe) cos^4 (1 m /
distance)^falloff. It leaves 1.1 counts of standard deviation at readings of 3 to 8, and 2.7 at 8 to 20. There both
robots always looked along parallel lines, so that how the lobe divides into that of the sender and of the receiver is
an estimate [E]. Readings are in counts of the robots' converters, ambient light taken off.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.rows import dot_rows
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import compute_dock_frames
from symbrion_gym._src.swarm.senses import NUM_UNITS, Sight, SwarmWorld
from symbrion_gym._src.swarm.world import SwarmState

NO_MESSAGE = -1  # Nothing sent or received
GAIN = 5.9  # Reading of a unit at 1 m that looks at a beacon that looks at it [counts] [F]
FALLOFF = 1.7  # Exponent of the distance [F]
LOBE = 66.0  # Exponent of the cosine of the angle off the beacon's axis, for its narrow part [F]
SIDE_SHARE = 0.18  # What the beacon sends to all sides before it, as a share of that along its axis [F]
RECEPTION = 4.0  # Exponent of the cosine of the angle off the axis of the receiving unit [E]
SATURATION = 275.0  # Largest reading [F: 275 is the largest there]
AMBIENT = 0.5  # Reading without a beacon [F]
NOISE = 0.5  # Standard deviation of a reading [F]
RELATIVE_NOISE = 0.05
"""Likewise, as a share of the reading [E]; 0.16-0.21 is left by the fit, which includes its error."""
MESSAGE_LOSS = 0.02  # Probability that a message is lost on its way [E]
MESSAGE_THRESHOLD = 1.5  # Weakest sum of both units of a side with which a message is read [counts] [E]
CAPTURE = 2.0
"""How many times as strong as all others together a message must be to be read; else they collide [E]."""
LEAST_DISTANCE = 0.01  # Smaller distances count as this one [m]: units do not touch
_LEAST_READING = 0.5  # Light below this reading is none [counts]: the standard deviation of the noise
_find_rays = lru_cache(find_scout_rays)
_REACH = (GAIN / _LEAST_READING) ** (1.0 / FALLOFF)  # Of that light [m]


class Receptions(NamedTuple):
    """What N robots receive in one decision."""

    # reading of each infrared unit, two a side, the left one (seen from within) first [counts]
    beacon: Float[np.ndarray, "N 8"]
    message: Int[np.ndarray, "N 4"]  # what each side received by infrared; `NO_MESSAGE` for nothing
    wired: Int[np.ndarray, "N 4"]  # what each dock received from the module docked to it; likewise


class Light(NamedTuple):
    """Light that gets from docks to the two units of a side of other robots."""

    sender: Int[np.ndarray, " L"]  # robot
    dock: Int[np.ndarray, " L"]  # its side
    receiver: Int[np.ndarray, " L"]  # robot
    side: Int[np.ndarray, " L"]  # its side
    readings: Float[np.ndarray, "L 2"]  # of both units, not limited [counts]

    def of(self, chosen: Bool[np.ndarray, "N 4"]) -> "Light":
        """Return the light of some docks."""
        kept = chosen[self.sender, self.dock]
        return Light(*(values[kept] for values in self))


class Signals:
    """Carries beacons and messages between the robots of a world.

    Beacons and messages are of different frequencies and do not disturb each other; beacons add up. What is sent in a
    decision is received in it. Light needs a line of sight from the middle of one robot to that of the other: neither
    the arena's exact surface nor a third robot, a ball of half its width, may be between them. Wires lose nothing.
    `noise` is a factor on the errors of readings and on the losses.
    """

    def __init__(self, world: SwarmWorld, noise: float = 1.0, seed: int = 0) -> None:
        self._world, self._noise = world, noise
        self.reset(seed)

    def reset(self, seed: int = 0) -> None:
        """Restart the noise."""
        self._rng = np.random.default_rng(seed)

    def exchange(self, beacon: Bool[np.ndarray, "N 4"], message: Int[np.ndarray, "N 4"]) -> Receptions:
        """Return what robots receive now.

        The beacons of docks shine or do not; a message, `NO_MESSAGE` or a number from 0 on, goes by infrared or, where
        a dock is latched, by wire; a latched dock sends no light.
        """
        state, world = self._world.state, self._world
        shining, speaking = beacon & ~state.docked, (message != NO_MESSAGE) & ~state.docked
        light = compute_light(state, shining | speaking, world.sight, world.scout)
        readings = self._read_beacons(light.of(shining))
        heard = self._read_messages(light.of(speaking), message)
        return Receptions(readings, heard, pass_on(message, state.links))

    def _read_beacons(self, light: Light) -> Float[np.ndarray, "N 8"]:
        total = np.zeros((self._world.num_robots, len(SIDES), 2))
        np.add.at(total, (light.receiver, light.side), light.readings)
        reading = total.reshape(-1, NUM_UNITS) + AMBIENT
        spread = np.hypot(self._noise * NOISE, self._noise * RELATIVE_NOISE * reading)
        return np.clip(reading + spread * self._rng.standard_normal(reading.shape), 0.0, SATURATION)

    def _read_messages(self, light: Light, content: Int[np.ndarray, "N 4"]) -> Int[np.ndarray, "N 4"]:
        shape, power = content.shape, light.readings.sum(axis=1)
        total, best = np.zeros(shape), np.zeros(shape)
        np.add.at(total, (light.receiver, light.side), power)
        np.maximum.at(best, (light.receiver, light.side), power)
        is_best = power == best[light.receiver, light.side]
        message = np.full(shape, NO_MESSAGE)
        strongest = light.receiver[is_best], light.side[is_best]
        message[strongest] = content[light.sender[is_best], light.dock[is_best]]
        is_read = (best >= MESSAGE_THRESHOLD) & (best >= CAPTURE * (total - best))
        is_read &= self._rng.random(shape) >= self._noise * MESSAGE_LOSS
        return np.where(is_read, message, NO_MESSAGE)


def pass_on(sent: Int[np.ndarray, "N 4"], links: tuple[Docking, ...]) -> Int[np.ndarray, "N 4"]:
    """Return what each dock receives by wire: what the dock that it is latched to sends; else `NO_MESSAGE`."""
    received = np.full(np.shape(sent), NO_MESSAGE)
    for link in links:
        one, other = ((robot, SIDES.index(side)) for robot, side in link.ends)
        received[one], received[other] = sent[other], sent[one]
    return received


def compute_light(
    state: SwarmState, shining: Bool[np.ndarray, "N 4"], sight: Sight, scout: ScoutConfig
) -> Light:
    """Return the light of docks that reaches units of other robots, in a fixed order."""
    dock_place, dock_axis, _ = compute_dock_frames(state)
    unit_place, unit_axis = find_units(state, scout)
    sender, dock = np.nonzero(shining)
    start, start_axis = dock_place[sender, dock], dock_axis[sender, dock]
    clear = sight.find_clear(state, _REACH + 2 * sight.robot_radius)
    behind = dot_rows(start, start_axis) - sight.robot_radius
    is_ahead = dot_rows(start_axis[:, None], state.position) > behind[:, None]
    pair, receiver = np.nonzero(clear[sender] & is_ahead)
    side_axis = unit_axis[:, ::2]
    front = dot_rows(unit_place[:, ::2], side_axis).take(receiver, axis=0)
    place = start.take(pair, axis=0)[:, None]
    row, side = np.nonzero(dot_rows(place, side_axis.take(receiver, axis=0)) > front)
    pair, receiver = pair[row], receiver[row]
    lit = len(SIDES) * receiver + side
    readings = compute_readings(
        place.take(row, axis=0),
        start_axis.take(pair, axis=0)[:, None],
        unit_place.reshape(-1, 2, 3).take(lit, axis=0),
        unit_axis.reshape(-1, 2, 3).take(lit, axis=0),
    )
    seen = np.flatnonzero(np.maximum(readings[:, 0], readings[:, 1]) > _LEAST_READING)
    pair = pair[seen]
    return Light(sender[pair], dock[pair], receiver[seen], side[seen], readings[seen])


def find_units(
    state: SwarmState, scout: ScoutConfig
) -> tuple[Float[np.ndarray, "N 8 3"], Float[np.ndarray, "N 8 3"]]:
    """Return places [m] and axes of the infrared units of all robots in the arena."""
    origins, directions, _ = _find_rays(scout)
    turn = state.rotation.transpose(0, 2, 1)
    return origins[:NUM_UNITS] @ turn + state.position[:, None], directions[:NUM_UNITS] @ turn


def compute_lobe(cosine: Float[np.ndarray, "*S"] | float) -> Float[np.ndarray, "*S"]:
    """Return which share of its light along the axis a beacon sends at an angle off it; none behind it."""
    cosine = np.asarray(cosine)
    return np.asarray(((1.0 - SIDE_SHARE) * cosine**LOBE + SIDE_SHARE) * (cosine > 0.0))


def compute_readings(
    place: Float[np.ndarray, "*#S 3"],
    axis: Float[np.ndarray, "*#S 3"],
    unit_place: Float[np.ndarray, "*#S 3"],
    unit_axis: Float[np.ndarray, "*#S 3"],
) -> Float[np.ndarray, " *S"]:
    """Return what units read of senders in plain sight, without limit, ambient light and noise [counts]."""
    way = unit_place - place
    distance = np.maximum(np.sqrt(dot_rows(way, way)), LEAST_DISTANCE)
    sent = np.maximum(dot_rows(way, axis) / distance, 0.0)
    seen = np.maximum(-dot_rows(way, unit_axis) / distance, 0.0)
    return np.asarray(GAIN * compute_lobe(sent) * seen**RECEPTION * distance**-FALLOFF)
