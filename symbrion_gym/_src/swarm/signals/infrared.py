"""Which infrared units receive light of which docks, and how much."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.swarm.docks import compute_dock_poses

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.sight import Sight
    from symbrion_gym._src.swarm.world import SwarmState

NUM_UNITS = 8
"""Infrared units of a Scout: two a side, the left one (seen from within) first; sides in the order of `SIDES`."""
_LEAST_READING = 0.5  # Light below this reading is none [counts]: the standard deviation of the noise
_NARROW = 0.92  # Cosine of the angle off a dock's axis beyond which almost all light is that of its wide part
_LEAST_DISTANCE = 0.01  # Smaller distances count as this one [m]: units do not touch


class Light(NamedTuple):
    """Light that gets from docks to the two units of a side of other robots."""

    sender: Int[np.ndarray, " L"]  # robot
    dock: Int[np.ndarray, " L"]  # its side
    receiver: Int[np.ndarray, " L"]  # robot
    side: Int[np.ndarray, " L"]  # its side
    readings: Float[np.ndarray, "L 2"]  # of both units, not limited [counts]


def find_units(
    state: SwarmState, scout: ScoutConfig
) -> tuple[Float[np.ndarray, "N 8 3"], Float[np.ndarray, "N 8 3"]]:
    """Return places [m] and axes of the infrared units of all robots in the arena."""
    origins, directions = _find_unit_rays(scout)
    turn = state.rotation.transpose(0, 2, 1)
    return origins @ turn + state.position[:, None], directions @ turn


@lru_cache(maxsize=32)
def _find_unit_rays(scout: ScoutConfig) -> tuple[Float[np.ndarray, "8 3"], Float[np.ndarray, "8 3"]]:
    rays = find_scout_rays(scout)
    return rays.origins[:NUM_UNITS], rays.directions[:NUM_UNITS]


def compute_light(
    state: SwarmState,
    shining: Bool[np.ndarray, "N 4"],
    sight: Sight,
    scout: ScoutConfig,
    config: SignalConfig,
) -> Light:
    """Return the light of docks that reaches units of other robots, in a fixed order."""
    dock_place, dock_axis = compute_dock_poses(state, scout)
    unit_place, unit_axis = find_units(state, scout)
    sender, dock = np.nonzero(shining)
    start, start_axis = dock_place[sender, dock], dock_axis[sender, dock]
    pair, receiver = _find_pairs(state, sender, start, start_axis, sight.robot_radius, config)
    middle = (unit_place[:, ::2] + unit_place[:, 1::2]) / 2
    facing = ((start[pair][:, None] - middle[receiver]) * unit_axis[receiver, ::2]) @ np.ones(3) > 0.0
    row, side = np.nonzero(facing)
    pair, receiver = pair[row], receiver[row]
    units = 2 * side[:, None] + np.arange(2)
    readings = compute_readings(
        start[pair][:, None],
        start_axis[pair][:, None],
        unit_place[receiver[:, None], units],
        unit_axis[receiver[:, None], units],
        config,
    )
    seen = np.flatnonzero(np.maximum(readings[:, 0], readings[:, 1]) > _LEAST_READING)
    pair, receiver, side = pair[seen], receiver[seen], side[seen]
    clear = sight.find_clear(start, middle[receiver, side], pair, state, sender[pair], receiver)
    pair = pair[clear]
    return Light(sender[pair], dock[pair], receiver[clear], side[clear], readings[seen][clear])


def _find_pairs(
    state: SwarmState,
    sender: Int[np.ndarray, " S"],
    start: Float[np.ndarray, "S 3"],
    axis: Float[np.ndarray, "S 3"],
    radius: float,
    config: SignalConfig,
) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"]]:
    """Return which senders may reach which robots: near enough for that part of the light, and not behind the dock."""
    place = state.position
    ahead = axis @ place.T - (axis * start).sum(axis=1)[:, None]
    squared = (place**2).sum(axis=1) + (start**2).sum(axis=1)[:, None] - 2.0 * start @ place.T
    outside = (1.0 - SIDE_SHARE) * _NARROW**LOBE + SIDE_SHARE
    side_reach, reach = (_find_reach(config, lobe) + radius for lobe in (outside, 1.0))
    is_narrow = (ahead + radius) ** 2 > _NARROW**2 * np.maximum(
        np.sqrt(np.maximum(squared, 0.0)) - radius, 0.0
    ) ** 2
    is_near = (ahead > -radius) & (squared < np.where(is_narrow, reach, side_reach) ** 2)
    is_near[np.arange(len(sender)), sender] = False
    pair, receiver = np.nonzero(is_near)
    return pair, receiver


def _find_reach(config: SignalConfig, lobe: float) -> float:
    """Return how far a beacon shines with a share of its light [m]."""
    return (config.gain * lobe / _LEAST_READING) ** (1.0 / FALLOFF) if lobe > 0.0 else 0.0


def compute_readings(
    place: Float[np.ndarray, "*S 3"],
    axis: Float[np.ndarray, "*S 3"],
    unit_place: Float[np.ndarray, "*S 3"],
    unit_axis: Float[np.ndarray, "*S 3"],
    config: SignalConfig,
) -> Float[np.ndarray, " *S"]:
    """Return what units read of senders in plain sight, without limit, ambient light and noise [counts]."""
    way = unit_place - place
    ones = np.ones(3)
    distance = np.maximum(np.sqrt((way * way) @ ones), _LEAST_DISTANCE)
    sent = np.maximum((way * axis) @ ones / distance, 0.0)
    seen = np.maximum(-((way * unit_axis) @ ones) / distance, 0.0)
    lobe = ((1.0 - SIDE_SHARE) * sent**LOBE + SIDE_SHARE) * (sent > 0.0)
    return config.gain * lobe * seen**RECEPTION * distance**-FALLOFF


FALLOFF = 1.7  # Exponent of the distance [F]
LOBE = 66.0  # Exponent of the cosine of the angle off the beacon's axis, for its narrow part [F]
SIDE_SHARE = 0.18  # What the beacon sends to all sides before it, as a share of that along its axis [F]
RECEPTION = 4.0  # Exponent of the cosine of the angle off the axis of the receiving unit [E]
SATURATION = 275.0  # Largest reading [F: 275 is the largest there]
AMBIENT = 0.5  # Reading without a beacon [F]
MESSAGE_THRESHOLD = 1.5  # Weakest sum of both units of a side with which a message is read [counts] [E]
CAPTURE = 2.0
"""How many times as strong as all others together a message must be to be read; else they collide [E]."""


@dataclass(frozen=True)
class SignalConfig:
    """Constants of the infrared units. A reading is in counts of the robots' converters, ambient light taken off.

    [F] is a fit of ours to the 82 passes of a robot in front of a Scout's front beacon, 1 cm apart, in symbrion-morph
    (`data/data_set10`, `data_set11`), beyond 15 cm: reading = gain (share of the lobe) cos^4 (1 m / distance)^falloff.
    It leaves 1.1 counts of standard deviation at readings of 3 to 8, and 2.7 at 8 to 20. There both robots always
    looked along parallel lines, so that how the lobe divides into that of the sender and of the receiver is an
    estimate [E].

    Raises:
    """

    gain: float = 5.9  # reading of a unit at 1 m that looks at a beacon that looks at it [F]
    noise: float = 0.5  # standard deviation of a reading [F]
    # likewise, as a share of the reading [E]; 0.16-0.21 is left by the fit, which includes its error
    relative_noise: float = 0.05
    message_loss: float = 0.02  # probability that a message is lost on its way [E]

    def __post_init__(self) -> None:
        check_positive(self, ("gain",), OptionError)
        check_not_negative(self, ("noise", "relative_noise", "message_loss"), OptionError)
        if self.message_loss > 1.0:
            raise OptionError(f"SignalConfig.message_loss must be at most 1, got {self.message_loss!r}")
