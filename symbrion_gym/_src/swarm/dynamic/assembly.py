"""The compiled model of an arena with robots in a layout, and where each robot is in it."""

from collections import OrderedDict
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Docking, Organism
from symbrion_gym._src.robot.scout import find_road_wheels, make_scout, set_physics
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import SCOUT, find_groups, make_organism, sort_links
from symbrion_gym._src.swarm.world import FRONT

TIMESTEP = 0.005  # Physics step [s]
_WELD_SOLREF = (0.01, 1.0)
"""Time constant [s] and damping ratio of welds: twice the physics step, the stiffest that stays stable."""
_WELD_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""The stiffest that MuJoCo has: welds yield to a force by 0.01 % of what a free body would."""
_KEPT = 64  # Models that are kept for a layout that comes back


@dataclass(frozen=True)
class OpenOrganism(Organism):
    """An organism in which some arms move although nothing of it is docked to them."""

    open_arms: tuple[int, ...] = ()  # modules with such an arm

    @property
    def hinges(self) -> tuple[int, ...]:
        """Modules whose hinge works, in order."""
        return tuple(sorted({*super().hinges, *self.open_arms}))


class Tree(NamedTuple):
    """Robots that are one tree of bodies in the model."""

    robots: tuple[int, ...]  # which robot is which module
    organism: Organism | None  # what they form; None for a lone Scout, whose arm is free

    @property
    def is_organism(self) -> bool:
        """Whether it is the very tree of an `Organism`: docked robots whose free arms are folded."""
        return self.organism is not None and not isinstance(self.organism, OpenOrganism)

    @property
    def prefix(self) -> str:
        """What the names of its parts begin with."""
        return f"robot_{self.robots[0]}_"


class Layout(NamedTuple):
    """How a model holds the robots; hashable."""

    trees: tuple[Tree, ...]  # every robot is in one of them
    welds: tuple[Docking, ...]  # latched docks between different trees


@lru_cache(maxsize=256)
def find_layout(
    links: tuple[Docking, ...],
    welds: tuple[Docking, ...],
    open_arms: frozenset[int],
    num_robots: int,
    scout: ScoutConfig,
) -> Layout:
    """Return the layout in which all links but the welded ones are parts of trees."""
    welds = sort_links(welds)
    rigid = [link for link in links if link not in welds]
    groups = find_groups(rigid, num_robots)
    moving = set(open_arms) | {robot for link in welds for robot, side in link.ends if side == "front"}
    trees = []
    for first in np.unique(groups):
        members = np.flatnonzero(groups == first).tolist()
        if len(members) == 1:
            trees.append(Tree((members[0],), None))
            continue
        inside = [link for link in rigid if link.first in members]
        organism, order = make_organism(inside, members, scout)
        arms = tuple(module for module, robot in enumerate(order) if robot in moving)
        if arms:
            organism = OpenOrganism(organism.num_modules, organism.dockings, scout, arms)
        trees.append(Tree(order, organism))
    return Layout(tuple(trees), welds)


@dataclass(frozen=True)
class Assembly:
    """A compiled layout; every array has one entry for each robot."""

    layout: Layout  # how it holds the robots
    model: mujoco.MjModel  # compiled; track speeds and poses of welds are written into it
    sites: Int[np.ndarray, " N"]  # ids of the sites that mark the modules' centers
    bodies: Int[np.ndarray, "N 2"]  # ids of the bodies that carry chassis and arm
    docks: Int[np.ndarray, "N 4"]  # ids of the sites of the docks, in the order of `SIDES`
    hinge_qpos: Int[np.ndarray, " N"]  # addresses of the hinges in qpos; -1 where the arm stays folded up
    hinge_dof: Int[np.ndarray, " N"]  # their addresses in qvel
    hinge_servo: Int[np.ndarray, " N"]  # ids of their actuators
    track_geoms: Int[np.ndarray, "N T"]  # ids of the geoms that drive, left before right
    owners: Int[np.ndarray, " G"]  # for each geom the robot that it belongs to; -1 for those of the arena

    def find_root(self, tree: Tree) -> tuple[int, int]:
        """Return the addresses of a tree's free joint in qpos and qvel."""
        joint = self.model.joint(f"{tree.prefix}root")
        return int(joint.qposadr[0]), int(joint.dofadr[0])

    def find_spans(self, tree: Tree) -> tuple[slice, slice]:
        """Return where a tree lies in qpos and qvel."""
        qpos, dof = self.find_root(tree)
        count = int(np.count_nonzero(self.model.dof_treeid == self.model.dof_treeid[dof]))
        return slice(qpos, qpos + count + 1), slice(dof, dof + count)


class Assembler:
    """Compiles layouts of Scouts in an arena, whose meshes are prepared once."""

    def __init__(self, arena: Arena, scout: ScoutConfig) -> None:
        self._scout, self._base = scout, arena.spec()
        set_physics(self._base.option, TIMESTEP)
        self._base.compile()
        self._made: OrderedDict[Layout, Assembly] = OrderedDict()

    def assemble(self, layout: Layout) -> Assembly:
        """Return the compiled layout."""
        if layout not in self._made:
            self._made[layout] = self._compile(layout)
        self._made.move_to_end(layout)
        while len(self._made) > _KEPT:
            self._made.popitem(last=False)
        return self._made[layout]

    def _compile(self, layout: Layout) -> Assembly:
        spec = self._base.copy()
        names = [""] * sum(len(tree.robots) for tree in layout.trees)
        for tree in layout.trees:
            part = make_scout(self._scout) if tree.organism is None else tree.organism.spec()
            spec.attach(part, prefix=tree.prefix, frame=spec.worldbody.add_frame())
            for module, robot in enumerate(tree.robots):
                names[robot] = f"{tree.prefix}module_{module}"
        for k, weld in enumerate(layout.welds):
            bodies = [spec.site(f"{names[robot]}_dock_{side}").parent.name for robot, side in weld.ends]
            spec.add_equality(
                name=f"weld_{k}",
                type=mujoco.mjtEq.mjEQ_WELD,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1=bodies[0],
                name2=bodies[1],
                active=False,
                solref=_WELD_SOLREF,
                solimp=_WELD_SOLIMP,
            )
        return _find_ids(layout, spec.compile(), names)


def _find_ids(layout: Layout, model: mujoco.MjModel, names: list[str]) -> Assembly:
    hinges = [name.replace("module_", "hinge_") for name in names]
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in hinges]
    wheels = range(len(find_road_wheels(SCOUT)))
    sites = np.array([model.site(name).id for name in names])
    docks = np.array([[model.site(f"{name}_dock_{side}").id for side in SIDES] for name in names])
    owners = np.full(model.ngeom, -1)
    for geom in range(model.ngeom):
        for robot, name in enumerate(names):
            if model.geom(geom).name.startswith(f"{name}_"):
                owners[geom] = robot
    return Assembly(
        layout,
        model,
        sites,
        np.stack([model.site_bodyid[sites], model.site_bodyid[docks[:, FRONT]]], axis=1),
        docks,
        np.array([-1 if joint < 0 else model.jnt_qposadr[joint] for joint in joints]),
        np.array([-1 if joint < 0 else model.jnt_dofadr[joint] for joint in joints]),
        np.array([mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) for name in hinges]),
        np.array([[model.geom(f"{name}_track_{k}").id for k in wheels] for name in names]),
        owners,
    )
