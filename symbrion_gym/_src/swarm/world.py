"""What every level of physics of a swarm offers: commands in, state out."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.organism import Docking
    from symbrion_gym._src.robot.scout_constants import ScoutConfig

DECISION = 0.1  # Time between two decisions of a robot [s]: the rate at which the hardware logs its states


class SwarmCommands(NamedTuple):
    """What N robots are told for one decision; docks in the order of `SIDES`: front, back, left, right."""

    tracks: Float[np.ndarray, "N 2"]  # speeds of the left and right track [m/s]
    hinge: Float[np.ndarray, " N"]  # target angles of the hinges [rad]; positive lifts the arm
    latch: Bool[np.ndarray, "N 4"]  # whether each dock is told to latch; one that is told not to releases

    @classmethod
    def make_idle(cls, num_robots: int) -> SwarmCommands:
        """Return the commands of robots that stand still and hold no latch."""
        return cls(np.zeros((num_robots, 2)), np.zeros(num_robots), np.zeros((num_robots, 4), bool))


class SwarmState(NamedTuple):
    """The true state of N robots; robots read of it what their sensors give."""

    position: Float[np.ndarray, "N 3"]  # centers of the chassis in the arena [m]
    rotation: Float[np.ndarray, "N 3 3"]  # from the frames of the chassis (x ahead, z up) to the arena
    velocity: Float[np.ndarray, "N 3"]  # of the centers in the arena [m/s]
    spin: Float[np.ndarray, "N 3"]  # rates of rotation in the arena [rad/s]
    hinge: Float[np.ndarray, " N"]  # angles of the hinges [rad]
    # dockings that are latched, sorted by their first ends; `first` is the smaller index
    links: tuple[Docking, ...]
    load: Float[np.ndarray, "N 4"]  # force through each dock [N]; 0 where nothing is latched
    odometry: Float[np.ndarray, "N 2"]  # distance that each track has run since the reset, left and right [m]


class SwarmWorld(Protocol):
    """N robots in an arena at one level of physics."""

    arena: Arena  # where they are
    scout: ScoutConfig  # constants of the robots
    num_robots: int  # N
    time: float  # since the reset [s]
    state: SwarmState  # as it is now; a new object after every step

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, at x [m], y [m] and heading [rad]."""
        ...

    def step(self, commands: SwarmCommands) -> None:
        """Advance by one decision."""
        ...
