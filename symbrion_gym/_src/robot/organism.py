"""Organisms, which are docked modules: plain data, its rules, its MuJoCo model and that model's sensors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction._src.geometry.pose import PlanarPose
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig

if TYPE_CHECKING:
    import mujoco

Part = tuple[str, int]  # ("chassis" or "arm", module)
RigidGroup = frozenset[Part]  # Parts that move as one body
_ROUNDING = 1e-6  # Distances that differ by less are the same [m]


@dataclass(frozen=True)
class Docking:
    """Two docks joined: one module's connector, "front" on the hinged arm, and a socket of another."""

    first: int  # index of a module
    first_side: str  # its dock: "front", or a socket, "back", "left" or "right"
    second: int  # index of the other module
    second_side: str  # its dock

    @property
    def ends(self) -> tuple[tuple[int, str], tuple[int, str]]:
        """(module, side) of both."""
        return (self.first, self.first_side), (self.second, self.second_side)


@dataclass(frozen=True)
class Organism:
    """A tree of modules, in which each docking joins an arm with a socket: so one arm of all is free.

    The joints of a module work where its front dock is used; a free arm is folded up, out of the way.

    Attributes:
        num_modules: number of modules.
        dockings: the joined docks, one fewer than modules; four values such as (1, "front", 0, "back") are a docking.
        scout: constants of the modules.

    Raises:
        OrganismError: the dockings are no tree, two sockets or two arms meet, or modules overlap.
    """

    num_modules: int
    dockings: tuple[Docking, ...] = ()
    scout: ScoutConfig = field(default_factory=ScoutConfig)

    def __post_init__(self) -> None:
        if isinstance(self.num_modules, bool) or not isinstance(self.num_modules, int | np.integer):
            raise OrganismError(f"the number of modules must be a whole number, got {self.num_modules!r}")
        if self.num_modules < 1:
            raise OrganismError(f"an organism needs at least 1 module, got {self.num_modules}")
        object.__setattr__(self, "dockings", _read_dockings(self.dockings))
        _check_dockings(self)
        _check_overlap(self)

    @property
    def hinges(self) -> tuple[int, ...]:
        """Modules whose hinge works, in order."""
        ends = (end for docking in self.dockings for end in docking.ends)
        return tuple(sorted({module for module, side in ends if side == "front"}))

    @property
    def servos(self) -> tuple[str, ...]:
        """Names of the joints and their actuators: hinges, then rotations of arms where modules have two."""
        kinds = ("hinge", "twist")[: self.scout.dofs]
        return tuple(f"{kind}_{module}" for kind in kinds for module in self.hinges)

    @property
    def free_sides(self) -> list[tuple[int, str]]:
        """(module, side) of every side with nothing docked to it: its infrared units see the world."""
        used = {end for docking in self.dockings for end in docking.ends}
        return [(i, side) for i in range(self.num_modules) for side in SIDES if (i, side) not in used]

    @property
    def parents(self) -> tuple[int, ...]:
        """The neighbor of each module on the way to module 0; -1 for module 0."""
        return self._tree[0]

    @property
    def order(self) -> tuple[int, ...]:
        """Modules in an order in which each comes after its parent: depth first, as docked."""
        return self._tree[1]

    @property
    def _tree(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Parents and order."""
        neighbors: list[list[int]] = [[] for _ in range(self.num_modules)]
        for docking in self.dockings:
            neighbors[docking.first].append(docking.second)
            neighbors[docking.second].append(docking.first)
        parents, order, waiting = [-1] * self.num_modules, [], [0]
        while waiting:
            module = waiting.pop()
            order.append(module)
            children = [other for other in neighbors[module] if other != parents[module]]
            for child in reversed(children):
                parents[child] = module
                waiting.append(child)
        return tuple(parents), tuple(order)

    def compute_poses(self) -> list[PlanarPose]:
        """Return where each module lies when all hinges are straight, in the frame of module 0."""
        poses: dict[int, PlanarPose] = {0: PlanarPose()}
        while len(poses) < self.num_modules:
            before = len(poses)
            for docking in self.dockings:
                for (one, side), (other, other_side) in (docking.ends, docking.ends[::-1]):
                    if one in poses and other not in poses:
                        poses[other] = poses[one].compose(_find_neighbor(side, other_side, self.scout))
            if len(poses) == before:
                lost = sorted(set(range(self.num_modules)) - set(poses))
                raise OrganismError(f"modules {lost} are docked to nothing; add a docking to the rest")
        return [poses[i] for i in range(self.num_modules)]

    def spec(self) -> mujoco.MjSpec:
        """Return a new spec: one body per rigid part, `root` a free joint, a servo per working hinge.

        Site `module_i` marks the center of module i, joint and actuator `hinge_i` its hinge; with two rotational
        degrees of freedom also `twist_i`.
        """
        import mujoco

        spec = mujoco.MjSpec()
        spec.modelname = f"organism of {self.num_modules}"
        spec.compiler.degree = False
        self.add_to(spec, spec.worldbody)
        return spec

    def add_to(self, spec: mujoco.MjSpec, parent: mujoco.MjsBody) -> mujoco.MjsBody:
        """Add the organism to a model under construction and return its root."""
        poses = self.compute_poses()
        groups = _find_rigid_groups(self)
        root = parent.add_body(name=_name_group(groups[("chassis", 0)]))
        root.add_freejoint(name="root")
        self._fill(spec, root, ("chassis", 0), poses, groups, set())
        return root

    def _fill(
        self,
        spec: mujoco.MjSpec,
        body: mujoco.MjsBody,
        part: Part,
        poses: list[PlanarPose],
        groups: dict[Part, RigidGroup],
        done: set[RigidGroup],
    ) -> None:
        """Add every part of one rigid group to its body, then the groups that hang from it."""
        from symbrion_gym._src.robot.scout import add_arm, add_chassis, add_joints  # loads MuJoCo

        group = groups[part]
        origin = poses[min(group, key=_sort_key)[1]]
        done.add(group)
        for kind, module in sorted(group, key=_sort_key):
            pose = origin.invert().compose(poses[module])
            if kind == "chassis":
                add_chassis(spec, body, f"module_{module}_", pose, self.scout)
            else:
                is_folded = module not in self.hinges
                add_arm(spec, body, f"module_{module}_", pose, self.scout, is_folded)
        for kind, module in sorted(group, key=_sort_key):
            other = ("arm" if kind == "chassis" else "chassis", module)
            if groups[other] in done:
                continue
            child_origin = poses[min(groups[other], key=_sort_key)[1]]
            place = origin.invert().compose(child_origin)
            child = body.add_body(name=_name_group(groups[other]), pos=place.position, quat=place.quaternion)
            hinge = child_origin.invert().compose(poses[module])
            add_joints(spec, child, module, hinge, self.scout, lifts=other[0] == "arm")
            self._fill(spec, child, other, poses, groups, done)


def snake(num_modules: int, scout: ScoutConfig | None = None) -> Organism:
    """Return modules in a row, all looking forward; module 0 is the head.

    Hinge i, of module i, lies between module i - 1 and module i, i from 1; positive lifts what is ahead.

    Raises:
        OrganismError: fewer than one module.
    """
    count = num_modules if isinstance(num_modules, int | np.integer) else 0
    return Organism(num_modules, tuple(_dock_row(count)), scout or ScoutConfig())


def cross(arm_length: int = 2, scout: ScoutConfig | None = None) -> Organism:
    """Return a row with an arm of `arm_length` modules on either side of its middle, which lies as far from both ends.

    Module 0 is the head of the row. Three arms look at the middle; the fourth holds it, as a module has three sockets.

    Raises:
        OrganismError: an arm shorter than one module.
    """
    if arm_length < 1:
        raise OrganismError(f"the arms of a cross need at least 1 module, got {arm_length}")
    dockings = _dock_row(1 + 4 * arm_length)
    for side, first in (("left", 1 + 2 * arm_length), ("right", 1 + 3 * arm_length)):
        dockings[first - 1] = Docking(first, "front", arm_length, side)
    return Organism(1 + 4 * arm_length, tuple(dockings), scout or ScoutConfig())


def letter_h(spine: int = 3, scout: ScoutConfig | None = None) -> Organism:
    """Return a spine of `spine` modules with a leg to either side at both ends."""
    if spine < 2:
        raise OrganismError(f"the spine of an H needs at least 2 modules, got {spine}")
    legs = [(0, "left"), (0, "right"), (spine - 1, "left"), (spine - 1, "right")]
    dockings = [Docking(spine + k, "front", module, side) for k, (module, side) in enumerate(legs)]
    return Organism(spine + 4, (*_dock_row(spine), *dockings), scout or ScoutConfig())


def _dock_row(count: int) -> list[Docking]:
    """Return the dockings of modules in a row, module i to the back of module i - 1."""
    return [Docking(i, "front", i - 1, "back") for i in range(1, count)]


def _find_neighbor(side: str, other_side: str, scout: ScoutConfig) -> PlanarPose:
    """Return the pose of the module whose dock `other_side` meets this one's `side`."""
    dock = PlanarPose(*scout.compute_dock(side)).compose(PlanarPose(scout.dock_gap, 0.0, pi))
    return dock.compose(PlanarPose(*scout.compute_dock(other_side)).invert())


def _read_dockings(given: Iterable[Docking | Iterable[Any]]) -> tuple[Docking, ...]:
    try:
        return tuple(each if isinstance(each, Docking) else Docking(*each) for each in given)
    except TypeError:
        what = "dockings such as (1, 'front', 0, 'back') are needed"
        raise OrganismError(f"dockings are {given!r}; a sequence of {what}") from None


def _check_dockings(organism: Organism) -> None:
    count = organism.num_modules
    if len(organism.dockings) != count - 1:
        need = f"{count} modules need {count - 1} dockings to be one tree"
        raise OrganismError(f"{need}, got {len(organism.dockings)}")
    used: set[tuple[int, str]] = set()
    for docking in organism.dockings:
        for module, side in docking.ends:
            organism.scout.compute_dock(side)
            if not isinstance(module, int | np.integer) or not 0 <= module < count:
                raise OrganismError(f"no module {module!r}; there are 0 to {count - 1}")
            if (module, side) in used:
                raise OrganismError(f"dock {side!r} of module {module} is used twice; take another side")
            used.add((module, side))
        if docking.first == docking.second:
            raise OrganismError(f"module {docking.first} cannot dock to itself")
        if (docking.first_side == "front") == (docking.second_side == "front"):
            raise OrganismError(
                f"dock {docking.first_side!r} of module {docking.first} cannot hold {docking.second_side!r} of module "
                f"{docking.second}; join the arm of one (front) with a socket of the other (back, left, right)"
            )


def _check_overlap(organism: Organism) -> None:
    poses = organism.compute_poses()
    places = np.array([(pose.x, pose.y) for pose in poses])
    distance = np.abs(places[:, None] - places[None]).max(axis=-1)
    close = np.argwhere(np.triu(distance < organism.scout.size[0] - _ROUNDING, k=1))
    if len(close):
        first, second = close[0]
        raise OrganismError(f"modules {first} and {second} overlap with straight hinges; dock one elsewhere")


def _find_rigid_groups(organism: Organism) -> dict[Part, RigidGroup]:
    """Return for each part all parts that move with it."""
    from scipy.cluster.hierarchy import DisjointSet

    groups = DisjointSet([(kind, i) for i in range(organism.num_modules) for kind in ("chassis", "arm")])
    for i in set(range(organism.num_modules)) - set(organism.hinges):
        groups.merge(("chassis", i), ("arm", i))
    for docking in organism.dockings:
        groups.merge(*(("arm" if side == "front" else "chassis", module) for module, side in docking.ends))
    return {part: frozenset(groups.subset(part)) for part in groups}


def _sort_key(part: Part) -> tuple[bool, int]:
    return part[0] != "chassis", part[1]


def _name_group(group: RigidGroup) -> str:
    kind, module = min(group, key=_sort_key)
    return f"{kind}_{module}"


MEASURED = ("acceleration", "ir", "contact", "dock_force", "laser")
"""Parts of the observation that MuJoCo's own sensors measure."""


def add_sensors(spec: mujoco.MjSpec, organism: Organism, parts: tuple[str, ...], interval: float) -> None:
    """Add MuJoCo's sensors for the wanted parts of the observation, part by part in their order.

    Each stands at a site of its name and clips at its largest reading. Rays measure a distance along the z axis of
    their site [m], -1 where nothing is hit, every `interval`.
    """
    import mujoco

    modules, scout, kinds = range(organism.num_modules), organism.scout, mujoco.mjtSensor
    ray = {"type": kinds.mjSENS_RANGEFINDER, "nsample": 1, "interval": [interval, 0.0], "intprm": [1, 0, 0]}
    sites = {
        "acceleration": [f"module_{i}_accel_{place}" for i in modules for place in ("front", "rear")],
        "ir": [f"module_{i}_ir_{side}_{k}" for i, side in organism.free_sides for k in range(2)],
        "contact": [f"module_{i}_touch" for i in modules],
        "dock_force": [f"module_{i}" for i in organism.hinges],
        "laser": [f"module_0_laser_{k}" for k in range(scout.laser_beams)],
    }
    options = {
        "acceleration": {"type": kinds.mjSENS_ACCELEROMETER, "cutoff": scout.acceleration_range},
        "ir": ray,
        "contact": {"type": kinds.mjSENS_TOUCH, "cutoff": scout.contact_range},
        "dock_force": {"type": kinds.mjSENS_FORCE},
        "laser": ray,
    }
    for part in parts:
        for site in sites.get(part, ()):
            name = site.replace("module", part) if part == "dock_force" else site
            spec.add_sensor(name=name, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site, **options[part])
