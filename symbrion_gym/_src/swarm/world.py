"""Commands and state of a swarm, the same at every level of physics."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES

DECISION = 0.1  # Time between two decisions of a robot [s]: the rate at which the hardware logs its states
FOLDED = np.pi / 2  # Angle of the hinge of an arm that is folded up, as nothing is docked to it [rad]
FRONT, BACK, LEFT, RIGHT = range(len(SIDES))


class SwarmCommands(NamedTuple):
    """What N robots are told for one decision; docks in the order of `SIDES`: front, back, left, right."""

    tracks: Float[np.ndarray, "N 2"]  # speeds of the left and right track [m/s]
    hinge: Float[np.ndarray, " N"]  # target angles of the hinges [rad]; positive lifts the arm
    latch: Bool[np.ndarray, "N 4"]  # whether each dock is told to latch; one that is told not to releases

    @classmethod
    def make_idle(cls, num_robots: int) -> "SwarmCommands":
        """Return the commands of robots that stand still and hold no latch."""
        return cls(np.zeros((num_robots, 2)), np.zeros(num_robots), np.zeros((num_robots, 4), bool))

    def check(self, num_robots: int) -> None:
        """Refuse commands of another shape, or that are not finite."""
        for name, shape in (
            ("tracks", (num_robots, 2)),
            ("hinge", (num_robots,)),
            ("latch", (num_robots, 4)),
        ):
            values = np.asarray(getattr(self, name))
            if values.shape != shape or not np.isfinite(values).all():
                raise OptionError(
                    f"commands.{name} must be finite, of shape {shape}; got shape {values.shape}"
                )


class SwarmState(NamedTuple):
    """The true state of N robots; robots read of it what their sensors give."""

    position: Float[np.ndarray, "N 3"]  # centers of the chassis in the arena [m]
    rotation: Float[np.ndarray, "N 3 3"]  # from the frames of the chassis (x ahead, z up) to the arena
    velocity: Float[np.ndarray, "N 3"]  # of the centers in the arena [m/s]
    hinge: Float[np.ndarray, " N"]  # angles of the hinges [rad]
    # dockings that are latched, sorted by their first ends; `first` is the smaller index
    links: tuple[Docking, ...]
    odometry: Float[np.ndarray, "N 2"]  # distance that each track has run since the reset, left and right [m]

    @property
    def docked(self) -> Bool[np.ndarray, "N 4"]:
        """Whether each dock holds another."""
        return find_docked(self.links, len(self.position))


def find_docked(links: tuple[Docking, ...], num_robots: int) -> Bool[np.ndarray, "N 4"]:
    """Return whether each dock holds another."""
    docked = np.zeros((num_robots, len(SIDES)), bool)
    for link in links:
        for robot, side in link.ends:
            docked[robot, SIDES.index(side)] = True
    return docked
