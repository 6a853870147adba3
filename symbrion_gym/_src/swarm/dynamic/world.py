"""A swarm in full contact: `DynamicWorld`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.robot.tracks import compute_wheel_radius
from symbrion_gym._src.swarm.docks import DockConfig, find_matches, find_released, sort_links
from symbrion_gym._src.swarm.dynamic.assembly import (
    Assembler,
    Assembly,
    Layout,
    Tree,
    compute_loads,
    find_layout,
)
from symbrion_gym._src.swarm.dynamic.motion import FOLDED, Motion, compute_jump
from symbrion_gym._src.swarm.dynamic.transfer import (
    Mating,
    compute_error,
    compute_share,
    copy_tree,
    has_mated,
    read_motion,
    refresh,
    write_motion,
    write_weld,
)
from symbrion_gym._src.swarm.placing import lay_robots
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands, SwarmState

_FRONT = SIDES.index("front")
_AT_REST = 0.02  # An arm that turns more slowly than this is folded for good [rad/s]
_LARGEST_JUMP = 5e-5  # What a change of the model may move a robot at most [m]
_FOLDED_TOLERANCE = 1e-3  # Arms this near to their folded angle count as folded [rad]


@dataclass(frozen=True)
class DynamicConfig:
    """How the physics is stepped.

    Raises:
        OptionError: a value is out of range, or a tick is no whole number of physics steps.
    """

    timestep: float = 0.005  # physics step [s]
    tick: float = 0.02  # time between two changes of the servos' targets, as of organisms [s]

    def __post_init__(self) -> None:
        check_positive(self, ("timestep", "tick"), OptionError)
        if abs(self.tick / self.timestep - round(self.tick / self.timestep)) > 1e-6:
            raise OptionError(
                f"tick is {self.tick} s; a whole number of physics steps of {self.timestep} s is needed"
            )


class DynamicWorld:
    """N Scouts in full contact; latched ones mate, then move as the very tree of an `Organism`.

    A latched pair is held by a weld, which pulls it to its exact pose in `DockConfig.mating_time`. Then the model is
    compiled again with both in one tree, and the state is carried over; a release is the reverse. In an organism, arms
    whose front dock is free fold up, whatever they are told, and are then part of the chassis, as in every `Organism`;
    only where such a dock is told to latch, its arm does as it is told.

    Args:
        arena: where the robots are.
        num_robots: N.
        scout: constants of the robots; None for the defaults.
        docks: when docks latch; None for the defaults.
        config: how the physics is stepped; None for the defaults.

    Attributes:
        arena: where the robots are.
        num_robots: N.
        scout: constants of the robots.
        docks: when docks latch.
        config: how the physics is stepped.
        time: since the reset [s].
        state: as it is now.
        assembly: the compiled model and where the robots are in it; a new one whenever the layout changes.
        data: its state, likewise.
        target: present targets of the hinges' servos [rad].
        matings: latched docks on their way to the exact pose.
        conversion: how all robots moved before and after the last change of the layout; None before the first.

    Raises:
        OptionError: no robots, or a kind of Scout that swarms lack.
    """

    def __init__(
        self,
        arena: Arena,
        num_robots: int,
        scout: ScoutConfig | None = None,
        docks: DockConfig | None = None,
        config: DynamicConfig | None = None,
    ) -> None:
        self.arena, self.num_robots = arena, num_robots
        self.scout, self.docks = scout or ScoutConfig(friction=arena.friction), docks or DockConfig()
        self.config = config or DynamicConfig()
        if isinstance(num_robots, bool) or num_robots < 1:
            raise OptionError(f"num_robots is {num_robots!r}; a whole number of at least 1 is needed")
        if self.scout.dofs != 1 or self.scout.tracks != "spheres":
            raise OptionError(
                f"dofs is {self.scout.dofs} and tracks {self.scout.tracks!r}; a swarm has Scouts with one hinge and "
                "sphere tracks"
            )
        self.assembler = Assembler(arena, self.scout, self.config.timestep)
        self.assembly: Assembly
        self.data: mujoco.MjData
        zero = np.zeros((num_robots, 3))
        spread = zero.copy()
        spread[:, 0] = np.arange(num_robots)
        self.begin(Motion(spread, np.tile(np.eye(3), (num_robots, 1, 1)), zero, zero, zero[:, 0], zero[:, 0]))

    def _clear(self) -> None:
        self.time = 0.0
        self._links: tuple[Docking, ...] = ()
        self.matings: dict[Docking, Mating] = {}
        self._torn: frozenset[Docking] = frozenset()
        self.conversion: tuple[Motion, Motion] | None = None
        self.target = np.zeros(self.num_robots)
        self._odometry = np.zeros((self.num_robots, 2))
        self._is_folding = np.zeros(self.num_robots, bool)

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, with level arms, at x [m], y [m] and heading [rad].

        Args:
            poses: one row for each robot.
            seed: ignored: nothing is random.

        Raises:
            ArenaError: a place off the surface, too steep, or within another robot.
            OptionError: another number of robots.
        """
        if len(poses) != self.num_robots:
            raise OptionError(f"{len(poses)} poses for {self.num_robots} robots; one for each is needed")
        position, rotation = lay_robots(self.arena, poses, self.scout)
        still = np.zeros((self.num_robots, 3))
        zero = np.zeros(self.num_robots)
        self.begin(Motion(position, rotation, still, still, zero, zero))

    def begin(
        self,
        motion: Motion,
        links: tuple[Docking, ...] = (),
    ) -> None:
        """Begin with robots in any motion, docked or not.

        Args:
            motion: of all robots.
            links: latched docks, in their exact poses.
        """
        self._clear()
        self._links = sort_links(links)
        self.target = np.array(motion.hinge, dtype=np.float64)
        self._enter(self._find_layout(_find_arms(motion, self._links)), motion)
        self.state = self._read_state()

    def step(self, commands: SwarmCommands, duration: float = DECISION) -> None:
        """Advance by one decision.

        Args:
            commands: what the robots are told.
            duration: time until the next decision [s], a whole number of ticks.

        Raises:
            OptionError: commands of another shape or not finite, or no whole number of ticks.
        """
        _check_commands(commands, self.num_robots)
        ticks = round(duration / self.config.tick)
        if ticks < 1 or abs(ticks * self.config.tick - duration) > 1e-9:
            raise OptionError(
                f"duration is {duration} s; a whole number of ticks of {self.config.tick} s is needed"
            )
        self._change_links(commands.latch)
        self._change_layout(commands.latch)
        self._write_tracks(commands.tracks)
        skip = round(self.config.tick / self.config.timestep)
        for _ in range(ticks):
            self._write_servos(commands.hinge)
            self._write_welds()
            mujoco.mj_step(self.assembly.model, self.data, nstep=skip)
            self.time += self.config.tick
        self._odometry = self._odometry + commands.tracks * duration
        self.state = self._read_state()

    def _change_links(self, latch: Bool[np.ndarray, "N 4"]) -> None:
        """Open what is released or torn, latch what matches."""
        gone = set(find_released(self._links, latch)) | self._torn
        kept = tuple(link for link in self._links if link not in gone)
        state = self.state._replace(links=kept)
        blocked = np.array(latch, bool)
        for link in gone:
            for robot, side in link.ends:
                blocked[robot, SIDES.index(side)] = False
        new = find_matches(state, blocked, self.docks, self.scout)
        for link in new:
            offset, turn = compute_error(self.assembly, self.data, link, self.scout)
            self.matings[link] = Mating(offset, turn, self.time)
        self.matings = {link: each for link, each in self.matings.items() if link not in gone}
        self._links, self._torn = sort_links([*kept, *new]), frozenset()

    def _change_layout(self, latch: Bool[np.ndarray, "N 4"]) -> None:
        """Compile the model again where robots have become one tree, or several.

        Docks that have mated wait as welds if a tree would move the robots by more than `_LARGEST_JUMP`.
        """
        is_open = self._find_open(latch)
        before, assembly, data, matings = self._read_now(), self.assembly, self.data, self.matings
        mated = {link for link in matings if self._is_mated(link)}
        for joined in (mated, set()):
            self.matings = {link: each for link, each in matings.items() if link not in joined}
            layout = self._find_layout(is_open)
            if layout == assembly.layout:
                return
            self._enter(layout, before, assembly)
            after = self._read_now()
            if compute_jump(before, after)[0] <= _LARGEST_JUMP or not joined:
                self.conversion = before, after
                return
            self.assembly, self.data = assembly, data

    def _read_now(self) -> Motion:
        return read_motion(self.assembly, self.data)

    def _find_layout(self, open_arms: Iterable[int] = ()) -> Layout:
        return find_layout(
            self._links, tuple(self.matings), frozenset(open_arms), self.num_robots, self.scout
        )

    def _find_open(self, latch: Bool[np.ndarray, "N 4"]) -> set[int]:
        """Return which docked robots have a movable arm with a free front dock, and let the others fold theirs."""
        arms = {robot for link in self._links for robot, _ in link.ends}
        arms -= {robot for link in self._links for robot, side in link.ends if side == "front"}
        is_wanted = latch[:, _FRONT]
        self._is_folding = np.isin(np.arange(self.num_robots), list(arms)) & ~is_wanted
        unfolded = _find_arms(self._read_now(), self._links)
        return {robot for robot in arms if is_wanted[robot]} | set(unfolded)

    def _is_mated(self, link: Docking) -> bool:
        return self.time - self.matings[link].began >= self.docks.mating_time and has_mated(
            self.assembly, self.data, link, self.scout
        )

    def _enter(self, layout: Layout, motion: Motion, source: Assembly | None = None) -> None:
        """Continue in a layout."""
        assembly = self.assembler.assemble(layout)
        data = mujoco.MjData(assembly.model)
        same: frozenset[Tree] = frozenset()
        if source is not None:
            same = frozenset(layout.trees) & frozenset(source.layout.trees)
            for tree in same:
                copy_tree(tree, source, self.data, assembly, data)
        write_motion(assembly, data, motion, self.scout, same)
        data.time = self.time
        self.assembly, self.data = assembly, data

    def _write_tracks(self, tracks: Float[np.ndarray, "N 2"]) -> None:
        geoms = self.assembly.track_geoms
        rate = np.repeat(tracks / compute_wheel_radius(self.scout), geoms.shape[1] // 2, axis=1)
        self.assembly.model.geom_surfacevel[geoms, 4] = rate

    def _write_servos(self, hinge: Float[np.ndarray, " N"]) -> None:
        """Move the servos' targets at their speed; free arms of docked robots fold up."""
        wanted = np.clip(hinge, -self.scout.hinge_range, self.scout.hinge_range)
        wanted = np.where(self._is_folding, FOLDED, wanted)
        turn = self.scout.hinge_speed * self.config.tick
        self.target = self.target + np.clip(wanted - self.target, -turn, turn)
        is_free = self.assembly.hinge_servo >= 0
        self.target[~is_free] = FOLDED
        self.data.ctrl[self.assembly.hinge_servo[is_free]] = self.target[is_free]

    def _write_welds(self) -> None:
        for index, link in enumerate(self.assembly.layout.welds):
            mating = self.matings.get(link, _EXACT)
            share = compute_share(self.time - mating.began, self.docks.mating_time)
            write_weld(self.assembly, self.data, index, mating, self.scout, share)

    def _read_state(self) -> SwarmState:
        """Return the state now; docks whose load is too large are noted where they tear."""
        load = compute_loads(self.assembly, self.data, self._links, self.scout)
        refresh(self.assembly.model, self.data)
        motion = read_motion(self.assembly, self.data)
        if self.docks.tears:
            self._torn = frozenset(
                link
                for link in self._links
                if load[link.first, SIDES.index(link.first_side)] > self.scout.dock_force
            )
        return SwarmState(*motion[:5], self._links, load, self._odometry.copy())


def _find_arms(motion: Motion, links: Sequence[Docking]) -> list[int]:
    """Return docked robots whose front dock is free and whose arm is not folded."""
    has_link, has_front = np.zeros((2, len(motion.hinge)), bool)
    for link in links:
        for robot, side in link.ends:
            has_link[robot] = True
            has_front[robot] |= side == "front"
    is_folded = (np.abs(motion.hinge - FOLDED) <= _FOLDED_TOLERANCE) & (np.abs(motion.hinge_rate) <= _AT_REST)
    return np.flatnonzero(has_link & ~has_front & ~is_folded).tolist()


_EXACT = Mating(np.zeros(3), np.zeros(3), -np.inf)


def _check_commands(commands: SwarmCommands, num_robots: int) -> None:
    shapes = {"tracks": (num_robots, 2), "hinge": (num_robots,), "latch": (num_robots, 4)}
    for name, shape in shapes.items():
        values = np.asarray(getattr(commands, name))
        if values.shape != shape:
            raise OptionError(f"commands.{name} has shape {values.shape}; {shape} is needed")
        if not np.isfinite(values).all():
            raise OptionError(f"commands.{name} has a number that is not finite")
