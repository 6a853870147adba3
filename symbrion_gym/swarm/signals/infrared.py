"""Which infrared units receive light of which docks, and how much."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym.robot.scout_rays import find_scout_rays
from symbrion_gym.swarm.docks import find_dock_poses

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym.robot.scout_constants import ScoutConfig
    from symbrion_gym.swarm.sight import Sight
    from symbrion_gym.swarm.signals.config import SignalConfig
    from symbrion_gym.swarm.world import SwarmState

NUM_UNITS = 8
"""Infrared units of a Scout: two a side, the left one (seen from within) first; sides in the order of `SIDES`."""
_LEAST_READING = 0.05
"""Light below this reading is none [counts], far below the noise."""
_LEAST_DISTANCE = 0.01
"""Smaller distances count as this one [m]: units do not touch."""


class Light(NamedTuple):
    """Light that gets from docks to the two units of a side of other robots.

    Attributes:
        sender: robot.
        dock: its side.
        receiver: robot.
        side: its side.
        readings: of both units, not limited [counts].
    """

    sender: Int[np.ndarray, " L"]
    dock: Int[np.ndarray, " L"]
    receiver: Int[np.ndarray, " L"]
    side: Int[np.ndarray, " L"]
    readings: Float[np.ndarray, "L 2"]


def find_units(
    state: SwarmState, scout: ScoutConfig
) -> tuple[Float[np.ndarray, "N 8 3"], Float[np.ndarray, "N 8 3"]]:
    """Return places [m] and axes of the infrared units of all robots in the arena."""
    rays = find_scout_rays(scout)
    places = np.einsum("nij,uj->nui", state.rotation, rays.origins[:NUM_UNITS]) + state.position[:, None]
    return places, np.einsum("nij,uj->nui", state.rotation, rays.directions[:NUM_UNITS])


def find_light(
    state: SwarmState,
    shining: Bool[np.ndarray, "N 4"],
    sight: Sight,
    scout: ScoutConfig,
    config: SignalConfig,
) -> Light:
    """Return the light of docks that reaches units of other robots, in a fixed order.

    Args:
        state: of the robots.
        shining: which docks send.
        sight: what is in the way.
        scout: constants of the robots.
        config: constants of the light.
    """
    dock_place, dock_axis = find_dock_poses(state, scout)
    unit_place, unit_axis = find_units(state, scout)
    sender, dock = np.nonzero(shining)
    reach = (2.0 * config.gain / _LEAST_READING) ** (1.0 / config.falloff)
    way = state.position[None] - dock_place[sender, dock][:, None]
    is_ahead = np.einsum("snj,sj->sn", way, dock_axis[sender, dock]) > -sight.robot_radius
    is_ahead &= np.einsum("snj,snj->sn", way, way) < reach**2
    is_ahead[np.arange(len(sender)), sender] = False
    pair, receiver = np.nonzero(is_ahead)
    pair, receiver = np.repeat(pair, 4), np.repeat(receiver, 4)
    side = np.tile(np.arange(4), len(pair) // 4)
    axis = unit_axis[receiver, 2 * side]
    place = unit_place[receiver, 2 * side] + unit_place[receiver, 2 * side + 1]
    place /= 2
    is_facing = np.einsum("pj,pj->p", dock_place[sender, dock][pair] - place, axis) > 0.0
    pair, receiver, side, place = pair[is_facing], receiver[is_facing], side[is_facing], place[is_facing]
    units = 2 * side[:, None] + np.arange(2)
    readings = find_readings(
        dock_place[sender, dock][pair][:, None],
        dock_axis[sender, dock][pair][:, None],
        unit_place[receiver[:, None], units],
        unit_axis[receiver[:, None], units],
        config,
    )
    is_seen = readings.max(axis=1, initial=0.0) > _LEAST_READING
    pair, receiver, side, place = pair[is_seen], receiver[is_seen], side[is_seen], place[is_seen]
    clear = sight.is_clear(dock_place[sender, dock][pair], place, state, sender[pair], receiver)
    pair, receiver, side = pair[clear], receiver[clear], side[clear]
    return Light(sender[pair], dock[pair], receiver, side, readings[is_seen][clear])


def find_readings(
    place: Float[np.ndarray, "*S 3"],
    axis: Float[np.ndarray, "*S 3"],
    unit_place: Float[np.ndarray, "*S 3"],
    unit_axis: Float[np.ndarray, "*S 3"],
    config: SignalConfig,
) -> Float[np.ndarray, " *S"]:
    """Return what units read of senders in plain sight, without limit, ambient light and noise [counts].

    Args:
        place: of the senders [m].
        axis: unit vectors along which they send.
        unit_place: of the receiving units [m].
        unit_axis: unit vectors along which they look.
        config: constants of the light.
    """
    way = unit_place - place
    distance = np.maximum(np.linalg.norm(way, axis=-1), _LEAST_DISTANCE)
    sent = np.maximum((way * axis).sum(axis=-1) / distance, 0.0)
    seen = np.maximum(-(way * unit_axis).sum(axis=-1) / distance, 0.0)
    lobe = ((1.0 - config.side_share) * sent**config.lobe + config.side_share) * (sent > 0.0)
    return config.gain * lobe * seen**config.reception * distance**-config.falloff
