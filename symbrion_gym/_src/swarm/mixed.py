"""A swarm at two levels of physics at once: docked robots and those near them dynamic, the others kinematic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import DockConfig, find_matches, sort_links
from symbrion_gym._src.swarm.dynamic.assembly import Assembler
from symbrion_gym._src.swarm.dynamic.motion import Motion
from symbrion_gym._src.swarm.dynamic.transfer import Mating, read_motion
from symbrion_gym._src.swarm.dynamic.world import DynamicConfig, DynamicWorld
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.kinematic.motion import (
    KinematicConfig,
    find_headings,
    find_outlines,
    find_overlaps,
    find_pairs,
    take,
)
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands, SwarmState

if TYPE_CHECKING:
    from jaxtyping import Float

    from symbrion_gym._src.arenas.arena import Arena

UPRIGHT = float(np.cos(np.deg2rad(35.0)))
"""A dynamic robot whose up axis has less height lies on its side or leans on something: it stays dynamic."""
_HIGHEST = 0.02
"""So does one whose center is higher above the surface than on its tracks by more than this [m]."""
_MOVING = ("position", "rotation", "velocity", "spin", "hinge")
"""Fields of the state that robots change by moving."""


@dataclass(frozen=True)
class MixedConfig:
    """Where the border between the levels of physics is.

    Attributes:
        near: a robot this near to a dynamic one becomes dynamic as well [m], center to center: beyond the reach of two
            arms and what both drive in a decision.
        far: it stays so up to this distance [m].
        overlap: a dynamic robot stays so while its outline, as the kinematic level has it, is deeper than this within
            another one [m].
        dynamic: how contact is stepped.
        kinematic: limits and errors of the simple motion.

    Raises:
        OptionError: a value is out of range.
    """

    near: float = 0.20
    far: float = 0.26
    overlap: float = 0.002
    dynamic: DynamicConfig = field(default_factory=DynamicConfig)
    kinematic: KinematicConfig = field(default_factory=KinematicConfig)

    def __post_init__(self) -> None:
        check_positive(self, ("near", "far", "overlap"), OptionError)
        if self.far < self.near:
            raise OptionError(f"far is {self.far} m, below near, {self.near} m; give a larger one")


class MixedWorld:
    """N Scouts, each at one of two levels of physics (a `SwarmWorld`).

    Robots that are docked or about to latch, and all near them, are in full contact; the others move kinematically. A
    robot that has tipped over, stands on another one or reaches into it stays in full contact.
    Poses, velocities, hinges and dockings are carried over whenever a robot changes its level: nothing is lost. A
    kinematic robot stands on the exact surface; one that becomes dynamic is lifted out of the contact geometry of the
    arena, which differs by the accuracy of the arena.

    Args:
        arena: where the robots are.
        num_robots: N.
        scout: constants of the robots; None for the defaults, with the friction of the arena.
        docks: when docks latch; None for the defaults.
        config: where the border is; None for the defaults.

    Attributes:
        arena: where the robots are.
        num_robots: N.
        scout: constants of the robots.
        docks: when docks latch.
        config: where the border is.
        kinematic: the kinematic level; dynamic robots stand in the way there.
        dynamic: the dynamic level; None where no robot is in it.
        robots: which robots are in it, in its order.
        sight: rays in the arena, for senses and signals.
        time: since the reset [s].
        state: as it is now.
    """

    def __init__(
        self,
        arena: Arena,
        num_robots: int,
        scout: ScoutConfig | None = None,
        docks: DockConfig | None = None,
        config: MixedConfig | None = None,
    ) -> None:
        self.arena, self.num_robots = arena, num_robots
        self.scout, self.docks = scout or ScoutConfig(friction=arena.friction), docks or DockConfig()
        self.config = config or MixedConfig()
        self.kinematic = KinematicWorld(arena, num_robots, self.scout, self.docks, self.config.kinematic)
        self.sight = self.kinematic.sight
        self._assembler = Assembler(arena, self.scout, self.config.dynamic.timestep)
        self._clear()

    def _clear(self) -> None:
        self.time, self._since_decision = 0.0, 0.0
        self.dynamic: DynamicWorld | None = None
        self.robots: tuple[int, ...] = ()
        self._target = np.zeros(self.num_robots)
        self._odometry = np.zeros((0, 2))

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, kinematic, at x [m], y [m] and heading [rad]."""
        self._clear()
        self.kinematic.reset(poses, seed)
        self.state = self.kinematic.state

    def step(self, commands: SwarmCommands, duration: float = DECISION) -> None:
        """Advance by one decision."""
        self._choose_levels(commands)
        self._since_decision += duration
        before = self.state
        if self.dynamic is not None:
            rows = list(self.robots)
            self.dynamic.step(SwarmCommands(*(np.asarray(each)[rows] for each in commands)), duration)
            self._target[rows] = self.dynamic.target
        self.time += duration
        state = self._write_dynamic(before)
        if self._since_decision > DECISION - 1e-9:
            self._since_decision -= DECISION
            self.kinematic.set_state(state._replace(links=()), self.time - DECISION)
            self.kinematic.step(_hold(commands, self.robots))
            state = self._join(state)
        self.state = state

    def find_dynamic(self, robots: Sequence[int]) -> tuple[DynamicWorld, list[int]]:
        """Return the dynamic world that robots are in, and their numbers there."""
        if self.dynamic is None or not set(robots) <= set(self.robots):
            raise OptionError(f"robots {list(robots)} are not all dynamic; those are {list(self.robots)}")
        return self.dynamic, [self.robots.index(robot) for robot in robots]

    def _choose_levels(self, commands: SwarmCommands) -> None:
        """Change the levels of robots that dock, part, come near or go away."""
        new = find_matches(self.state, np.asarray(commands.latch, bool), self.docks, self.scout)
        docked = [robot for link in (*self.state.links, *new) for robot, _ in link.ends]
        wanted = tuple(_spread(self.state, [*docked, *self._find_unfit()], self.robots, self.config))
        if wanted != self.robots:
            self._enter(wanted)

    def _find_unfit(self) -> list[int]:
        """Return the dynamic robots that have no kinematic pose: not on their tracks, or within another's outline."""
        robots, state = np.array(self.robots, int), self.state
        if not len(robots):
            return []
        position = state.position[robots]
        above = position[:, 2] - self.arena.height(position[:, 0], position[:, 1])
        stands = (state.rotation[robots, 2, 2] > UPRIGHT) & (above < self.scout.size[2] / 2 + _HIGHEST)
        first, second = find_pairs(state.position, 2 * self.scout.arm_reach)
        outlines = find_outlines(state.position, find_headings(state.rotation), state.hinge, self.scout)
        overlap = find_overlaps(take(outlines, first), take(outlines, second), self.scout)
        is_within = overlap > self.config.overlap
        within = np.union1d(first[is_within], second[is_within])
        return robots[~stands | np.isin(robots, within)].tolist()

    def _enter(self, robots: tuple[int, ...]) -> None:
        """Let exactly these robots be dynamic."""
        motion, matings = self._read_motion(), self._read_matings()
        rows, former = list(robots), self.robots
        self.robots, self.dynamic = robots, None
        self._odometry = np.zeros((len(robots), 2))
        if not robots:
            return
        numbers = {robot: number for number, robot in enumerate(robots)}
        self.dynamic = DynamicWorld(
            self.arena, len(robots), self.scout, self.docks, self.config.dynamic, self._assembler
        )
        is_new = ~np.isin(rows, former)
        self._target[rows] = np.where(is_new, motion.hinge[rows], self._target[rows])
        own = Motion(*(each[rows] for each in motion))
        links = tuple(_renumber(link, numbers) for link in self.state.links)
        matings = {_renumber(link, numbers): mating for link, mating in matings.items()}
        self.dynamic.begin(own, links, self._target[rows], matings, is_new)

    def _read_motion(self) -> Motion:
        """Return how all robots move, as their levels have it."""
        state = self.state
        places = state.position.copy(), state.rotation.copy(), state.velocity.copy(), state.spin.copy()
        motion = Motion(*places, state.hinge.copy(), np.zeros(self.num_robots))
        if self.dynamic is not None:
            own = read_motion(self.dynamic.assembly, self.dynamic.data)
            for values, new in zip(motion, own, strict=True):
                values[list(self.robots)] = new
        return motion

    def _read_matings(self) -> dict[Docking, Mating]:
        """Return the matings under way, with the times at which they began before now."""
        if self.dynamic is None:
            return {}
        now, names = self.dynamic.time, dict(enumerate(self.robots))
        return {
            _renumber(link, names): replace(mating, began=mating.began - now)
            for link, mating in self.dynamic.matings.items()
        }

    def _write_dynamic(self, before: SwarmState) -> SwarmState:
        """Return the state with what the dynamic robots have done; the others stand."""
        if self.dynamic is None:
            return before._replace(links=(), load=np.zeros((self.num_robots, 4)))
        rows, own, names = list(self.robots), self.dynamic.state, dict(enumerate(self.robots))
        load, odometry = np.zeros((self.num_robots, 4)), before.odometry.copy()
        load[rows] = own.load
        odometry[rows] += own.odometry - self._odometry
        self._odometry = own.odometry
        links = sort_links([_renumber(link, names) for link in own.links])
        moved = _overwrite(before, own, rows)
        return moved._replace(links=links, load=load, odometry=odometry)

    def _join(self, state: SwarmState) -> SwarmState:
        """Return the state with what the kinematic robots have done."""
        rows = np.setdiff1d(np.arange(self.num_robots), self.robots)
        moved = self.kinematic.state
        own = moved._replace(**{name: getattr(moved, name)[rows] for name in _MOVING})
        odometry = moved.odometry.copy()
        odometry[list(self.robots)] = state.odometry[list(self.robots)]
        return _overwrite(state, own, rows.tolist())._replace(odometry=odometry)


def _overwrite(state: SwarmState, own: SwarmState, rows: list[int]) -> SwarmState:
    """Return a state with the motion of some robots from another one, which has these alone."""
    fields = {name: getattr(state, name).copy() for name in _MOVING}
    for name, values in fields.items():
        values[rows] = getattr(own, name)
    return state._replace(**fields)


def _spread(
    state: SwarmState, seeds: Sequence[int], dynamic: Sequence[int], config: MixedConfig
) -> list[int]:
    """Return robots that have to be dynamic, those near them, and those near these."""
    chosen = np.zeros(len(state.position), bool)
    chosen[list(seeds)] = True
    apart = np.linalg.norm(state.position[:, None] - state.position[None], axis=-1)
    was = np.isin(np.arange(len(chosen)), dynamic)
    reach = np.where(was[:, None] & was, config.far, config.near)
    is_near = apart <= reach
    while True:
        more = chosen | is_near[chosen].any(axis=0)
        if (more == chosen).all():
            return np.flatnonzero(chosen).tolist()
        chosen = more


def _renumber(link: Docking, numbers: dict[int, int]) -> Docking:
    ends = sorted((numbers[robot], side) for robot, side in link.ends)
    return Docking(*ends[0], *ends[1])


def _hold(commands: SwarmCommands, robots: Sequence[int]) -> SwarmCommands:
    """Return commands for the kinematic level: dynamic robots stand, and nothing latches."""
    tracks = np.array(commands.tracks, dtype=np.float64)
    tracks[list(robots)] = 0.0
    return SwarmCommands(tracks, commands.hinge, np.zeros_like(commands.latch, dtype=bool))
