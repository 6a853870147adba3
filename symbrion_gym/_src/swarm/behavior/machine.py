"""The finite state machine of a swarm: what robots sense in, what they do and say out.

A robot explores until it meets a pit. Then it drives back to level ground and becomes the seed: its free docks call,
and the dock where the plan wants the next robot is a beacon. Robots that hear it ask, one at a time is accepted, drives
to the axis of the dock, aligns, docks and locks, and goes on recruiting. Once all places of the plan are taken, the
organism acts; told to part, all undock and drive on. No robot knows where it is, nor any state but its own.

References:
    Liu and Winfield (2010), Autonomous morphogenesis in self-assembling robots using IR-based sensing and local
    communications, ANTS; symbrion-morph, names of the states. The signals' content is ours.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.swarm.behavior.memory import (
    DISSOLVE,
    NOBODY,
    STAY,
    Heard,
    Memory,
    Mode,
    Percepts,
    Plan,
    Wired,
    Words,
    make_ticket,
    read_ticket,
)
from symbrion_gym._src.swarm.behavior.sensing import Sensing, wrap
from symbrion_gym._src.swarm.behavior.states import (
    ACCEPT_TIME,
    HALF_GAUGE,
    PATIENCE,
    REACH,
    SLIP,
    SLOPE,
    Situation,
    choose_turn,
    find_axis,
    find_next,
    find_tracks,
)
from symbrion_gym._src.swarm.senses import SwarmWorld
from symbrion_gym._src.swarm.world import DECISION, FOLDED, FRONT, SwarmCommands

ASKING = 0.3
"""Chance that a robot that waits asks in a decision: two that ask at once are not understood. One that was accepted
goes on asking, as a sign that it comes."""
SILENCE = 15.0
"""An organism that has not heard of the robot that it has accepted for so long accepts another [s]."""
STRAIGHT_TIME = 8.0  # Mean time that an exploring robot drives straight before it turns at random [s]
AVOID_TIME = 2.0  # How long a robot that met something turns away [s]
_ALONE = 8.0  # It follows no calls for so long [s]
_PAUSE = 10.0  # One that gives up explores for so long [s]
_NEARER = 0.03  # A robot that locates a beacon has come nearer where its distance is less by this [m]
_ORGANIC = (Mode.RECRUIT, Mode.IN_ORGANISM, Mode.LOCK)
"""Modes of robots that belong to an organism, or found one."""
_STRAIGHT = (Mode.ALIGN, Mode.DOCK, *_ORGANIC)
_DOCKING = (Mode.LOCATE_BEACON, Mode.ALIGN, Mode.DOCK, Mode.RECOVER)


class Decision(NamedTuple):
    """What a swarm does next."""

    commands: SwarmCommands  # for the world
    words: Words  # what robots broadcast
    wire: Wired  # what each robot tells its neighbors
    memory: Memory  # for the next decision


class Machine:
    """The behaviors of a swarm that wants to become the organism of a plan; without `docks` it only explores."""

    def __init__(self, plan: Plan, num_robots: int, docks: bool = True) -> None:
        self.plan, self.num_robots, self.docks = plan, num_robots, docks

    def decide(self, percepts: Percepts, memory: Memory, rng: np.random.Generator) -> Decision:
        """Return commands, broadcasts and the next memory."""
        wander, ask, coin = rng.random((3, self.num_robots))
        here = Situation(percepts, memory, self.plan, np.arange(self.num_robots))
        here = time_approach(listen(here))
        here = enter(here, find_next(here) if self.docks else memory.mode, wander, coin)
        here = accept(give_up(here))
        commands = SwarmCommands(find_tracks(here), bend(here), latch(here))
        memory = here.memory
        wire = Wired(memory.roles, memory.ticket, memory.leader + 1, memory.goes)
        return Decision(commands, speak(here, ask), wire, memory)

    def is_complete(self, memory: Memory) -> bool:
        """Return whether some organism has all of its robots, each locked."""
        full = (memory.roles & self.plan.everyone) == self.plan.everyone
        return int((full & (memory.mode == Mode.IN_ORGANISM)).sum()) >= self.plan.num_roles


def listen(here: Situation) -> Situation:
    """Read wires, let time pass, and recall the beacon where it is not heard now."""
    percepts, memory = here.percepts, here.memory
    wired, beacon, belongs = percepts.wired, percepts.beacon, np.isin(memory.mode, _ORGANIC)
    own = np.where(memory.role >= 0, 1 << np.maximum(memory.role, 0), 0)
    roles = np.where(belongs, memory.roles | np.bitwise_or.reduce(wired.roles, axis=-1) | own, 0)
    leader = wired.leader.max(axis=-1) - 1
    goes = np.where(memory.mode == Mode.UNDOCK, memory.goes, STAY)
    dock = carry(memory.dock, percepts.odometry - memory.ran)
    dock = np.where(beacon.is_heard[:, None], locate(beacon), dock)
    here = here.remember(
        since=memory.since + DECISION,
        roles=roles,
        ticket=np.where(belongs, np.maximum(memory.ticket, wired.ticket.max(axis=-1)), 0),
        leader=np.where(belongs & (memory.role > 0) & (leader >= 0), leader, memory.leader),
        goes=np.where(belongs, np.maximum(memory.goes, wired.goes.max(axis=-1)), goes),
        accepted_since=memory.accepted_since + DECISION,
        avoiding=np.maximum(memory.avoiding - DECISION, 0.0),
        silent=np.where(beacon.is_heard | percepts.guide.is_heard, 0.0, memory.silent + DECISION),
        unseen=np.where(beacon.is_heard, 0.0, memory.unseen + DECISION),
        alone=np.maximum(memory.alone - DECISION, 0.0),
        growth=np.where(roles != memory.roles, 0.0, memory.growth + DECISION),
        dock=dock,
        ran=percepts.odometry,
    )
    return here._replace(percepts=percepts._replace(beacon=recall(beacon, dock)))


def carry(pose: Float[np.ndarray, "N 3"], way: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 3"]:
    """Return poses of docks in the frames of robots that have moved."""
    turn = (way[:, 1] - way[:, 0]) / (2 * HALF_GAUGE * SLIP)
    ahead, left = pose[:, 0] - way.mean(axis=-1), pose[:, 1]
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.stack([cosine * ahead + sine * left, cosine * left - sine * ahead, pose[:, 2] - turn], axis=-1)


def locate(heard: Heard) -> Float[np.ndarray, "N 3"]:
    """Return poses of the docks that are heard, in the frames of the robots."""
    distance = np.maximum(heard.distance, 0.0) + REACH
    ahead, left = distance * np.cos(heard.bearing), distance * np.sin(heard.bearing)
    return np.stack([ahead, left, find_axis(heard)], axis=-1)


def recall(heard: Heard, pose: Float[np.ndarray, "N 3"]) -> Heard:
    """Return what is heard, with distance, bearing and departure of the remembered dock where nothing is."""
    bearing = np.arctan2(pose[:, 1], pose[:, 0])
    distance = np.maximum(np.hypot(pose[:, 0], pose[:, 1]) - REACH, 0.0)
    return heard._replace(
        distance=np.where(heard.is_heard, heard.distance, distance),
        bearing=np.where(heard.is_heard, heard.bearing, bearing),
        departure=np.where(heard.is_heard, heard.departure, wrap(bearing + np.pi - pose[:, 2])),
    )


def time_approach(here: Situation) -> Situation:
    """Note how long robots have come no nearer, have asked, and were accepted without a word."""
    memory, beacon, asker = here.memory, here.percepts.beacon, here.percepts.asker
    locates = memory.mode == Mode.LOCATE_BEACON
    nearest = np.where(locates & (memory.since <= DECISION), np.inf, memory.nearest)
    comes_nearer = locates & beacon.is_heard & (beacon.distance < nearest - _NEARER)
    asks = (memory.mode == Mode.WAIT) & (~beacon.is_heard | (beacon.accepts == NOBODY))
    answers = asker.is_heard & (asker.asker == read_ticket(memory.ticket)[1])
    return here.remember(
        nearest=np.where(comes_nearer, beacon.distance, nearest),
        stalled=np.where(comes_nearer, 0.0, memory.stalled + locates * DECISION),
        asking=np.where(asks, memory.asking + DECISION, 0.0),
        unanswered=np.where(answers, 0.0, memory.unanswered + DECISION),
    )


def enter(
    here: Situation,
    following: Int[np.ndarray, " N"],
    wander: Float[np.ndarray, " N"],
    coin: Float[np.ndarray, " N"],
) -> Situation:
    """Change modes, and note what a new one needs."""
    beacon, former = here.percepts.beacon, here.memory.mode
    is_new = following != former
    here = here.remember(mode=following, since=np.where(is_new, 0.0, here.memory.since))
    begins, memory = {mode: is_new & (following == mode) for mode in Mode}, here.memory
    is_steep = np.abs(here.percepts.pitch) > SLOPE
    is_free, meets = memory.avoiding <= 0.0, here.meets
    wanders = (following == Mode.EXPLORE) & ~is_steep & is_free & (wander < DECISION / STRAIGHT_TIME)
    turns = (meets & is_free) | wanders
    toward = np.where(wanders, np.where(coin < 0.5, 1.0, -1.0), choose_turn(here, coin))
    is_climbing = is_steep & (following == Mode.RETREAT)
    # The odometry begins at the foot of the slope again; until then, at the pit.
    moves_mark = begins[Mode.RETREAT] | begins[Mode.LEAVE] | is_climbing
    is_seed, locks = begins[Mode.RECRUIT] & (memory.role < 0), begins[Mode.LOCK]
    knows = np.isin(following, _DOCKING) & beacon.is_heard
    ends = begins[Mode.EXPLORE] | begins[Mode.RECOVER]
    gives_up = begins[Mode.EXPLORE] & np.isin(former, (Mode.UNDOCK, Mode.LOCATE_BEACON))
    role = np.where(is_seed, 0, np.where(locks, memory.heard_role, np.where(ends, NOBODY, memory.role)))
    leader = np.where(is_seed, here.numbers, np.where(locks, memory.heard_leader, memory.leader))
    return here.remember(
        role=role,
        leader=np.where(ends, NOBODY, leader),
        turn=np.where(turns, toward, memory.turn),
        avoiding=np.where(turns, AVOID_TIME * (0.5 + coin), memory.avoiding),
        heard_role=np.where(knows, beacon.role, memory.heard_role),
        heard_leader=np.where(knows, beacon.leader, memory.heard_leader),
        mark=np.where(moves_mark, here.run, memory.mark),
        has_climbed=memory.has_climbed & (following == Mode.RETREAT) | is_climbing,
        recoveries=memory.recoveries + begins[Mode.RECOVER],
        growth=np.where(is_seed | locks, 0.0, memory.growth),
        silent=np.where(gives_up, np.inf, memory.silent),
        alone=np.where(gives_up, _PAUSE, np.where(turns & meets, _ALONE, memory.alone)),
    )


def is_full(here: Situation) -> Bool[np.ndarray, " N"]:
    """Return whether robots know all places of the plan to be taken."""
    return (here.memory.roles & here.plan.everyone) == here.plan.everyone


def count_robots(memory: Memory) -> Int[np.ndarray, " N"]:
    """Return how many robots each robot knows in its organism, itself at least."""
    return np.maximum(np.bitwise_count(memory.roles.astype(np.uint64)).astype(int), 1)


def give_up(here: Situation) -> Situation:
    """Dissolve organisms that no longer grow, or that hear a larger one."""
    memory = here.memory
    belongs = np.isin(memory.mode, (Mode.RECRUIT, Mode.IN_ORGANISM)) & ~here.is_alone
    is_late = (memory.growth > PATIENCE) | here.hears_other(memory.leader, count_robots(memory))
    fails = belongs & ~is_full(here) & is_late & (memory.goes == STAY)
    return here.remember(goes=np.where(fails, DISSOLVE, memory.goes))


def accept(here: Situation) -> Situation:
    """Let recruiters accept who asks, for a while, and nobody once it has docked."""
    memory, asker = here.memory, here.percepts.asker
    version, accepted = read_ticket(memory.ticket)
    recruits = (memory.mode == Mode.RECRUIT) & here.open_docks.any(axis=-1)
    takes = recruits & (accepted < 0) & asker.is_heard
    is_late = (memory.accepted_since > ACCEPT_TIME) | (memory.unanswered > SILENCE)
    is_done = np.isin(memory.mode, _ORGANIC) & (accepted == here.numbers)
    changes = takes | (recruits & (accepted >= 0) & is_late) | is_done
    robot = np.where(takes, asker.asker, NOBODY)
    return here.remember(
        ticket=np.where(changes, make_ticket(version + 1, robot), memory.ticket),
        accepted_since=np.where(changes, 0.0, memory.accepted_since),
        unanswered=np.where(changes, 0.0, memory.unanswered),
    )


def bend(here: Situation) -> Float[np.ndarray, " N"]:
    """Fold free arms up, out of the way of infrared and laser; straighten them to dock."""
    is_straight = np.isin(here.memory.mode, _STRAIGHT) & (here.memory.role != 0)
    return np.where(is_straight | here.percepts.docked[:, FRONT], 0.0, FOLDED)


def latch(here: Situation) -> Bool[np.ndarray, "N 4"]:
    """Tell docks to latch that hold or want a robot."""
    mode, docked = here.memory.mode, here.percepts.docked
    # All hear that they part before the first dock opens: a word passes one robot a decision.
    is_telling = (mode == Mode.UNDOCK) & (here.memory.since < DECISION * here.plan.num_roles)
    is_organic = np.isin(mode, _ORGANIC) | is_telling
    result = is_organic[:, None] & ((here.wanted >= 0) | docked)
    result[:, FRONT] |= np.isin(mode, (Mode.DOCK, Mode.LOCK)) | (is_organic & (here.memory.role > 0))
    return result


def speak(here: Situation, chance: Float[np.ndarray, " N"]) -> Words:
    """Return what every robot broadcasts."""
    memory, beacon = here.memory, here.percepts.beacon
    recruits = memory.mode == Mode.RECRUIT
    calls = (recruits | (memory.mode == Mode.IN_ORGANISM)) & ~is_full(here) & (memory.goes == STAY)
    is_beacon = (calls & recruits)[:, None] & here.open_docks
    asks = (memory.mode == Mode.WAIT) & beacon.is_heard & (beacon.accepts == NOBODY)
    asks = (asks | np.isin(memory.mode, _DOCKING)) & (chance < ASKING)
    return Words(
        is_beacon=is_beacon,
        is_guide=calls[:, None] & ~here.percepts.docked & ~is_beacon,
        role=here.wanted,
        accepts=read_ticket(memory.ticket)[1],
        leader=memory.leader,
        asker=np.where(asks, here.numbers, NOBODY),
        size=count_robots(memory),
    )


class Track(NamedTuple):
    """Where robots were and what they did, decision by decision."""

    time: Float[np.ndarray, " T"]  # since the beginning [s]
    position: Float[np.ndarray, "T N 3"]  # of the robots [m]
    rotation: Float[np.ndarray, "T N 3 3"]  # of their chassis
    hinge: Float[np.ndarray, "T N"]  # angles of their hinges [rad]
    mode: Int[np.ndarray, "T N"]  # what they did, values of `Mode`


class Recorder:
    """Collects a `Track`."""

    def __init__(self) -> None:
        self._rows: list[tuple] = []

    def add(self, world: SwarmWorld, mode: Int[np.ndarray, " N"]) -> None:
        """Note where the robots of a world are now."""
        state = world.state
        row = (world.time, state.position, state.rotation, state.hinge, mode)
        self._rows.append(tuple(np.array(value) for value in row))

    def read(self) -> Track:
        """Return what was noted."""
        return Track(*(np.array(column) for column in zip(*self._rows, strict=True)))


class BehavingSwarm:
    """A world, already reset, whose robots follow the behaviors; `memory` and `recorder` are as of now."""

    def __init__(
        self,
        world: SwarmWorld,
        machine: Machine,
        noise: float = 1.0,
        seed: int = 0,
        memory: Memory | None = None,
        recorder: Recorder | None = None,
    ) -> None:
        self.world, self.machine = world, machine
        count = world.num_robots
        self.memory = memory or Memory.begin(count)
        self.recorder = recorder or Recorder()
        self._sensing = Sensing(world, noise, seed)
        self._words = Words.make_silent(count)
        self._wire = Wired(*np.zeros((4, count), np.int64))
        self._rng = np.random.default_rng((seed, 11))

    def step(self) -> None:
        """Let all robots sense, decide and move once."""
        percepts = self._sensing.read(self._words, self._wire)
        decision = self.machine.decide(percepts, self.memory, self._rng)
        self.memory, self._words, self._wire = decision.memory, decision.words, decision.wire
        self.world.step(decision.commands)
        self.recorder.add(self.world, self.memory.mode)
