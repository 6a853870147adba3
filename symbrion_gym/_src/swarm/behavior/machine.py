"""The finite state machine of a swarm: what robots sense in, what they do and say out.

A robot explores until it meets a pit. Then it drives back to level ground and becomes the seed: its free docks call,
and the dock where the plan wants the next robot is a beacon. Robots that hear it ask, one at a time is accepted, drives
to the axis of the dock, aligns, docks and locks, and goes on recruiting. Once all places of the plan are taken, the
organism acts; told to part, all undock and drive on. No robot knows where it is, nor any state but its own.

References:
    Liu and Winfield (2010), Autonomous morphogenesis in self-assembling robots using IR-based sensing and local
    communications, ANTS; symbrion-morph, names of the states. The signals' content is ours.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.behavior import transitions
from symbrion_gym._src.swarm.behavior.hearing import HearingConfig
from symbrion_gym._src.swarm.behavior.memory import (
    DISSOLVE,
    STAY,
    Memory,
    Mode,
    Plan,
    carry,
    locate,
    make_ticket,
    read_ticket,
    recall,
)
from symbrion_gym._src.swarm.behavior.motion import find_tracks
from symbrion_gym._src.swarm.behavior.percepts import FRONT, NOBODY, Percepts, Wired, Words
from symbrion_gym._src.swarm.behavior.sensing import Sensing
from symbrion_gym._src.swarm.behavior.steering import choose_turn
from symbrion_gym._src.swarm.behavior.transitions import Situation
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands, SwarmWorld

FOLDED = np.pi / 2  # Angle of an arm that nothing is docked to [rad]
ASKING = 0.3
"""Chance that a robot that waits asks in a decision: two that ask at once are not understood. One that was accepted
goes on asking, as a sign that it comes."""
SILENCE = 15.0
"""An organism that has not heard of the robot that it has accepted for so long accepts another [s]."""
NEARER = 0.03  # A robot that locates a beacon has come nearer where its distance is less by this [m]
_ALONE = 4.0  # A robot that met something follows no calls for this many times its `avoid_time`
_PAUSE = 10.0  # One that gives up explores for so long [s]
_ORGANIC = (Mode.RECRUIT, Mode.IN_ORGANISM, Mode.LOCK)
"""Modes of robots that belong to an organism, or found one."""
_STRAIGHT = (Mode.ALIGN, Mode.DOCK)
_DOCKING = (Mode.LOCATE_BEACON, Mode.ALIGN, Mode.DOCK, Mode.RECOVER)


class Decision(NamedTuple):
    """What a swarm does next."""

    commands: SwarmCommands  # for the world
    words: Words  # what docks broadcast
    wire: Wired  # what each robot tells its neighbors: the same at every dock
    memory: Memory  # for the next decision


class Machine:
    """The behaviors of a swarm.

    Args:
        plan: of the organism to become.
        num_robots: N.
        weights: of the behaviors; None for the defaults.
        docks: whether robots may dock; a swarm without docking explores, and is a baseline.

    Attributes:
        plan: of the organism.
        weights: of the behaviors.
        num_robots: N.
    """

    def __init__(
        self, plan: Plan, num_robots: int, weights: BehaviorWeights | None = None, docks: bool = True
    ) -> None:
        self.plan, self.num_robots, self.weights = plan, num_robots, weights or BehaviorWeights()
        self.docks = docks
        self._numbers = np.arange(num_robots)

    def decide(self, percepts: Percepts, memory: Memory, rng: np.random.Generator) -> Decision:
        """Return commands, broadcasts and the next memory."""
        chance = rng.random((3, self.num_robots))
        memory = self._listen(percepts, memory)
        percepts = percepts._replace(beacon=recall(percepts.beacon, memory.dock))
        memory = self._time_approach(percepts, memory)
        here = Situation(percepts, memory, self.plan, self.weights, self._numbers)
        following = transitions.find_next(here) if self.docks else memory.mode
        memory = self._enter(here, following, chance[0], chance[2])
        here = here._replace(memory=memory)
        memory = self._give_up(here)
        here = here._replace(memory=memory)
        memory = self._accept(here)
        here = here._replace(memory=memory)
        commands = SwarmCommands(find_tracks(here), self._bend(here), self._latch(here))
        return Decision(commands, self._speak(here, chance[1]), self._tell(here), memory)

    def _listen(self, percepts: Percepts, memory: Memory) -> Memory:
        """Read wires, and let time pass."""
        wired, belongs = percepts.wired, np.isin(memory.mode, _ORGANIC)
        told = np.bitwise_or.reduce(np.where(percepts.docked, wired.roles, 0), axis=-1)
        goes = np.where(memory.mode == Mode.UNDOCK, memory.goes, STAY)
        own = np.where(memory.role >= 0, 1 << np.maximum(memory.role, 0), 0)
        roles = np.where(belongs, memory.roles | told | own, 0)
        heard = np.where(percepts.docked, wired.ticket, 0).max(axis=-1)
        leader = np.where(percepts.docked, wired.leader, 0).max(axis=-1) - 1
        is_heard = percepts.beacon.is_heard | percepts.guide.is_heard
        dock = carry(memory.dock, percepts.odometry - memory.ran)
        return memory._replace(
            since=memory.since + DECISION,
            roles=roles,
            ticket=np.where(belongs, np.maximum(memory.ticket, heard), 0),
            leader=np.where(belongs & (memory.role > 0) & (leader >= 0), leader, memory.leader),
            goes=np.where(
                belongs, np.maximum(memory.goes, np.where(percepts.docked, wired.goes, 0).max(axis=-1)), goes
            ),
            accepted_since=memory.accepted_since + DECISION,
            avoiding=np.maximum(memory.avoiding - DECISION, 0.0),
            silent=np.where(is_heard, 0.0, memory.silent + DECISION),
            unseen=np.where(percepts.beacon.is_heard, 0.0, memory.unseen + DECISION),
            alone=np.maximum(memory.alone - DECISION, 0.0),
            growth=np.where(roles != memory.roles, 0.0, memory.growth + DECISION),
            dock=np.where(percepts.beacon.is_heard[:, None], locate(percepts.beacon), dock),
            ran=percepts.odometry,
        )

    def _time_approach(self, percepts: Percepts, memory: Memory) -> Memory:
        """Note how long robots have come no nearer, have asked, and were accepted without a word."""
        beacon, asker = percepts.beacon, percepts.asker
        locates = memory.mode == Mode.LOCATE_BEACON
        begins = locates & (memory.since <= DECISION)
        nearest = np.where(begins, np.inf, memory.nearest)
        comes_nearer = locates & beacon.is_heard & (beacon.distance < nearest - NEARER)
        waits = memory.mode == Mode.WAIT
        is_free = ~beacon.is_heard | (beacon.accepts == NOBODY)
        answers = asker.is_heard & (asker.asker == read_ticket(memory.ticket)[1])
        return memory._replace(
            nearest=np.where(comes_nearer, beacon.distance, nearest),
            stalled=np.where(comes_nearer, 0.0, memory.stalled + locates * DECISION),
            asking=np.where(waits & is_free, memory.asking + DECISION, 0.0),
            unanswered=np.where(answers, 0.0, memory.unanswered + DECISION),
        )

    def _enter(self, here: Situation, following: np.ndarray, chance: np.ndarray, coin: np.ndarray) -> Memory:
        """Change modes, and note what a new one needs."""
        percepts, memory, weights = here.percepts, here.memory, self.weights
        is_new = following != memory.mode
        former = memory.mode
        begins = {mode: is_new & (following == mode) for mode in Mode}
        memory = memory._replace(mode=following, since=np.where(is_new, 0.0, memory.since))
        meets = transitions.find_obstacles(here._replace(memory=memory))
        is_level = np.abs(percepts.pitch) < transitions.SLOPE
        wanders = (memory.mode == Mode.EXPLORE) & is_level & (memory.avoiding <= 0.0)
        wanders &= chance < DECISION / weights.straight_time
        turns = (meets & (memory.avoiding <= 0.0)) | wanders
        toward = np.where(wanders, np.where(coin < 0.5, 1.0, -1.0), choose_turn(percepts.proximity, coin))
        is_climbing = (np.abs(percepts.pitch) > transitions.SLOPE) & (memory.mode == Mode.RETREAT)
        climbed = memory.has_climbed & (memory.mode == Mode.RETREAT) | is_climbing
        # The odometry begins at the foot of the slope again; until then, at the pit.
        moves_mark = begins[Mode.RETREAT] | begins[Mode.LEAVE] | is_climbing
        is_seed = begins[Mode.RECRUIT] & (memory.role < 0)
        knows = np.isin(memory.mode, _DOCKING) & percepts.beacon.is_heard
        locks = begins[Mode.LOCK]
        ends = begins[Mode.EXPLORE] | begins[Mode.RECOVER]
        alone = np.where(turns & meets, _ALONE * weights.avoid_time, memory.alone)
        gives_up = begins[Mode.EXPLORE] & np.isin(former, (Mode.UNDOCK, Mode.LOCATE_BEACON))
        role = np.where(is_seed, 0, np.where(locks, memory.heard_role, np.where(ends, NOBODY, memory.role)))
        leader = np.where(is_seed, here.numbers, np.where(locks, memory.heard_leader, memory.leader))
        return memory._replace(
            role=role,
            leader=np.where(ends, NOBODY, leader),
            turn=np.where(turns, toward, memory.turn),
            avoiding=np.where(turns, weights.avoid_time * (0.5 + coin), memory.avoiding),
            heard_role=np.where(knows, percepts.beacon.role, memory.heard_role),
            heard_leader=np.where(knows, percepts.beacon.leader, memory.heard_leader),
            mark=np.where(moves_mark, here.run, memory.mark),
            has_climbed=climbed,
            recoveries=memory.recoveries + begins[Mode.RECOVER],
            growth=np.where(is_seed | locks, 0.0, memory.growth),
            silent=np.where(gives_up, np.inf, memory.silent),
            alone=np.where(gives_up, _PAUSE, alone),
        )

    def _give_up(self, here: Situation) -> Memory:
        """Dissolve organisms that no longer grow, or that hear a larger one."""
        memory = here.memory
        belongs = np.isin(memory.mode, (Mode.RECRUIT, Mode.IN_ORGANISM)) & here.percepts.docked.any(axis=-1)
        is_full = (memory.roles & self.plan.everyone) == self.plan.everyone
        is_late = (memory.growth > self.weights.patience) | transitions.hears_larger(here)
        fails = belongs & ~is_full & is_late & (memory.goes == STAY)
        return memory._replace(goes=np.where(fails, DISSOLVE, memory.goes))

    def _accept(self, here: Situation) -> Memory:
        """Let recruiters accept who asks, for a while, and nobody once it has docked."""
        memory, asker = here.memory, here.percepts.asker
        version, accepted = read_ticket(memory.ticket)
        recruits = (memory.mode == Mode.RECRUIT) & here.open_docks.any(axis=-1)
        takes = recruits & (accepted < 0) & asker.is_heard
        is_late = (memory.accepted_since > self.weights.accept_time) | (memory.unanswered > SILENCE)
        is_slow = recruits & (accepted >= 0) & is_late
        is_done = np.isin(memory.mode, _ORGANIC) & (accepted == here.numbers)
        drops = is_slow | is_done
        robot = np.where(takes, asker.asker, NOBODY)
        changes = takes | drops
        return memory._replace(
            ticket=np.where(changes, make_ticket(version + 1, robot), memory.ticket),
            accepted_since=np.where(changes, 0.0, memory.accepted_since),
            unanswered=np.where(changes, 0.0, memory.unanswered),
        )

    def _bend(self, here: Situation) -> np.ndarray:
        """Fold free arms up, out of the way of infrared and laser; straighten them to dock."""
        straight = np.isin(here.memory.mode, (*_STRAIGHT, *_ORGANIC)) & (here.memory.role != 0)
        return np.where(straight | here.percepts.docked[:, FRONT], 0.0, FOLDED)

    def _latch(self, here: Situation) -> np.ndarray:
        """Tell docks to latch that hold or want a robot."""
        mode = here.memory.mode
        # All hear that they part before the first dock opens: a word passes one robot a decision.
        is_telling = (mode == Mode.UNDOCK) & (here.memory.since < DECISION * self.plan.num_roles)
        organic = np.isin(mode, _ORGANIC) | is_telling
        latch = organic[:, None] & ((here.wanted >= 0) | here.percepts.docked)
        holds = np.isin(mode, (Mode.DOCK, Mode.LOCK)) | (organic & (here.memory.role > 0))
        latch[:, FRONT] |= holds
        return latch

    def _speak(self, here: Situation, chance: np.ndarray) -> Words:
        """Return what every dock broadcasts."""
        memory, shape = here.memory, here.percepts.docked.shape
        calls = (memory.mode == Mode.RECRUIT) | (memory.mode == Mode.IN_ORGANISM)
        is_full = (memory.roles & self.plan.everyone) == self.plan.everyone
        calls &= ~is_full & (memory.goes == STAY)
        is_beacon = (calls & (memory.mode == Mode.RECRUIT))[:, None] & here.open_docks
        is_guide = calls[:, None] & ~here.percepts.docked & ~is_beacon
        beacon = here.percepts.beacon
        asks = (memory.mode == Mode.WAIT) & beacon.is_heard & (beacon.accepts == NOBODY)
        asks = (asks | np.isin(memory.mode, _DOCKING)) & (chance < ASKING)
        size = transitions.count_robots(memory)
        return Words(
            is_beacon=is_beacon,
            is_guide=is_guide,
            role=here.wanted,
            accepts=np.broadcast_to(transitions.find_accepted(here)[:, None], shape),
            leader=np.broadcast_to(memory.leader[:, None], shape),
            asker=np.broadcast_to(np.where(asks, here.numbers, NOBODY)[:, None], shape),
            size=np.broadcast_to(size[:, None], shape),
        )

    def _tell(self, here: Situation) -> Wired:
        """Return what every robot says over its wires."""
        memory, shape = here.memory, here.percepts.docked.shape
        words = (memory.roles, memory.ticket, memory.leader + 1, memory.goes)
        return Wired(*(np.broadcast_to(word[:, None], shape) for word in words))

    def is_complete(self, memory: Memory) -> bool:
        """Return whether some organism has all of its robots, each locked."""
        full = (memory.roles & self.plan.everyone) == self.plan.everyone
        return int((full & (memory.mode == Mode.IN_ORGANISM)).sum()) >= self.plan.num_roles


class Track(NamedTuple):
    """Where robots were and what they did, decision by decision."""

    time: Float[np.ndarray, " T"]  # since the beginning [s]
    position: Float[np.ndarray, "T N 3"]  # of the robots [m]
    rotation: Float[np.ndarray, "T N 3 3"]  # of their chassis
    hinge: Float[np.ndarray, "T N"]  # angles of their hinges [rad]
    mode: Int[np.ndarray, "T N"]  # what they did, values of `Mode`
    num_links: Int[np.ndarray, " T"]  # latched docks

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
