"""From what docks broadcast to what each robot receives: geometry, range, cones, noise, collisions of messages.

The law of light and its constants are those of `Signals` (`SignalConfig`), so that both agree on how far docks reach.
The estimates of distance, bearing and departure are not made from its readings: the two units of a side do not tell a
dock that is far from one that is seen askew, so that no departure can be read from them, and how the real robots found
theirs is not known. The errors are fitted to how long their docking took instead. Unlike in `Signals`, a side counts as
one unit, only other robots shade, not the arena, and any two robots that ask at once disturb each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.percepts import Heard, Wired, Words
from symbrion_gym._src.swarm.behavior.steering import wrap
from symbrion_gym._src.swarm.docks import compute_dock_poses
from symbrion_gym._src.swarm.signals.infrared import (
    FALLOFF,
    LOBE,
    MESSAGE_THRESHOLD,
    RECEPTION,
    SIDE_SHARE,
    SignalConfig,
)
from symbrion_gym._src.swarm.world import SwarmState


@dataclass(frozen=True)
class HearingConfig:
    """How well broadcasts are received.

    `bias` and `bias_time` were fitted to half of the docking trials of real robots
    (`evolution._src.experiments.swarm.docking_trials`); the rest are estimates.
    """

    # of infrared units; a dock is heard where it is bright enough for messages
    light: SignalConfig = field(default_factory=SignalConfig)
    bearing_noise: float = 0.05  # standard deviation of the direction to a sender [rad]
    departure_noise: float = 0.10  # of the direction from the sender's dock [rad]
    # of slowly changing errors of both directions, as of light that the ground and bodies reflect [rad]
    bias: float = 0.17
    bias_time: float = 60.0  # in which these are forgotten [s]
    # of the distance, as a share of it: strength falls with the square of the distance
    distance_noise: float = 0.05
    loss: float = 0.05  # share of the broadcasts that are lost in a decision

    def __post_init__(self) -> None:
        check_positive(self, ("bias_time",), OptionError)
        names = ("bearing_noise", "departure_noise", "bias", "distance_noise", "loss")
        check_not_negative(self, names, OptionError)


class Geometry(NamedTuple):
    """Docks that robots can hear, one row for each that reaches a robot."""

    receiver: Int[np.ndarray, " L"]  # robot
    sender: Int[np.ndarray, " L"]  # robot
    side: Int[np.ndarray, " L"]  # dock of the sender, its place in `SIDES`
    distance: Float[np.ndarray, " L"]  # from the receiver's nearest dock to the sender's [m]
    bearing: Float[np.ndarray, " L"]  # in the frame of the receiver [rad]
    departure: Float[np.ndarray, " L"]  # from the axis of the sender's dock [rad]


_NEAREST = 0.01  # Smaller distances count as this one [m]
_BODY = 0.045
"""Half of the width that a body shades [m]: less than half of its edge, as light passes its round corners."""
_TALL = 0.08  # Bodies shade what passes less than this above or below their centers [m]
_SIDE_ANGLES = np.array([ScoutConfig().compute_dock(side)[2] for side in SIDES])


def find_geometry(state: SwarmState, speaks: Bool[np.ndarray, "N 4"], config: HearingConfig) -> Geometry:
    """Return which speaking docks reach which robots: bright enough, with no other robot between."""
    light = config.light
    farthest = (2.0 * light.gain / MESSAGE_THRESHOLD) ** (1.0 / FALLOFF)
    place, axis = compute_dock_poses(state)
    sender, side = np.nonzero(speaks)
    way = place[sender, side][None] - state.position[:, None]
    far = np.linalg.norm(way, axis=-1)
    is_near = far < farthest + np.linalg.norm(ScoutConfig().size)
    is_near &= np.arange(len(far))[:, None] != sender
    receiver, row = np.nonzero(is_near)
    sender, side, way, far = sender[row], side[row], way[is_near], far[is_near]
    ahead, left = state.rotation[receiver, :, 0], state.rotation[receiver, :, 1]
    bearing = np.arctan2((way * left).sum(axis=-1), (way * ahead).sum(axis=-1))
    off_sides = np.abs(wrap(bearing[:, None] - _SIDE_ANGLES))
    own = np.linalg.norm(place - state.position[:, None], axis=-1)
    distance = np.maximum(far - own[receiver, off_sides.argmin(axis=-1)], 0.0)
    out = axis[sender, side]
    departure = wrap(np.arctan2(-way[:, 1], -way[:, 0]) - np.arctan2(out[:, 1], out[:, 0]))
    kept = compute_brightness(distance, departure, off_sides.min(axis=-1), light) > MESSAGE_THRESHOLD
    found = Geometry(*(part[kept] for part in (receiver, sender, side, distance, bearing, departure)))
    shaded = _find_shaded(state.position, place, found.receiver, found.sender, found.side)
    return Geometry(*(part[~shaded] for part in found))


def compute_brightness(
    distance: Float[np.ndarray, "*S"],
    departure: Float[np.ndarray, "*S"],
    off_side: Float[np.ndarray, "*S"],
    light: SignalConfig,
) -> Float[np.ndarray, "*S"]:
    """Return what both units of a side read of a dock in plain sight [counts]."""
    sent = np.maximum(np.cos(departure), 0.0)
    lobe = ((1.0 - SIDE_SHARE) * sent**LOBE + SIDE_SHARE) * (sent > 0.0)
    near = np.maximum(distance, _NEAREST)
    return 2.0 * light.gain * lobe * np.maximum(np.cos(off_side), 0.0) ** RECEPTION * near**-FALLOFF


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
    """Return the nearest of some broadcasts that each robot receives."""
    count = len(speaks)
    chance, noise = rng.random(count), rng.standard_normal((3, count))
    rows = np.flatnonzero(speaks[geometry.sender, geometry.side])
    # Of several assignments to one receiver the last one stays: the nearest.
    rows = rows[np.argsort(-geometry.distance[rows], kind="stable")]
    best = np.full(count, -1)
    best[geometry.receiver[rows]] = rows
    is_heard = (best >= 0) & (chance >= config.loss)
    if collides:
        pairs = np.unique(np.stack([geometry.receiver[rows], geometry.sender[rows]]), axis=1)
        is_heard &= np.bincount(pairs[0], minlength=count) == 1
    heard = Heard.make_nothing(count)
    to, row = np.flatnonzero(is_heard), best[is_heard]
    sender, side = geometry.sender[row], geometry.side[row]
    found = {
        "distance": geometry.distance[row] * np.exp(config.distance_noise * noise[2, to]),
        "bearing": wrap(geometry.bearing[row] + bias[0, to] + config.bearing_noise * noise[0, to]),
        "departure": wrap(geometry.departure[row] + bias[1, to] + config.departure_noise * noise[1, to]),
        "sender_side": side,
        **{name: getattr(words, name)[sender, side] for name in _CONTENT},
    }
    changed = {}
    for name, values in found.items():
        changed[name] = getattr(heard, name).copy()
        changed[name][to] = values
    return heard._replace(is_heard=is_heard, **changed)


_CONTENT = ("role", "accepts", "leader", "asker", "size")


def read_wires(wire: Wired, links: tuple[Docking, ...]) -> Wired:
    """Return what each dock receives of what its neighbor said over the wire."""
    received = Wired(*(np.zeros_like(word) for word in wire))
    for link in links:
        for (one, side), (other, other_side) in (link.ends, link.ends[::-1]):
            for word, told in zip(received, wire, strict=True):
                word[one, SIDES.index(side)] = told[other, SIDES.index(other_side)]
    return received
