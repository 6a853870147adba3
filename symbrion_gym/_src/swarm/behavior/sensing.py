"""From a world to what its robots sense: what they measure, and what they hear of each other's broadcasts.

The law of light and its constants are those of `Signals`, so that both agree on how far docks reach. The estimates of
distance, bearing and departure are not made from its readings: the two units of a side do not tell a dock that is far
from one that is seen askew, so that no departure can be read from them, and how the real robots found theirs is not
known. The errors are fitted to how long their docking took instead. Unlike in `Signals`, a side counts as one unit,
and any two robots that ask at once disturb each other.
"""

from math import pi
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout import find_scout_rays
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.memory import Heard, Percepts, Wired, Words
from symbrion_gym._src.swarm.docks import compute_dock_frames
from symbrion_gym._src.swarm.senses import NUM_UNITS, Senses, SwarmWorld
from symbrion_gym._src.swarm.signals import (
    FALLOFF,
    GAIN,
    LEAST_DISTANCE,
    MESSAGE_THRESHOLD,
    RECEPTION,
    compute_lobe,
)
from symbrion_gym._src.swarm.world import DECISION, SwarmState

BEARING_NOISE = 0.05  # Standard deviation of the direction to a sender [rad] (estimate)
DEPARTURE_NOISE = 0.10  # Of the direction from the sender's dock [rad] (estimate)
BIAS = 0.17
"""Of slowly changing errors of both directions, as of light that the ground and bodies reflect [rad]; fitted, as
`BIAS_TIME`, to half of the docking trials of real robots (`benchmarks.docking`)."""
BIAS_TIME = 60.0  # In which these are forgotten [s]
DISTANCE_NOISE = 0.05
"""Of the distance, as a share of it (estimate): strength falls with the square of the distance."""
LOSS = 0.05  # Share of the broadcasts that are lost in a decision (estimate)
FARTHEST = 0.30
"""A beam looks for drops if it meets level ground nearer than this to the center of the robot [m]."""
SIDE_ANGLES = np.array([ScoutConfig().compute_dock(side)[2] for side in SIDES])
"""Directions of the docks in the frame of a robot [rad], in the order of `SIDES`."""
_FARTHEST_HEARD = (2.0 * GAIN / MESSAGE_THRESHOLD) ** (1.0 / FALLOFF) + np.linalg.norm(ScoutConfig().size)


def make_scout() -> ScoutConfig:
    """Return the Scouts of a swarm, which read only the steep beams of their lasers, at short range."""
    return ScoutConfig(laser_range=0.8, laser_beams=7, laser_angles=(-pi / 3, -pi / 6))


def wrap(angle: Float[np.ndarray, " *S"]) -> Float[np.ndarray, " *S"]:
    """Return angles within -pi to pi."""
    return (angle + pi) % (2 * pi) - pi


class Sensing:
    """The senses of all robots of a world; `noise` is a factor on all of their errors."""

    def __init__(self, world: SwarmWorld, noise: float = 1.0, seed: int = 0) -> None:
        self._world, self._noise = world, noise
        self._senses = Senses(world, noise, seed)
        self._rng = np.random.default_rng((seed, 7))
        self._run = np.zeros((world.num_robots, 2))
        self._bias = BIAS * self._rng.standard_normal((2, world.num_robots))

    def read(self, words: Words, wire: Wired) -> Percepts:
        """Return what the robots sense now."""
        world, rng, noise = self._world, self._rng, self._noise
        state, readings = world.state, self._senses.read()
        share = np.exp(-DECISION / BIAS_TIME)
        new = rng.standard_normal((2, world.num_robots))
        self._bias = share * self._bias + BIAS * np.sqrt(1.0 - share**2) * new
        asks = np.broadcast_to((words.asker >= 0)[:, None], words.is_beacon.shape)
        clear = world.sight.find_clear(state, _FARTHEST_HEARD + world.sight.robot_radius)
        links = find_links(state, words.is_beacon | words.is_guide | asks, clear)
        self._run = self._run + readings["odometry"]
        pitch, roll = readings["tilt"].T
        return Percepts(
            proximity=readings["proximity"],
            drop=compute_drop(readings["laser"], pitch, world.scout),
            pitch=pitch,
            roll=roll,
            odometry=self._run,
            docked=state.docked,
            beacon=hear(links, words, words.is_beacon, noise, self._bias, rng),
            guide=hear(links, words, words.is_guide, noise, self._bias, rng),
            asker=hear(links, words, asks, noise, self._bias, rng, collides=True),
            wired=read_wires(wire, state.links),
        )


def compute_drop(
    laser: Float[np.ndarray, "N B"], pitch: Float[np.ndarray, " N"], scout: ScoutConfig
) -> Float[np.ndarray, " N"]:
    """Return how far the ground ahead lies below that under a robot [m]; infinity where a beam meets none."""
    origins, directions, ranges = (part[NUM_UNITS:] for part in find_scout_rays(scout))
    ground = -scout.size[2] / 2
    down = np.minimum(directions[:, 2], -np.finfo(float).tiny)
    meets = origins[:, 0] + directions[:, 0] * (ground - origins[:, 2]) / down
    looks = (directions[:, 2] < 0.0) & (meets < FARTHEST)
    hit = origins[looks] + laser[:, looks, None] * directions[looks]
    height = hit[..., 0] * np.sin(pitch)[:, None] + hit[..., 2] * np.cos(pitch)[:, None]
    drop = (ground * np.cos(pitch))[:, None] - height
    drop = np.where(laser[:, looks] < ranges[looks], drop, np.inf)
    return np.maximum(drop.max(axis=-1), 0.0)


class Links(NamedTuple):
    """Docks that robots can hear, one row for each that reaches a robot."""

    receiver: Int[np.ndarray, " L"]  # robot
    sender: Int[np.ndarray, " L"]  # robot
    side: Int[np.ndarray, " L"]  # dock of the sender, its place in `SIDES`
    distance: Float[np.ndarray, " L"]  # from the receiver's nearest dock to the sender's [m]
    bearing: Float[np.ndarray, " L"]  # in the frame of the receiver [rad]
    departure: Float[np.ndarray, " L"]  # from the axis of the sender's dock [rad]


def find_links(state: SwarmState, speaks: Bool[np.ndarray, "N 4"], clear: Bool[np.ndarray, "N N"]) -> Links:
    """Return which speaking docks reach which robots: bright enough, and in sight of each other."""
    place, axis, _ = compute_dock_frames(state)
    sender, side = np.nonzero(speaks)
    way = place[sender, side][None] - state.position[:, None]
    far = np.linalg.norm(way, axis=-1)
    is_near = (far < _FARTHEST_HEARD) & clear[:, sender]
    receiver, row = np.nonzero(is_near)
    sender, side, way, far = sender[row], side[row], way[is_near], far[is_near]
    ahead, left = state.rotation[receiver, :, 0], state.rotation[receiver, :, 1]
    bearing = np.arctan2((way * left).sum(axis=-1), (way * ahead).sum(axis=-1))
    off_sides = np.abs(wrap(bearing[:, None] - SIDE_ANGLES))
    own = np.linalg.norm(place - state.position[:, None], axis=-1)
    distance = np.maximum(far - own[receiver, off_sides.argmin(axis=-1)], 0.0)
    out = axis[sender, side]
    departure = wrap(np.arctan2(-way[:, 1], -way[:, 0]) - np.arctan2(out[:, 1], out[:, 0]))
    kept = compute_brightness(distance, departure, off_sides.min(axis=-1)) > MESSAGE_THRESHOLD
    return Links(*(part[kept] for part in (receiver, sender, side, distance, bearing, departure)))


def compute_brightness(
    distance: Float[np.ndarray, "*S"], departure: Float[np.ndarray, "*S"], off_side: Float[np.ndarray, "*S"]
) -> Float[np.ndarray, "*S"]:
    """Return what both units of a side read of a dock in plain sight [counts]."""
    near, seen = np.maximum(distance, LEAST_DISTANCE), np.maximum(np.cos(off_side), 0.0)
    return 2.0 * GAIN * compute_lobe(np.maximum(np.cos(departure), 0.0)) * seen**RECEPTION * near**-FALLOFF


def hear(
    links: Links,
    words: Words,
    speaks: Bool[np.ndarray, "N 4"],
    noise: float,
    bias: Float[np.ndarray, "2 N"],
    rng: np.random.Generator,
    collides: bool = False,
) -> Heard:
    """Return the nearest of some broadcasts that each robot receives."""
    count = len(speaks)
    chance, errors = rng.random(count), noise * rng.standard_normal((3, count))
    rows = np.flatnonzero(speaks[links.sender, links.side])
    # Of several assignments to one receiver the last one stays: the nearest.
    rows = rows[np.argsort(-links.distance[rows], kind="stable")]
    best = np.full(count, -1)
    best[links.receiver[rows]] = rows
    is_heard = (best >= 0) & (chance >= noise * LOSS)
    if collides:
        pairs = np.unique(np.stack([links.receiver[rows], links.sender[rows]]), axis=1)
        is_heard &= np.bincount(pairs[0], minlength=count) == 1
    to, row = np.flatnonzero(is_heard), best[is_heard]
    sender, side = links.sender[row], links.side[row]
    bearing = links.bearing[row] + noise * bias[0, to] + BEARING_NOISE * errors[0, to]
    departure = links.departure[row] + noise * bias[1, to] + DEPARTURE_NOISE * errors[1, to]
    found = {
        "distance": links.distance[row] * np.exp(DISTANCE_NOISE * errors[2, to]),
        "bearing": wrap(bearing),
        "departure": wrap(departure),
        "sender_side": side,
        "role": words.role[sender, side],
        **{name: getattr(words, name)[sender] for name in ("accepts", "leader", "asker", "size")},
    }
    heard = Heard.make_nothing(count)
    for name, values in found.items():
        column = getattr(heard, name).copy()
        column[to] = values
        heard = heard._replace(**{name: column})
    return heard._replace(is_heard=is_heard)


def read_wires(told: Wired, links: tuple[Docking, ...]) -> Wired:
    """Return what each dock receives of what its neighbor said over the wire."""
    received = Wired(*(np.zeros((len(word), len(SIDES)), word.dtype) for word in told))
    for link in links:
        for (one, side), (other, _) in (link.ends, link.ends[::-1]):
            for word, said in zip(received, told, strict=True):
                word[one, SIDES.index(side)] = said[other]
    return received
