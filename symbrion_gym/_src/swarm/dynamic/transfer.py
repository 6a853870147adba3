"""The state of robots apart from any model: read from one layout, written into another.

Poses are kept. Where welded robots become one tree, what little the weld had given is spread over the modules, and the
velocities become those of the tree that keep momentum: M v = Jᵀ p, the plastic impact, which never adds kinetic energy.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.dynamic.assembly import Assembly
from symbrion_gym._src.swarm.dynamic.layout import Tree
from symbrion_gym._src.swarm.dynamic.motion import FOLDED, Motion, find_part_motions

_LEVER = 0.05
"""Distance of the points that stand for the orientation of a module in the fit of a tree [m]: its half size."""


def refresh(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute poses and velocities of bodies from qpos and qvel, which are a step ahead of them after `mj_step`."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)


def read_motion(assembly: Assembly, data: mujoco.MjData) -> Motion:
    """Return how the robots are and move; `data` is refreshed."""
    model = assembly.model
    position = data.site_xpos[assembly.sites].copy()
    rotation = data.site_xmat[assembly.sites].reshape(-1, 3, 3).copy()
    body = model.site_bodyid[assembly.sites]
    spin = data.cvel[body, :3].copy()
    center = data.subtree_com[model.body_rootid[body]]
    velocity = data.cvel[body, 3:] + np.cross(spin, position - center)
    is_free = assembly.hinge_qpos >= 0
    hinge = np.where(is_free, data.qpos[assembly.hinge_qpos], FOLDED)
    rate = np.where(is_free, data.qvel[assembly.hinge_dof], 0.0)
    return Motion(position, rotation, velocity, spin, hinge, rate)


def write_motion(
    assembly: Assembly,
    data: mujoco.MjData,
    motion: Motion,
    scout: ScoutConfig,
    skip: frozenset[Tree] = frozenset(),
) -> None:
    """Set the robots of an assembly in motion as given; `data` is refreshed afterwards."""
    trees = [tree for tree in assembly.layout.trees if tree not in skip]
    for tree in trees:
        _write_tree(assembly, data, motion, tree)
    joined = [tree for tree in trees if tree.organism is not None]
    refresh(assembly.model, data)
    for tree in joined:
        _fit_root(assembly, data, motion, tree)
    refresh(assembly.model, data)
    if joined:
        _project_velocities(assembly, data, motion, scout, joined)
        refresh(assembly.model, data)


def copy_tree(
    tree: Tree, source: Assembly, data: mujoco.MjData, target: Assembly, target_data: mujoco.MjData
) -> None:
    """Copy the state of a tree that is in both layouts, bit by bit."""
    (qpos, dof), (new_qpos, new_dof) = source.find_spans(tree), target.find_spans(tree)
    target_data.qpos[new_qpos], target_data.qvel[new_dof] = data.qpos[qpos], data.qvel[dof]
    target_data.qacc_warmstart[new_dof] = data.qacc_warmstart[dof]


def _write_tree(assembly: Assembly, data: mujoco.MjData, motion: Motion, tree: Tree) -> None:
    """Write root and hinges as those of module 0 and of the hinges are."""
    qpos, dof = assembly.find_root(tree)
    robot = tree.robots[0]
    data.qpos[qpos : qpos + 3] = motion.position[robot]
    mujoco.mju_mat2Quat(data.qpos[qpos + 3 : qpos + 7], motion.rotation[robot].ravel())
    data.qvel[dof : dof + 3] = motion.velocity[robot]
    data.qvel[dof + 3 : dof + 6] = motion.rotation[robot].T @ motion.spin[robot]
    for each in tree.robots:
        if assembly.hinge_qpos[each] >= 0:
            data.qpos[assembly.hinge_qpos[each]] = motion.hinge[each]
            data.qvel[assembly.hinge_dof[each]] = motion.hinge_rate[each]


def _fit_root(assembly: Assembly, data: mujoco.MjData, motion: Motion, tree: Tree) -> None:
    """Move a tree as a whole so that its modules come nearest to where they were (Kabsch)."""
    robots = list(tree.robots)
    sites = assembly.sites[robots]
    now = _find_points(data.site_xpos[sites], data.site_xmat[sites].reshape(-1, 3, 3))
    wanted = _find_points(motion.position[robots], motion.rotation[robots])
    middle, wanted_middle = now.mean(axis=0), wanted.mean(axis=0)
    u, _, vt = np.linalg.svd((wanted - wanted_middle).T @ (now - middle))
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    qpos, _ = assembly.find_root(tree)
    root = np.empty(9)
    mujoco.mju_quat2Mat(root, data.qpos[qpos + 3 : qpos + 7])
    data.qpos[qpos : qpos + 3] = turn @ (data.qpos[qpos : qpos + 3] - middle) + wanted_middle
    mujoco.mju_mat2Quat(data.qpos[qpos + 3 : qpos + 7], (turn @ root.reshape(3, 3)).ravel())


def _find_points(
    position: Float[np.ndarray, "n 3"], rotation: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "P 3"]:
    tips = position[:, None] + _LEVER * np.swapaxes(rotation, 1, 2)
    return np.concatenate([position[:, None], tips], axis=1).reshape(-1, 3)


def _project_velocities(
    assembly: Assembly, data: mujoco.MjData, motion: Motion, scout: ScoutConfig, trees: list[Tree]
) -> None:
    """Give trees the velocities that keep the momentum of their parts."""
    model = assembly.model
    mujoco.mj_makeM(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    momentum = np.zeros(model.nv)
    moving = np.concatenate([np.arange(model.nv)[assembly.find_spans(tree)[1]] for tree in trees])
    bodies = (model.site_bodyid[assembly.sites], assembly.arms)
    jacobian, turning = np.zeros((2, 3, model.nv))
    robots = [robot for tree in trees for robot in tree.robots]
    for part, carriers in zip(find_part_motions(motion, scout), bodies, strict=True):
        for robot in robots:
            place = part.center[robot] + data.site_xpos[assembly.sites[robot]] - motion.position[robot]
            mujoco.mj_jac(model, data, jacobian, turning, place, int(carriers[robot]))
            push = part.mass * part.velocity[robot]
            momentum += jacobian.T @ push + turning.T @ (part.inertia[robot] @ part.spin[robot])
    hinged = [robot for robot in robots if assembly.hinge_dof[robot] >= 0]
    momentum[assembly.hinge_dof[hinged]] += scout.hinge_armature * motion.hinge_rate[hinged]
    data.qvel[moving] = np.linalg.solve(inertia[np.ix_(moving, moving)], momentum[moving])
