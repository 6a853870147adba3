"""The compiled model of an arena with robots in a layout, and where each robot is in it."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.scout import make_scout
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.robot.tracks import find_driven_wheels
from symbrion_gym._src.swarm.dynamic.layout import Layout, Tree

_WELD_SOLREF = (0.01, 1.0)
"""Time constant [s] and damping ratio of welds: twice the physics step, the stiffest that stays stable."""
_WELD_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""The stiffest that MuJoCo has: welds yield to a force by 0.01 % of what a free body would."""
_FRICTION_STIFFNESS = 10.0
"""Of friction against that of contacts, as for organisms with elliptic cones."""
_KEPT = 64
"""Models that are kept for a layout that comes back."""


@dataclass(frozen=True)
class Assembly:
    """A compiled layout; every array has one entry for each robot.

    Attributes:
        layout: how it holds the robots.
        model: compiled; track speeds and poses of welds are written into it.
        sites: ids of the sites that mark the modules' centers.
        arms: ids of the bodies that carry the arms.
        docks: ids of the sites of the docks, in the order of `SIDES`.
        hinge_qpos: addresses of the hinges in qpos; -1 where the arm is folded up for good.
        hinge_dof: their addresses in qvel.
        hinge_servo: ids of their actuators.
        track_geoms: ids of the geoms that drive, left before right.
        owners: for each geom the robot that it belongs to; -1 for those of the arena.
    """

    layout: Layout
    model: mujoco.MjModel
    sites: Int[np.ndarray, " N"]
    arms: Int[np.ndarray, " N"]
    docks: Int[np.ndarray, "N 4"]
    hinge_qpos: Int[np.ndarray, " N"]
    hinge_dof: Int[np.ndarray, " N"]
    hinge_servo: Int[np.ndarray, " N"]
    track_geoms: Int[np.ndarray, "N T"]
    owners: Int[np.ndarray, " G"]

    def find_root(self, tree: Tree) -> tuple[int, int]:
        """Return the addresses of a tree's free joint in qpos and qvel."""
        joint = self.model.joint(f"{tree.prefix}root")
        return int(joint.qposadr[0]), int(joint.dofadr[0])

    def find_spans(self, tree: Tree) -> tuple[slice, slice]:
        """Return where a tree lies in qpos and qvel."""
        qpos, dof = self.find_root(tree)
        root = self.model.dof_treeid[dof]
        count = int(np.count_nonzero(self.model.dof_treeid == root))
        return slice(qpos, qpos + count + 1), slice(dof, dof + count)


class Assembler:
    """Compiles layouts; the arena's meshes are prepared once.

    Args:
        arena: where the robots are.
        scout: constants of the robots.
        timestep: physics step [s].
    """

    def __init__(self, arena: Arena, scout: ScoutConfig, timestep: float) -> None:
        self._scout = scout
        self._base = arena.spec()
        _set_options(self._base, timestep)
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
        for tree in layout.trees:
            part = make_scout(self._scout) if tree.organism is None else tree.organism.spec()
            spec.attach(part, prefix=tree.prefix, frame=spec.worldbody.add_frame())
        names = _name_modules(layout)
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
        return _find_ids(layout, spec.compile(), names, self._scout)


def _set_options(spec: mujoco.MjSpec, timestep: float) -> None:
    option = spec.option
    option.timestep = timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, _FRICTION_STIFFNESS
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # 4.0.0 factors sparse matrices wrongly from nv 60 on
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def _name_modules(layout: Layout) -> list[str]:
    names = [""] * sum(len(tree.robots) for tree in layout.trees)
    for tree in layout.trees:
        for module, robot in enumerate(tree.robots):
            names[robot] = f"{tree.prefix}module_{module}"
    return names


def _find_ids(layout: Layout, model: mujoco.MjModel, names: list[str], scout: ScoutConfig) -> Assembly:
    hinges = [name.replace("module_", "hinge_") for name in names]
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in hinges]
    wheels = range(len(find_driven_wheels(scout)))
    docks = np.array([[model.site(f"{name}_dock_{side}").id for side in SIDES] for name in names])
    return Assembly(
        layout,
        model,
        np.array([model.site(name).id for name in names]),
        model.site_bodyid[docks[:, SIDES.index("front")]].copy(),
        docks,
        np.array([-1 if joint < 0 else model.jnt_qposadr[joint] for joint in joints]),
        np.array([-1 if joint < 0 else model.jnt_dofadr[joint] for joint in joints]),
        np.array([mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) for name in hinges]),
        np.array([[model.geom(f"{name}_track_{k}").id for k in wheels] for name in names]),
        _find_owners(model, names),
    )


def _find_owners(model: mujoco.MjModel, names: list[str]) -> Int[np.ndarray, " G"]:
    owners = np.full(model.ngeom, -1)
    for geom in range(model.ngeom):
        for robot, name in enumerate(names):
            if model.geom(geom).name.startswith(f"{name}_"):
                owners[geom] = robot
    return owners
