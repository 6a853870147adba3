"""What robots of a swarm sense, say and remember, and the plan that they follow: all data of the behaviors."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.world import FRONT

NOBODY = -1  # In place of the number of a robot, or of a place in the plan
MOST_ROLES = 60  # Places of a plan: robots keep a bit for each
STAY, PART, DISSOLVE = range(3)
"""What an organism is told: nothing, to part after its task, to part as the attempt has failed."""
_TICKET = 4096  # More than there are robots in a swarm


class Words(NamedTuple):
    """What N robots broadcast over infrared, by the dock where that differs, in the order of `SIDES`."""

    is_beacon: Bool[np.ndarray, "N 4"]  # whether a dock guides: it is free, and wants a robot there
    is_guide: Bool[np.ndarray, "N 4"]  # whether it calls robots to its organism, which wants them elsewhere
    role: Int[np.ndarray, "N 4"]  # place in the plan that the robot shall take; NOBODY where a dock is silent
    accepts: Int[np.ndarray, " N"]  # number of the robot that may come; NOBODY for any that asks
    leader: Int[np.ndarray, " N"]  # number of the seed of the organism; NOBODY of robots on their own
    asker: Int[np.ndarray, " N"]  # number of a robot that asks to be accepted; NOBODY where it does not
    size: Int[np.ndarray, " N"]  # robots that the organism has

    @classmethod
    def make_silent(cls, num_robots: int) -> "Words":
        """Return the words of robots that say nothing."""
        no, nobody = np.zeros((num_robots, len(SIDES)), bool), np.full(num_robots, NOBODY)
        role = np.full((num_robots, len(SIDES)), NOBODY)
        return cls(no, no, role, nobody, nobody, nobody, np.zeros(num_robots, int))


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
    def make_nothing(cls, num_robots: int) -> "Heard":
        """Return what robots hear where all is silent."""
        no, nobody = np.zeros(num_robots, bool), np.full(num_robots, NOBODY)
        zero, whole = np.zeros(num_robots), np.zeros(num_robots, int)
        return cls(no, zero, zero, zero, whole, nobody, nobody, nobody, nobody, whole)


class Wired(NamedTuple):
    """What robots tell their neighbors in an organism, `[N]`, or hear at each dock, `[N, 4]`: 0 where it is free."""

    roles: Int[np.ndarray, " *S"]  # bit k is set where a robot is known to have place k of the plan
    ticket: Int[np.ndarray, " *S"]  # whom the organism accepts: its last word wins, as it counts up
    leader: Int[np.ndarray, " *S"]  # number of the seed, plus 1
    goes: Int[np.ndarray, " *S"]  # what the organism is told: `STAY`, `PART` or `DISSOLVE`


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


class Mode(IntEnum):
    """What a robot does; the names of the authors' states where these exist."""

    EXPLORE = 0
    RETREAT = 1
    RECRUIT = 2
    WAIT = 3
    LOCATE_BEACON = 4
    ALIGN = 5
    DOCK = 6
    LOCK = 7
    RECOVER = 8
    IN_ORGANISM = 9
    UNDOCK = 10
    LEAVE = 11
    REST = 12


class Memory(NamedTuple):
    """The memory of N robots."""

    mode: Int[np.ndarray, " N"]  # values of `Mode`
    since: Float[np.ndarray, " N"]  # time in the mode [s]
    role: Int[np.ndarray, " N"]  # place in the plan; NOBODY without one
    leader: Int[np.ndarray, " N"]  # number of the seed of the organism
    roles: Int[np.ndarray, " N"]  # bits of the places that are known to be taken
    ticket: Int[np.ndarray, " N"]  # whom the organism accepts, of `make_ticket`
    goes: Int[np.ndarray, " N"]  # what the organism was told: `STAY`, `PART` or `DISSOLVE`
    accepted_since: Float[np.ndarray, " N"]  # how long the present robot has been accepted [s]
    turn: Float[np.ndarray, " N"]  # to which side a robot turns away, 1 left or -1 right
    avoiding: Float[np.ndarray, " N"]  # time that it goes on turning [s]
    silent: Float[np.ndarray, " N"]  # time since it heard of an organism [s]
    unseen: Float[np.ndarray, " N"]  # time since it heard a beacon [s]
    alone: Float[np.ndarray, " N"]  # time for which it does not follow calls, after it met something [s]
    heard_role: Int[np.ndarray, " N"]  # place that the beacon wants that it heads for
    heard_leader: Int[np.ndarray, " N"]  # seed of its organism
    mark: Float[np.ndarray, " N"]  # distance that its tracks had run at a mark [m]
    has_climbed: Bool[np.ndarray, " N"]  # whether it has been on a slope since it began to retreat
    recoveries: Int[np.ndarray, " N"]  # how often it has recovered
    growth: Float[np.ndarray, " N"]  # time since its organism has grown [s]
    # pose of the beacon as it was last heard and since carried on by odometry: ahead [m], left [m], axis [rad]
    dock: Float[np.ndarray, "N 3"]
    ran: Float[np.ndarray, "N 2"]  # odometry at the last decision [m]
    nearest: Float[np.ndarray, " N"]  # least distance to the beacon since the robot began to locate it [m]
    stalled: Float[np.ndarray, " N"]  # time for which it has come no nearer [s]
    asking: Float[np.ndarray, " N"]  # time for which it has asked, and nobody was accepted [s]
    unanswered: Float[np.ndarray, " N"]  # time since the organism heard of the robot that it has accepted [s]

    @classmethod
    def begin(cls, num_robots: int) -> "Memory":
        """Return the memory of robots that explore and know nothing."""
        values: dict[str, np.ndarray] = {name: np.zeros(num_robots) for name in cls._fields}
        for name in ("mode", "roles", "ticket", "goes", "recoveries"):
            values[name] = np.zeros(num_robots, np.int64)
        for name in ("role", "leader", "heard_role", "heard_leader"):
            values[name] = np.full(num_robots, NOBODY)
        for name in ("silent", "unseen", "nearest"):
            values[name] = np.full(num_robots, np.inf)
        values |= {"has_climbed": np.zeros(num_robots, bool), "turn": np.ones(num_robots)}
        values |= {"dock": np.zeros((num_robots, 3)), "ran": np.zeros((num_robots, 2))}
        return cls(**values)

    def start(
        self, robots: Bool[np.ndarray, " N"] | Int[np.ndarray, " K"], mode: Mode, **values: object
    ) -> "Memory":
        """Return a memory in which some robots are in a mode, as scripts and tests begin."""
        changed = {}
        for name, value in {"mode": mode, "since": 0.0, **values}.items():
            changed[name] = getattr(self, name).copy()
            changed[name][robots] = value
        return self._replace(**changed)


def make_ticket(version: Int[np.ndarray, " N"], robot: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Return words of an organism that accept a robot, or NOBODY; a later version wins over an earlier one."""
    return version * _TICKET + robot + 1


def read_ticket(ticket: Int[np.ndarray, " N"]) -> tuple[Int[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return version and accepted robot, NOBODY for none."""
    return ticket // _TICKET, ticket % _TICKET - 1


class Plan(NamedTuple):
    """Which place of an organism wants which other at each of its docks."""

    # place that is to dock at each dock of a place, in the order of `SIDES`; NOBODY for none
    wanted: Int[np.ndarray, "n 4"]
    everyone: int  # bits of all places

    @property
    def num_roles(self) -> int:
        """Number of robots that the organism needs."""
        return len(self.wanted)


def make_plan(organism: Organism) -> Plan:
    """Return the plan of an organism whose module 0 is the seed, and to which robots dock with their front docks."""
    if organism.num_modules > MOST_ROLES:
        raise OrganismError(f"a plan has at most {MOST_ROLES} robots, got {organism.num_modules}")
    wanted = np.full((organism.num_modules, len(SIDES)), NOBODY)
    parents = organism.parents
    for docking in organism.dockings:
        ends = dict(docking.ends)
        child = docking.second if parents[docking.second] == docking.first else docking.first
        parent = docking.first + docking.second - child
        if SIDES.index(ends[child]) != FRONT:
            raise OrganismError(
                f"robots dock with their front docks; module {child} would with its {ends[child]} dock"
            )
        wanted[parent, SIDES.index(ends[parent])] = child
    return Plan(wanted, (1 << organism.num_modules) - 1)
