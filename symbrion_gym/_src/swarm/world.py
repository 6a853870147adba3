"""What every level of physics of a swarm offers: commands in, state out."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.organism import Docking
    from symbrion_gym._src.robot.scout_constants import ScoutConfig

DECISION = 0.1
"""Time between two decisions of a robot [s]: the rate at which the hardware logs its states."""


class SwarmCommands(NamedTuple):
    """What N robots are told for one decision; docks in the order of `SIDES`: front, back, left, right.

    Attributes:
        tracks: speeds of the left and right track [m/s].
        hinge: target angles of the hinges [rad]; positive lifts the arm.
        latch: whether each dock is told to latch; one that is told not to releases.
    """

    tracks: Float[np.ndarray, "N 2"]
    hinge: Float[np.ndarray, " N"]
    latch: Bool[np.ndarray, "N 4"]

    @classmethod
    def make_idle(cls, num_robots: int) -> SwarmCommands:
        """Return the commands of robots that stand still and hold no latch."""
        return cls(np.zeros((num_robots, 2)), np.zeros(num_robots), np.zeros((num_robots, 4), bool))


class SwarmState(NamedTuple):
    """The true state of N robots; robots read of it what their sensors give.

    Attributes:
        position: centers of the chassis in the arena [m].
        rotation: from the frames of the chassis (x ahead, z up) to the arena.
        velocity: of the centers in the arena [m/s].
        spin: rates of rotation in the arena [rad/s].
        hinge: angles of the hinges [rad].
        links: dockings that are latched, sorted by their first ends; `first` is the smaller index.
        load: force through each dock [N]; 0 where nothing is latched.
        odometry: distance that each track has run since the reset, left and right [m].
    """

    position: Float[np.ndarray, "N 3"]
    rotation: Float[np.ndarray, "N 3 3"]
    velocity: Float[np.ndarray, "N 3"]
    spin: Float[np.ndarray, "N 3"]
    hinge: Float[np.ndarray, " N"]
    links: tuple[Docking, ...]
    load: Float[np.ndarray, "N 4"]
    odometry: Float[np.ndarray, "N 2"]


class SwarmWorld(Protocol):
    """N robots in an arena at one level of physics.

    Attributes:
        arena: where they are.
        scout: constants of the robots.
        num_robots: N.
        time: since the reset [s].
        state: as it is now; a new object after every step.
    """

    arena: Arena
    scout: ScoutConfig
    num_robots: int
    time: float
    state: SwarmState

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, at x [m], y [m] and heading [rad]."""
        ...

    def step(self, commands: SwarmCommands) -> None:
        """Advance by one decision."""
        ...
