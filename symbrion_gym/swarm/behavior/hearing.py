"""From what docks broadcast to what each robot receives: geometry, range, cones, noise, collisions of messages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction.range_checks import check_not_negative, check_positive
from symbrion_gym.errors import OptionError
from symbrion_gym.robot.organism import Docking
from symbrion_gym.robot.scout_constants import SIDES
from symbrion_gym.swarm.behavior.percepts import Heard, Wired, Words
from symbrion_gym.swarm.behavior.steering import wrap
from symbrion_gym.swarm.docks import find_dock_poses
from symbrion_gym.swarm.signals.config import SignalConfig
from symbrion_gym.swarm.world import SwarmState


@dataclass(frozen=True)
class HearingConfig:
    """How well broadcasts are received; all are estimates.

    Attributes:
        light: of infrared units; a dock is heard where it is bright enough for messages.
        bearing_noise: standard deviation of the direction to a sender [rad].
        departure_noise: of the direction from the sender's dock [rad].
        bias: of slowly changing errors of both directions, as of light that the ground and bodies reflect [rad].
        bias_time: in which these are forgotten [s].
        distance_noise: of the distance, as a share of it: strength falls with the square of the distance.
        loss: share of the broadcasts that are lost in a decision.
    """

    light: SignalConfig = field(default_factory=SignalConfig)
    bearing_noise: float = 0.05
    departure_noise: float = 0.10
    bias: float = 0.02
    bias_time: float = 15.0
    distance_noise: float = 0.05
    loss: float = 0.05

    def __post_init__(self) -> None:
        check_positive(self, ("bias_time",), OptionError)
        names = ("bearing_noise", "departure_noise", "bias", "distance_noise", "loss")
        check_not_negative(self, names, OptionError)


class Geometry(NamedTuple):
    """Where every sending dock stands as seen by every robot.

    Attributes:
        distance: from the receiver's nearest dock to the sender's [m].
        bearing: in the frame of the receiver [rad].
        departure: from the axis of the sender's dock [rad].
        reaches: whether the sender is heard: in range, in its cone, with no robot between.
    """

    distance: Float[np.ndarray, "N N 4"]
    bearing: Float[np.ndarray, "N N 4"]
    departure: Float[np.ndarray, "N N 4"]
    reaches: Bool[np.ndarray, "N N 4"]


_NEAREST = 0.01
"""Smaller distances count as this one [m]."""
_BODY = 0.045
"""Half of the width that a body shades [m]: less than half of its edge, as light passes its round corners."""
_TALL = 0.08
"""Bodies shade what passes less than this above or below their centers [m]."""


def find_geometry(state: SwarmState, config: HearingConfig) -> Geometry:
    """Return where all docks stand as seen by all robots."""
    place, axis = find_dock_poses(state)
    way = place[None] - state.position[:, None, None]
    ahead, left = state.rotation[:, :, 0], state.rotation[:, :, 1]
    bearing = np.arctan2(np.einsum("rjsk,rk->rjs", way, left), np.einsum("rjsk,rk->rjs", way, ahead))
    mine = np.linalg.norm(place - state.position[:, None], axis=-1)
    side_angle = np.array([0.0, np.pi, np.pi / 2, -np.pi / 2])
    nearest = np.abs(wrap(bearing[..., None] - side_angle)).argmin(axis=-1)
    far = np.linalg.norm(way, axis=-1)
    robots = np.arange(len(mine))
    distance = np.maximum(far - mine[robots[:, None, None], nearest], 0.0)
    flat = np.arctan2(-way[..., 1], -way[..., 0])
    departure = wrap(flat - np.arctan2(axis[..., 1], axis[..., 0])[None])
    off_side = np.abs(wrap(bearing[..., None] - side_angle)).min(axis=-1)
    reaches = find_brightness(distance, departure, off_side, config.light) > config.light.message_threshold
    reaches &= (robots[:, None] != robots)[..., None]
    reaches[reaches] = ~_find_shaded(state.position, place, *np.nonzero(reaches))
    return Geometry(distance, bearing, departure, reaches)


def find_brightness(
    distance: Float[np.ndarray, "*S"],
    departure: Float[np.ndarray, "*S"],
    off_side: Float[np.ndarray, "*S"],
    light: SignalConfig,
) -> Float[np.ndarray, "*S"]:
    """Return what both units of a side read of a dock in plain sight [counts].

    Args:
        distance: from side to dock [m].
        departure: angle off the axis of the dock [rad].
        off_side: angle off the axis of the receiving side [rad].
        light: constants.
    """
    sent = np.maximum(np.cos(departure), 0.0)
    lobe = ((1.0 - light.side_share) * sent**light.lobe + light.side_share) * (sent > 0.0)
    near = np.maximum(distance, _NEAREST)
    return (
        2.0 * light.gain * lobe * np.maximum(np.cos(off_side), 0.0) ** light.reception * near**-light.falloff
    )


def _find_shaded(
    position: Float[np.ndarray, "N 3"],
    place: Float[np.ndarray, "N 4 3"],
    receiver: Int[np.ndarray, " K"],
    sender: Int[np.ndarray, " K"],
    side: Int[np.ndarray, " K"],
) -> Bool[np.ndarray, " K"]:
    """Return where a third robot stands between a receiver and a dock."""
    way = place[sender, side] - position[receiver]
    length = np.maximum((way**2).sum(axis=-1), _NEAREST**2)
    to_third = position[None] - position[receiver][:, None]
    share = np.clip(np.einsum("kj,ktj->kt", way, to_third) / length[:, None], 0.0, 1.0)
    gap = to_third - share[..., None] * way[:, None]
    is_near = (np.hypot(gap[..., 0], gap[..., 1]) < _BODY) & (np.abs(gap[..., 2]) < _TALL)
    rows = np.arange(len(receiver))
    is_near[rows, receiver] = is_near[rows, sender] = False
    return is_near.any(axis=-1)


def hear(
    geometry: Geometry,
    words: Words,
    speaks: Bool[np.ndarray, "N 4"],
    config: HearingConfig,
    bias: Float[np.ndarray, "2 N"],
    rng: np.random.Generator,
    collides: bool = False,
) -> Heard:
    """Return the nearest of some broadcasts that each robot receives.

    Args:
        geometry: of the docks.
        words: what docks say.
        speaks: the docks that count.
        config: noise.
        bias: present slow errors of bearing and departure [rad].
        rng: draws noise and losses; four numbers a robot.
        collides: whether several at once destroy each other.
    """
    count = len(speaks)
    chance, noise = rng.random(count), rng.standard_normal((3, count))
    sent = geometry.reaches & speaks[None]
    distance = np.where(sent, geometry.distance, np.inf).reshape(count, -1)
    best = distance.argmin(axis=-1)
    rows = np.arange(count)
    is_heard = np.isfinite(distance[rows, best]) & (chance >= config.loss)
    if collides:
        is_heard &= sent.any(axis=-1).sum(axis=-1) == 1
    sender, side = best // len(SIDES), best % len(SIDES)
    far = np.where(is_heard, geometry.distance[rows, sender, side], 0.0)
    bearing = geometry.bearing[rows, sender, side] + bias[0] + config.bearing_noise * noise[0]
    departure = geometry.departure[rows, sender, side] + bias[1] + config.departure_noise * noise[1]
    return Heard(
        is_heard,
        far * np.exp(config.distance_noise * noise[2]),
        np.where(is_heard, wrap(bearing), 0.0),
        np.where(is_heard, wrap(departure), 0.0),
        side,
        *(getattr(words, name)[sender, side] for name in ("role", "accepts", "leader", "asker", "size")),
    )


def read_wires(wire: Wired, links: tuple[Docking, ...]) -> Wired:
    """Return what each dock receives of what its neighbor said over the wire."""
    received = Wired(*(np.zeros_like(word) for word in wire))
    for link in links:
        for (one, side), (other, other_side) in (link.ends, link.ends[::-1]):
            for word, told in zip(received, wire, strict=True):
                word[one, SIDES.index(side)] = told[other, SIDES.index(other_side)]
    return received
