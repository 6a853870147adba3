"""The exchange of beacons and messages between robots, once a decision."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.sight import Sight
from symbrion_gym._src.swarm.signals.infrared import (
    AMBIENT,
    CAPTURE,
    MESSAGE_THRESHOLD,
    NUM_UNITS,
    SATURATION,
    Light,
    SignalConfig,
    compute_light,
)

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym._src.robot.organism import Docking
    from symbrion_gym._src.swarm.world import SwarmWorld

NO_MESSAGE = -1  # Nothing sent or received


class Transmissions(NamedTuple):
    """What N robots send in one decision; docks in the order of `SIDES`. A latched dock sends no light."""

    beacon: Bool[np.ndarray, "N 4"]  # whether the beacon of each dock shines
    # what each dock sends by infrared, a number of at least 0; `NO_MESSAGE` for nothing
    message: Int[np.ndarray, "N 4"]
    wired: Int[np.ndarray, "N 4"]  # what each dock sends to the module that is docked to it; likewise

    @classmethod
    def make_silent(cls, num_robots: int) -> Transmissions:
        """Return what robots that send nothing send."""
        shape = (num_robots, len(SIDES))
        return cls(np.zeros(shape, bool), np.full(shape, NO_MESSAGE), np.full(shape, NO_MESSAGE))


class Receptions(NamedTuple):
    """What N robots receive in one decision."""

    # reading of each infrared unit, two a side, the left one (seen from within) first [counts]
    beacon: Float[np.ndarray, "N 8"]
    message: Int[np.ndarray, "N 4"]  # what each side received by infrared; `NO_MESSAGE` for nothing
    # whether messages at a side disturbed each other, so that none was read
    collided: Bool[np.ndarray, "N 4"]
    wired: Int[np.ndarray, "N 4"]  # what each dock received from the module docked to it


class Signals:
    """Carries beacons and messages between the robots of a world.

    Beacons and messages are of different frequencies and do not disturb each other; beacons add up. What is sent in a
    decision is received in it. Light needs a line of sight from the dock to the middle of the receiving side: neither
    the arena's exact surface nor a third robot may be between them. Wires lose nothing.

    Args:
        world: whose state is read at each exchange.
        config: constants; None for the defaults.
        seed: of noise and losses.
        sight: rays in the arena; None for those of the world if it has some, else new ones.
    """

    def __init__(
        self, world: SwarmWorld, config: SignalConfig | None = None, seed: int = 0, sight: Sight | None = None
    ) -> None:
        self._world, self.config = world, config or SignalConfig()
        self.sight = sight or getattr(world, "sight", None) or Sight(world.arena, world.scout)
        self.reset(seed)

    def reset(self, seed: int = 0) -> None:
        """Restart the noise."""
        self._rng = np.random.default_rng(seed)

    def exchange(self, sent: Transmissions) -> Receptions:
        """Return what robots receive of what they send, where they are now."""
        state, count = self._world.state, self._world.num_robots
        _check(sent, count)
        is_free = np.ones((count, len(SIDES)), bool)
        for link in state.links:
            for robot, side in link.ends:
                is_free[robot, SIDES.index(side)] = False
        shining, speaking = sent.beacon & is_free, (sent.message != NO_MESSAGE) & is_free
        light = compute_light(state, shining | speaking, self.sight, self._world.scout, self.config)
        beacon = self._read_beacons(_select(light, shining))
        message, collided = self._read_messages(_select(light, speaking), sent.message)
        return Receptions(beacon, message, collided, pass_on(sent.wired, state.links))

    def _read_beacons(self, light: Light) -> Float[np.ndarray, "N 8"]:
        config, count = self.config, self._world.num_robots
        total = np.zeros((count, NUM_UNITS // 2, 2))
        np.add.at(total, (light.receiver, light.side), light.readings)
        reading = total.reshape(count, NUM_UNITS) + AMBIENT
        spread = np.hypot(config.noise, config.relative_noise * reading)
        return np.clip(reading + spread * self._rng.standard_normal(reading.shape), 0.0, SATURATION)

    def _read_messages(
        self, light: Light, content: Int[np.ndarray, "N 4"]
    ) -> tuple[Int[np.ndarray, "N 4"], Bool[np.ndarray, "N 4"]]:
        config, shape = self.config, content.shape
        power = light.readings.sum(axis=1)
        total, best = np.zeros(shape), np.zeros(shape)
        np.add.at(total, (light.receiver, light.side), power)
        np.maximum.at(best, (light.receiver, light.side), power)
        is_best = power == best[light.receiver, light.side]
        message = np.full(shape, NO_MESSAGE)
        strongest = light.receiver[is_best], light.side[is_best]
        message[strongest] = content[light.sender[is_best], light.dock[is_best]]
        is_heard = best >= MESSAGE_THRESHOLD
        is_read = best >= CAPTURE * (total - best)
        is_lost = self._rng.random(shape) < config.message_loss
        return np.where(is_heard & is_read & ~is_lost, message, NO_MESSAGE), is_heard & ~is_read


def pass_on(sent: Int[np.ndarray, "N 4"], links: tuple[Docking, ...]) -> Int[np.ndarray, "N 4"]:
    """Return what each dock receives by wire: what the dock that it is latched to sends; else `NO_MESSAGE`."""
    received = np.full(np.shape(sent), NO_MESSAGE)
    for link in links:
        one, other = ((robot, SIDES.index(side)) for robot, side in link.ends)
        received[one], received[other] = sent[other], sent[one]
    return received


def _select(light: Light, chosen: Bool[np.ndarray, "N 4"]) -> Light:
    """Return the light of some docks."""
    kept = chosen[light.sender, light.dock]
    return Light(*(values[kept] for values in light))


def _check(sent: Transmissions, count: int) -> None:
    for name, values in sent._asdict().items():
        if np.shape(values) != (count, len(SIDES)):
            raise OptionError(
                f"Transmissions.{name} of {count} robots is [N, 4], got shape {np.shape(values)}"
            )
    for name in ("message", "wired"):
        least = int(np.min(getattr(sent, name), initial=0))
        if least < NO_MESSAGE:
            raise OptionError(
                f"Transmissions.{name} are numbers of at least 0, or {NO_MESSAGE} for none; got {least}"
            )
