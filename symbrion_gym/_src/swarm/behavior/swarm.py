"""A swarm that behaves: world, senses and state machine stepped together, and what was seen of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.behavior.hearing import HearingConfig
from symbrion_gym._src.swarm.behavior.machine import Machine
from symbrion_gym._src.swarm.behavior.memory import Memory
from symbrion_gym._src.swarm.behavior.percepts import Wired, Words
from symbrion_gym._src.swarm.behavior.sensing import Sensing
from symbrion_gym._src.swarm.world import SwarmWorld


class Track(NamedTuple):
    """Where robots were and what they did, decision by decision.

    Attributes:
        time: since the beginning [s].
        position: of the robots [m].
        rotation: of their chassis.
        hinge: angles of their hinges [rad].
        mode: what they did, values of `Mode`.
        num_links: latched docks.
    """

    time: Float[np.ndarray, " T"]
    position: Float[np.ndarray, "T N 3"]
    rotation: Float[np.ndarray, "T N 3 3"]
    hinge: Float[np.ndarray, "T N"]
    mode: Int[np.ndarray, "T N"]
    num_links: Int[np.ndarray, " T"]

    @classmethod
    def join(cls, *tracks: Track) -> Track:
        """Return tracks one after the other."""
        return cls(*(np.concatenate(parts) for parts in zip(*tracks, strict=True)))


class Recorder:
    """Collects a `Track`."""

    def __init__(self) -> None:
        self._rows: list[tuple] = []

    def add(self, world: SwarmWorld, mode: Int[np.ndarray, " N"]) -> None:
        """Note where the robots of a world are now."""
        state = world.state
        row = (world.time, state.position, state.rotation, state.hinge, mode, len(state.links))
        self._rows.append(tuple(np.array(value) for value in row))

    def read(self) -> Track:
        """Return what was noted."""
        return Track(*(np.array(column) for column in zip(*self._rows, strict=True)))


class BehavingSwarm:
    """A world whose robots follow the behaviors.

    Args:
        world: already reset.
        machine: the behaviors.
        hearing: how well robots hear each other; None for the defaults.
        seed: of all noise and chance.
        memory: of the robots; None to begin with exploring.

    Attributes:
        world: as given.
        machine: as given.
        memory: of the robots now.
        recorder: what was seen.
    """

    def __init__(
        self,
        world: SwarmWorld,
        machine: Machine,
        hearing: HearingConfig | None = None,
        seed: int = 0,
        memory: Memory | None = None,
    ) -> None:
        self.world, self.machine = world, machine
        count = world.num_robots
        self.memory = memory or Memory.begin(count)
        self.recorder = Recorder()
        self._sensing = Sensing(world, hearing, seed)
        self._words = Words.make_silent(count)
        self._wire = Wired(*np.zeros((4, count, len(SIDES)), np.int64))
        self._rng = np.random.default_rng((seed, 11))

    def step(self) -> None:
        """Let all robots sense, decide and move once."""
        percepts = self._sensing.read(self._words, self._wire)
        decision = self.machine.decide(percepts, self.memory, self._rng)
        self.memory, self._words, self._wire = decision.memory, decision.words, decision.wire
        self.world.step(decision.commands)
        self.recorder.add(self.world, self.memory.mode)
