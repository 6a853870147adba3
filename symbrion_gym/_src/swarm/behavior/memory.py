"""What robots remember from one decision to the next, and the names of what they do."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.swarm.behavior.percepts import NOBODY


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
    """The memory of N robots.

    Attributes:
        mode: values of `Mode`.
        since: time in the mode [s].
        role: place in the plan; NOBODY without one.
        leader: number of the seed of the organism.
        roles: bits of the places that are known to be taken.
        ticket: whom the organism accepts, of `make_ticket`.
        goes: what the organism was told: to stay, to part and go on, or to dissolve (`STAY`, `PART`, `DISSOLVE`).
        accepted_since: how long the present robot has been accepted [s].
        turn: to which side a robot turns away, 1 left or -1 right.
        avoiding: time that it goes on turning [s].
        silent: time since it heard of an organism [s].
        unseen: time since it heard a beacon [s].
        alone: time for which it does not follow calls, after it met something [s].
        heard_role: place that the beacon wants that it heads for.
        heard_leader: seed of its organism.
        mark: distance that its tracks had run at a mark [m].
        has_climbed: whether it has been on a slope since it began to retreat.
        recoveries: how often it has recovered.
        growth: time since its organism has grown [s].
        dock: pose of the beacon as it was last heard and since carried on by odometry: ahead [m], left [m], axis [rad].
        ran: odometry at the last decision [m].
        nearest: least distance to the beacon since the robot began to locate it [m].
        stalled: time for which it has come no nearer [s].
        asking: time for which it has asked, and nobody was accepted [s].
        unanswered: time since the organism heard of the robot that it has accepted [s].
    """

    mode: Int[np.ndarray, " N"]
    since: Float[np.ndarray, " N"]
    role: Int[np.ndarray, " N"]
    leader: Int[np.ndarray, " N"]
    roles: Int[np.ndarray, " N"]
    ticket: Int[np.ndarray, " N"]
    goes: Int[np.ndarray, " N"]
    accepted_since: Float[np.ndarray, " N"]
    turn: Float[np.ndarray, " N"]
    avoiding: Float[np.ndarray, " N"]
    silent: Float[np.ndarray, " N"]
    unseen: Float[np.ndarray, " N"]
    alone: Float[np.ndarray, " N"]
    heard_role: Int[np.ndarray, " N"]
    heard_leader: Int[np.ndarray, " N"]
    mark: Float[np.ndarray, " N"]
    has_climbed: Bool[np.ndarray, " N"]
    recoveries: Int[np.ndarray, " N"]
    growth: Float[np.ndarray, " N"]
    dock: Float[np.ndarray, "N 3"]
    ran: Float[np.ndarray, "N 2"]
    nearest: Float[np.ndarray, " N"]
    stalled: Float[np.ndarray, " N"]
    asking: Float[np.ndarray, " N"]
    unanswered: Float[np.ndarray, " N"]

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
_TICKET = 4096
"""More than there are robots in a swarm."""
