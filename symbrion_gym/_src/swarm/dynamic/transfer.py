"""The state of robots apart from any model: read from one layout, written into another; and how latched docks mate.

Poses are kept. Where welded robots become one tree, what little the weld had given is spread over the modules, and the
velocities become those of the tree that keep momentum: M v = Jᵀ p, the plastic impact, which never adds kinetic energy.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout import make_scout
from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.docks import MATING_TIME, SCOUT
from symbrion_gym._src.swarm.dynamic.assembly import Assembly, Tree
from symbrion_gym._src.swarm.world import FOLDED

EXACT = 4e-5  # Docks this near to their exact pose have mated [m]
EXACT_ANGLE = 6e-4
"""Likewise [rad], a little more than hinges leave that hold against a weld: over the length of eight modules this is
0.6 mm, which the fit of a tree halves."""
_LEVER = 0.05
"""Distance of the points that stand for the orientation of a module in the fit of a tree [m]: its half size."""
_HALF_TURN = Rotation.from_rotvec([0.0, 0.0, np.pi])


class Motion(NamedTuple):
    """Poses and velocities of N robots in the arena."""

    position: Float[np.ndarray, "N 3"]  # centers of the chassis [m]
    rotation: Float[np.ndarray, "N 3 3"]  # from the frames of the chassis to the arena
    velocity: Float[np.ndarray, "N 3"]  # of the centers [m/s]
    spin: Float[np.ndarray, "N 3"]  # rates of rotation in the arena [rad/s]
    hinge: Float[np.ndarray, " N"]  # angles of the hinges [rad]
    hinge_rate: Float[np.ndarray, " N"]  # [rad/s]


def refresh(assembly: Assembly, data: mujoco.MjData) -> None:
    """Compute poses and velocities of bodies from qpos and qvel, which are a step ahead of them after `mj_step`."""
    mujoco.mj_kinematics(assembly.model, data)
    mujoco.mj_comPos(assembly.model, data)
    mujoco.mj_comVel(assembly.model, data)


def read_motion(assembly: Assembly, data: mujoco.MjData) -> Motion:
    """Return how the robots are and move; `data` is refreshed."""
    position = data.site_xpos[assembly.sites].copy()
    rotation = data.site_xmat[assembly.sites].reshape(-1, 3, 3).copy()
    chassis = assembly.bodies[:, 0]
    spin = data.cvel[chassis, :3].copy()
    center = data.subtree_com[assembly.model.body_rootid[chassis]]
    velocity = data.cvel[chassis, 3:] + np.cross(spin, position - center)
    is_free = assembly.hinge_qpos >= 0
    hinge = np.where(is_free, data.qpos[assembly.hinge_qpos], FOLDED)
    rate = np.where(is_free, data.qvel[assembly.hinge_dof], 0.0)
    return Motion(position, rotation, velocity, spin, hinge, rate)


def write_motion(
    assembly: Assembly, data: mujoco.MjData, motion: Motion, skip: frozenset[Tree] = frozenset()
) -> None:
    """Set the robots of an assembly in motion as given; `data` is refreshed afterwards."""
    trees = [tree for tree in assembly.layout.trees if tree not in skip]
    for tree in trees:
        _write_tree(assembly, data, motion, tree)
    joined = [tree for tree in trees if tree.organism is not None]
    refresh(assembly, data)
    for tree in joined:
        _fit_root(assembly, data, motion, tree)
    refresh(assembly, data)
    if joined:
        _project_velocities(assembly, data, motion, joined)
        refresh(assembly, data)


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


def _project_velocities(assembly: Assembly, data: mujoco.MjData, motion: Motion, trees: list[Tree]) -> None:
    """Give trees the velocities that keep the momentum of their parts."""
    model = assembly.model
    mujoco.mj_makeM(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    momentum = np.zeros(model.nv)
    moving = np.concatenate([np.arange(model.nv)[assembly.find_spans(tree)[1]] for tree in trees])
    jacobian, turning = np.zeros((2, 3, model.nv))
    robots = [robot for tree in trees for robot in tree.robots]
    for body, robot, center, push, twist in _find_momenta(motion, robots):
        place = center + data.site_xpos[assembly.sites[robot]] - motion.position[robot]
        mujoco.mj_jac(model, data, jacobian, turning, place, int(assembly.bodies[robot, body]))
        momentum += jacobian.T @ push + turning.T @ twist
    hinged = [robot for robot in robots if assembly.hinge_dof[robot] >= 0]
    momentum[assembly.hinge_dof[hinged]] += SCOUT.hinge_armature * motion.hinge_rate[hinged]
    data.qvel[moving] = np.linalg.solve(inertia[np.ix_(moving, moving)], momentum[moving])


def _find_momenta(
    motion: Motion, robots: list[int]
) -> Iterator[tuple[int, int, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield part (chassis or arm), robot, center of mass [m], momentum and angular momentum about that center."""
    frames = motion.rotation
    lift = np.zeros((len(frames), 3, 3))
    cosine, sine = np.cos(motion.hinge), np.sin(motion.hinge)
    lift[:, 0, 0], lift[:, 0, 2], lift[:, 1, 1] = cosine, -sine, 1.0
    lift[:, 2, 0], lift[:, 2, 2] = sine, cosine
    arm_spin = motion.spin - frames[:, :, 1] * motion.hinge_rate[:, None]
    for body, (axes, spin) in enumerate(((frames, motion.spin), (frames @ lift, arm_spin))):
        mass, middle, inertia = _find_parts()[body]
        lever = axes @ middle
        push = mass * (motion.velocity + np.cross(spin, lever))
        for robot in robots:
            turned = axes[robot] @ inertia @ axes[robot].T
            yield body, robot, motion.position[robot] + lever[robot], push[robot], turned @ spin[robot]


@lru_cache
def _find_parts() -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return mass [kg], center of mass [m] and inertia [kg m²] of chassis and arm in their frames."""
    model = make_scout(SCOUT).compile()
    parts = []
    for name in ("scout", "arm"):
        body, axes = model.body(name), np.empty(9)
        mujoco.mju_quat2Mat(axes, body.iquat)
        axes = axes.reshape(3, 3)
        parts.append((float(body.mass[0]), body.ipos.copy(), axes @ np.diag(body.inertia) @ axes.T))
    return parts


class Mating(NamedTuple):
    """A latched pair on its way to the exact pose."""

    # displacement of the second dock in the frame of the first, beyond the exact one, when they latched [m]
    offset: Float[np.ndarray, " 3"]
    turn: Float[np.ndarray, " 3"]  # its rotation likewise, as a rotation vector [rad]
    began: float  # when they latched [s]


def compute_error(
    assembly: Assembly, data: mujoco.MjData, link: Docking
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return how far two docks are from their exact pose: displacement [m] and rotation vector [rad]."""
    first, second = (assembly.docks[robot, SIDES.index(side)] for robot, side in link.ends)
    frame = data.site_xmat[first].reshape(3, 3)
    offset = frame.T @ (data.site_xpos[second] - data.site_xpos[first]) - [SCOUT.dock_gap, 0.0, 0.0]
    turned = Rotation.from_matrix(frame.T @ data.site_xmat[second].reshape(3, 3))
    return offset, (turned * _HALF_TURN.inv()).as_rotvec()


def has_mated(assembly: Assembly, data: mujoco.MjData, link: Docking) -> bool:
    """Return whether two docks are in their exact pose, so that a tree can take them over without a jump."""
    offset, turn = compute_error(assembly, data, link)
    return bool(np.linalg.norm(offset) <= EXACT and np.linalg.norm(turn) <= EXACT_ANGLE)


def write_weld(assembly: Assembly, data: mujoco.MjData, index: int, mating: Mating, share: float) -> None:
    """Set the pose that a weld holds, with a share of the way to the exact one left, and activate it.

    A weld holds its pose of compilation until `eq_data` says another one: anchor in the second body, the same point in
    the first, and the rotation of the second body in the frame of the first.
    """
    model = assembly.model
    weld = model.equality(f"weld_{index}").id
    first, second = (
        assembly.docks[robot, SIDES.index(side)] for robot, side in assembly.layout.welds[index].ends
    )
    frame, other = (Rotation.from_quat(model.site_quat[site], scalar_first=True) for site in (first, second))
    wanted = frame.apply(np.array([SCOUT.dock_gap, 0.0, 0.0]) + share * mating.offset)
    turn = frame * Rotation.from_rotvec(share * mating.turn) * _HALF_TURN * other.inv()
    model.eq_data[weld, :3] = model.site_pos[second]
    model.eq_data[weld, 3:6] = model.site_pos[first] + wanted
    model.eq_data[weld, 6:10] = turn.as_quat(scalar_first=True)
    data.eq_active[weld] = 1


def compute_share(elapsed: float) -> float:
    """Return how much of the way to the exact pose is left after a time [s]: it begins and ends at rest."""
    part = min(elapsed / MATING_TIME, 1.0)
    return 1.0 - part * part * (3.0 - 2.0 * part)
