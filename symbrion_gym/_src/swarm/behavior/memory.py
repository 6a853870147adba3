"""What robots remember from one decision to the next, and the names of what they do."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.behavior.percepts import FRONT, NOBODY
from symbrion_gym._src.swarm.behavior.steering import HALF_GAUGE, SLIP, wrap

if TYPE_CHECKING:
    from jaxtyping import Float

    from symbrion_gym._src.swarm.behavior.percepts import Heard


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
    # what the organism was told: to stay, to part and go on, or to dissolve (`STAY`, `PART`, `DISSOLVE`)
    goes: Int[np.ndarray, " N"]
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
    # pose of the beacon as it was last heard and since carried on by odometry: ahead [m], left [m], axis
    # [rad]
    dock: Float[np.ndarray, "N 3"]
    ran: Float[np.ndarray, "N 2"]  # odometry at the last decision [m]
    nearest: Float[np.ndarray, " N"]  # least distance to the beacon since the robot began to locate it [m]
    stalled: Float[np.ndarray, " N"]  # time for which it has come no nearer [s]
    asking: Float[np.ndarray, " N"]  # time for which it has asked, and nobody was accepted [s]
    unanswered: Float[np.ndarray, " N"]  # time since the organism heard of the robot that it has accepted [s]

    @classmethod
    def begin(cls, num_robots: int) -> Memory:
        """Return the memory of robots that explore and know nothing."""
        zeros, whole = np.zeros(num_robots), np.zeros(num_robots, np.int64)
        nobody, no = np.full(num_robots, NOBODY), np.zeros(num_robots, bool)
        return cls(
            mode=whole + Mode.EXPLORE,
            since=zeros,
            role=nobody,
            leader=nobody,
            roles=whole,
            ticket=whole,
            goes=whole,
            accepted_since=zeros,
            turn=zeros + 1.0,
            avoiding=zeros,
            silent=zeros + np.inf,
            unseen=zeros + np.inf,
            alone=zeros,
            heard_role=nobody,
            heard_leader=nobody,
            mark=zeros,
            has_climbed=no,
            recoveries=whole,
            growth=zeros,
            dock=np.zeros((num_robots, 3)),
            ran=np.zeros((num_robots, 2)),
            nearest=zeros + np.inf,
            stalled=zeros,
            asking=zeros,
            unanswered=zeros,
        )

    def start(
        self, robots: Bool[np.ndarray, " N"] | Int[np.ndarray, " K"], mode: Mode, **values: object
    ) -> Memory:
        """Return a memory in which some robots are in a mode, as scripts and tests begin."""
        fields: dict[str, object] = {"mode": mode, "since": 0.0, **values}
        changed = {}
        for name, value in fields.items():
            changed[name] = getattr(self, name).copy()
            changed[name][robots] = value
        return self._replace(**changed)


def make_ticket(version: Int[np.ndarray, " N"], robot: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Return words of an organism that accept a robot, or NOBODY; a later version wins over an earlier one."""
    return version * _TICKET + robot + 1


def read_ticket(ticket: Int[np.ndarray, " N"]) -> tuple[Int[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return version and accepted robot, NOBODY for none."""
    return ticket // _TICKET, ticket % _TICKET - 1


STAY, PART, DISSOLVE = range(3)
"""What an organism is told: nothing, to part after its task, to part as the attempt has failed."""
_TICKET = 4096  # More than there are robots in a swarm


MOST_ROLES = 60  # Places of a plan: robots keep a bit for each


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


REACH = ScoutConfig().arm_reach
"""From the center of a robot to the dock with which it hears [m]: that of the front, with which it docks."""


def carry(pose: Float[np.ndarray, "N 3"], way: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 3"]:
    """Return poses of docks in the frames of robots that have moved."""
    turn = (way[:, 1] - way[:, 0]) / (2 * HALF_GAUGE * SLIP)
    ahead, left = pose[:, 0] - way.mean(axis=-1), pose[:, 1]
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.stack([cosine * ahead + sine * left, cosine * left - sine * ahead, pose[:, 2] - turn], axis=-1)


def locate(heard: Heard) -> Float[np.ndarray, "N 3"]:
    """Return poses of the docks that are heard, in the frames of the robots."""
    distance = np.maximum(heard.distance, 0.0) + REACH
    axis = wrap(heard.bearing + np.pi - heard.departure)
    return np.stack([distance * np.cos(heard.bearing), distance * np.sin(heard.bearing), axis], axis=-1)


def recall(heard: Heard, pose: Float[np.ndarray, "N 3"]) -> Heard:
    """Return what is heard, with distance, bearing and departure of the remembered dock where nothing is."""
    bearing = np.arctan2(pose[:, 1], pose[:, 0])
    distance = np.maximum(np.hypot(pose[:, 0], pose[:, 1]) - REACH, 0.0)
    departure = wrap(bearing + np.pi - pose[:, 2])
    return heard._replace(
        distance=np.where(heard.is_heard, heard.distance, distance),
        bearing=np.where(heard.is_heard, heard.bearing, bearing),
        departure=np.where(heard.is_heard, heard.departure, departure),
    )
