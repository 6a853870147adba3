"""What each robot senses and what each dock says: the only ways in and out of a behavior."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symbrion_gym._src.robot.scout_constants import SIDES

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

FRONT, BACK, LEFT, RIGHT = range(len(SIDES))
NOBODY = -1  # In place of the number of a robot, or of a place in the plan


class Words(NamedTuple):
    """What the docks of N robots broadcast over infrared, in the order of `SIDES`."""

    is_beacon: Bool[np.ndarray, "N 4"]  # whether a dock guides: it is free, and wants a robot there
    is_guide: Bool[np.ndarray, "N 4"]  # whether it calls robots to its organism, which wants them elsewhere
    role: Int[np.ndarray, "N 4"]  # place in the plan that the robot shall take; NOBODY where a dock is silent
    accepts: Int[np.ndarray, "N 4"]  # number of the robot that may come; NOBODY for any that asks
    leader: Int[np.ndarray, "N 4"]  # number of the seed of the organism; NOBODY of robots on their own
    asker: Int[np.ndarray, "N 4"]  # number of a robot that asks to be accepted; NOBODY where none does
    size: Int[np.ndarray, "N 4"]  # robots that the organism has

    @classmethod
    def make_silent(cls, num_robots: int) -> Words:
        """Return the words of robots that say nothing."""
        shape = (num_robots, len(SIDES))
        no, nobody = np.zeros(shape, bool), np.full(shape, NOBODY)
        return cls(no, no, nobody, nobody, nobody, nobody, np.zeros(shape, int))


class Heard(NamedTuple):
    """The nearest broadcast of one kind that each of N robots receives."""

    is_heard: Bool[np.ndarray, " N"]  # whether there is one
    # from the receiver's dock to the sender's, estimated from the strength [m]
    distance: Float[np.ndarray, " N"]
    bearing: Float[np.ndarray, " N"]  # direction to the sender in the frame of the receiver [rad]
    # direction from the sender's dock to the receiver, against the axis of that dock [rad]
    departure: Float[np.ndarray, " N"]
    sender_side: Int[np.ndarray, " N"]  # dock that sends, its place in `SIDES`
    role: Int[np.ndarray, " N"]  # likewise `accepts`, `leader`, `asker`, `size`, as in `Words`
    accepts: Int[np.ndarray, " N"]
    leader: Int[np.ndarray, " N"]
    asker: Int[np.ndarray, " N"]
    size: Int[np.ndarray, " N"]

    @classmethod
    def make_nothing(cls, num_robots: int) -> Heard:
        """Return what robots hear where all is silent."""
        no, nobody = np.zeros(num_robots, bool), np.full(num_robots, NOBODY)
        zero, whole = np.zeros(num_robots), np.zeros(num_robots, int)
        return cls(no, zero, zero, zero, whole, nobody, nobody, nobody, nobody, whole)


class Wired(NamedTuple):
    """What neighbors in an organism tell each other over the wire of a dock; all 0 where nothing is docked."""

    roles: Int[np.ndarray, "N 4"]  # bit k is set where a robot is known to have place k of the plan
    ticket: Int[np.ndarray, "N 4"]  # whom the organism accepts: its last word wins, as it counts up
    leader: Int[np.ndarray, "N 4"]  # number of the seed, plus 1
    goes: Int[np.ndarray, "N 4"]  # what the organism is told, of `memory`


class Percepts(NamedTuple):
    """What N robots sense at one decision."""

    # distances of the two infrared units of each side [m]; the range where nothing is near
    proximity: Float[np.ndarray, "N 8"]
    # how far the ground ahead lies below that under the robot [m]; infinity where there is none
    drop: Float[np.ndarray, " N"]
    pitch: Float[np.ndarray, " N"]  # nose up is positive [rad]
    roll: Float[np.ndarray, " N"]  # left side up is positive [rad]
    odometry: Float[np.ndarray, "N 2"]  # distance that each track has run [m]
    docked: Bool[np.ndarray, "N 4"]  # whether each dock holds another
    beacon: Heard  # the nearest dock that wants this robot or any
    guide: Heard  # the nearest call of an organism from another dock
    asker: Heard  # the nearest robot that asks this one
    wired: Wired  # words of the neighbors
