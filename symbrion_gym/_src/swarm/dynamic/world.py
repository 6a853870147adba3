"""A swarm in full contact: `DynamicWorld`."""

from collections.abc import Sequence
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.environment.laying import LIFT
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import MATING_TIME, change_links, sort_links
from symbrion_gym._src.swarm.dynamic.assembly import Assembler, Assembly, Layout, Tree, find_layout
from symbrion_gym._src.swarm.dynamic.transfer import (
    Mating,
    Motion,
    compute_error,
    compute_share,
    copy_tree,
    has_mated,
    read_motion,
    refresh,
    write_motion,
    write_weld,
)
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.senses import Sight
from symbrion_gym._src.swarm.world import DECISION, FOLDED, FRONT, SwarmCommands, SwarmState, find_docked

TICK = 0.02  # Time between two changes of the servos' targets, as of organisms [s]
_STEPS = 4  # Physics steps in a tick
_AT_REST = 0.02  # An arm that turns more slowly than this is folded for good [rad/s]
_LARGEST_JUMP = 5e-5  # What a change of the model may move a robot at most [m]
_FOLDED_TOLERANCE = 1e-3  # Arms this near to their folded angle count as folded [rad]


class DynamicWorld:
    """N Scouts in full contact; latched ones mate, then move as the very tree of an `Organism` (a `SwarmWorld`).

    A latched pair is held by a weld, which pulls it to its exact pose in `MATING_TIME`. Then the model is compiled
    again with both in one tree, and the state is carried over; a release is the reverse. In an organism, arms whose
    front dock is free fold up, whatever they are told, and are then part of the chassis, as in every `Organism`; only
    where such a dock is told to latch, its arm does as it is told.
    """

    assembly: Assembly  # the compiled model and where the robots are in it; a new one for each layout
    data: mujoco.MjData  # its state, likewise

    def __init__(self, arena: Arena, num_robots: int) -> None:
        self.arena, self.num_robots = arena, num_robots
        self.scout = ScoutConfig(friction=arena.friction)
        self.assembler = Assembler(arena, self.scout)

    @cached_property
    def _ground(self) -> KinematicWorld:
        return KinematicWorld(self.arena, self.num_robots)

    @property
    def sight(self) -> Sight:
        """Rays in the arena."""
        return self._ground.sight

    def find_standing(self, poses: Float[np.ndarray, "M 3"]) -> Bool[np.ndarray, " M"]:
        """Return at which of any number of poses (x, y, heading) a robot can stand."""
        return self._ground.find_standing(poses)

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Place the robots on the ground, undocked, with level arms, at x [m], y [m] and heading [rad].

        They stand as kinematic robots do, a little above the ground. Nothing is random: the seed is ignored.
        """
        self._ground.reset(poses)
        state, still = self._ground.state, np.zeros((self.num_robots, 3))
        position = state.position + LIFT * state.rotation[:, :, 2]
        self.begin(Motion(position, state.rotation, still, still, state.hinge, still[:, 0]))

    def begin(self, motion: Motion, links: tuple[Docking, ...] = (), time: float = 0.0) -> None:
        """Begin with robots in any motion, docked in their exact poses or not, at a time since the reset [s]."""
        self.time = time
        self._links = sort_links(links)
        self.matings: dict[Docking, Mating] = {}  # latched docks on their way to the exact pose
        self.target = np.array(motion.hinge, dtype=np.float64)  # of the hinges' servos [rad]
        self._odometry = np.zeros((self.num_robots, 2))
        open_arms = self._find_open(motion, np.zeros(self.num_robots, bool))
        self._enter(self._find_layout(open_arms), motion, frozenset())
        self.state = self._read_state()

    def step(self, commands: SwarmCommands, duration: float = DECISION) -> None:
        """Advance by one decision, which takes a whole number of ticks [s]."""
        commands.check(self.num_robots)
        ticks = round(duration / TICK)
        if ticks < 1 or abs(ticks * TICK - duration) > 1e-9:
            raise OptionError(f"duration is {duration} s; a whole number of ticks of {TICK} s is needed")
        self._change_links(commands.latch)
        self._change_layout(commands.latch)
        geoms = self.assembly.track_geoms
        rate = np.repeat(commands.tracks / self.scout.track_radius, geoms.shape[1] // 2, axis=1)
        self.assembly.model.geom_surfacevel[geoms, 4] = rate
        for _ in range(ticks):
            self._write_servos(commands.hinge)
            for index, link in enumerate(self.assembly.layout.welds):
                mating = self.matings[link]
                write_weld(self.assembly, self.data, index, mating, compute_share(self.time - mating.began))
            mujoco.mj_step(self.assembly.model, self.data, nstep=_STEPS)
            self.time += TICK
        self._odometry = self._odometry + commands.tracks * duration
        self.state = self._read_state()

    def compute_touches(self) -> Float[np.ndarray, " N"]:
        """Return the sum of the normal forces on each robot in the last physics step [N]."""
        contacts, touches = self.data.contact, np.zeros(self.num_robots)
        owners, is_active = self.assembly.owners[contacts.geom], contacts.efc_address >= 0
        for side in range(2):
            chosen = is_active & (owners[:, side] >= 0)
            np.add.at(touches, owners[chosen, side], self.data.efc_force[contacts.efc_address[chosen]])
        return touches

    def _change_links(self, latch: Bool[np.ndarray, "N 4"]) -> None:
        """Open what is released, latch what matches."""
        gone, new = change_links(self.state, latch)
        for link in new:
            self.matings[link] = Mating(*compute_error(self.assembly, self.data, link), self.time)
        self.matings = {link: each for link, each in self.matings.items() if link not in gone}
        self._links = sort_links([*(link for link in self._links if link not in gone), *new])

    def _change_layout(self, latch: Bool[np.ndarray, "N 4"]) -> None:
        """Compile the model again where robots have become one tree, or several.

        Docks that have mated wait as welds if a tree would move the robots by more than `_LARGEST_JUMP`.
        """
        before = read_motion(self.assembly, self.data)
        open_arms = self._find_open(before, latch[:, FRONT])
        assembly, data, matings = self.assembly, self.data, self.matings
        mated = {link for link in matings if self._is_mated(link)}
        for joined in (mated, set()):
            self.matings = {link: each for link, each in matings.items() if link not in joined}
            layout = self._find_layout(open_arms)
            if layout == assembly.layout:
                return
            self._enter(layout, before, frozenset(layout.trees) & frozenset(assembly.layout.trees))
            jump = read_motion(self.assembly, self.data).position - before.position
            if np.linalg.norm(jump, axis=1).max() <= _LARGEST_JUMP or not joined:
                return
            self.assembly, self.data = assembly, data

    def _find_layout(self, open_arms: frozenset[int]) -> Layout:
        return find_layout(self._links, tuple(self.matings), open_arms, self.num_robots, self.scout)

    def _find_open(self, motion: Motion, latch: Bool[np.ndarray, " N"]) -> frozenset[int]:
        """Return which docked robots have a movable arm with a free front dock, and let the others fold theirs.

        Their arms are those whose docks are told to latch, and those that are not folded yet.
        """
        docked = find_docked(self._links, self.num_robots)
        is_open = docked.any(axis=1) & ~docked[:, FRONT]
        self._is_folding = is_open & ~latch
        is_folded = np.abs(motion.hinge - FOLDED) <= _FOLDED_TOLERANCE
        is_folded &= np.abs(motion.hinge_rate) <= _AT_REST
        return frozenset(np.flatnonzero(is_open & (latch | ~is_folded)).tolist())

    def _is_mated(self, link: Docking) -> bool:
        is_over = self.time - self.matings[link].began >= MATING_TIME
        return is_over and has_mated(self.assembly, self.data, link)

    def _enter(self, layout: Layout, motion: Motion, same: frozenset[Tree]) -> None:
        """Continue in a layout, of which some trees are in the present one as well."""
        assembly = self.assembler.assemble(layout)
        data = mujoco.MjData(assembly.model)
        for tree in same:
            copy_tree(tree, self.assembly, self.data, assembly, data)
        write_motion(assembly, data, motion, same)
        data.time = self.time
        self.assembly, self.data = assembly, data

    def _write_servos(self, hinge: Float[np.ndarray, " N"]) -> None:
        """Move the servos' targets at their speed; free arms of docked robots fold up."""
        wanted = np.clip(hinge, -self.scout.hinge_range, self.scout.hinge_range)
        wanted = np.where(self._is_folding, FOLDED, wanted)
        turn = self.scout.hinge_speed * TICK
        self.target = self.target + np.clip(wanted - self.target, -turn, turn)
        is_free = self.assembly.hinge_servo >= 0
        self.target[~is_free] = FOLDED
        self.data.ctrl[self.assembly.hinge_servo[is_free]] = self.target[is_free]

    def _read_state(self) -> SwarmState:
        refresh(self.assembly, self.data)
        motion = read_motion(self.assembly, self.data)
        return SwarmState(*motion[:3], motion.hinge, self._links, self._odometry.copy())


def is_organism(world: DynamicWorld, modules: Sequence[int]) -> bool:
    """Return whether robots are the very tree of an `Organism`: all docks have mated and free arms are folded."""
    trees = world.assembly.layout.trees
    return any(tree.is_organism and set(tree.robots) == set(modules) for tree in trees)


def read_organism(world: DynamicWorld, modules: Sequence[int]) -> dict[str, np.ndarray]:
    """Return parts of the observation of an organism, without noise, as its environment has them."""
    modules = list(modules)
    if not is_organism(world, modules):
        trees = [each.robots for each in world.assembly.layout.trees if each.is_organism]
        raise OptionError(
            f"robots {modules} are not one organism yet; there are {trees}: step until they are"
        )
    hinged = [robot for robot in modules if world.assembly.hinge_qpos[robot] >= 0]
    rotation = world.state.rotation[modules]
    return {
        "hinge_angle": world.state.hinge[hinged],
        "pitch": np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0)),
        "roll": np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
        "contact": np.minimum(world.compute_touches()[modules], world.scout.contact_range),
    }
