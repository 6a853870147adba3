"""Forces through latched docks: what one side of an organism needs from the other to move as it does."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float, Int

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import find_groups
from symbrion_gym._src.swarm.dynamic.assembly import Assembly
from symbrion_gym._src.swarm.dynamic.motion import find_parts


def find_loads(
    assembly: Assembly, data: mujoco.MjData, links: Sequence[Docking], scout: ScoutConfig
) -> Float[np.ndarray, "N 4"]:
    """Return the force through each dock [N] in the last physics step; 0 where nothing is latched.

    For each docking the organism is cut there: mass times acceleration of the modules on one side, less gravity and
    what the ground and other robots push, is what came through the dock. So it is the same for welds and for trees.
    """
    count = len(assembly.sites)
    loads = np.zeros((count, 4))
    if not links:
        return loads
    model = assembly.model
    mujoco.mj_rnePostConstraint(model, data)
    needed = _find_inertial(assembly, data, scout) - _find_pushes(assembly, data)
    for link in links:
        others = [each for each in links if each != link]
        groups = find_groups(others, count)
        force = needed[groups == groups[link.first]].sum(axis=0)
        for robot, side in link.ends:
            loads[robot, SIDES.index(side)] = np.linalg.norm(force)
    return loads


def _find_inertial(assembly: Assembly, data: mujoco.MjData, scout: ScoutConfig) -> Float[np.ndarray, "N 3"]:
    """Return mass times (acceleration - gravity) of chassis and arm of each robot [N]."""
    model = assembly.model
    chassis, arm = find_parts(scout)
    bodies = np.stack([model.site_bodyid[assembly.sites], assembly.arms], axis=1)
    frame = data.site_xmat[assembly.sites].reshape(-1, 3, 3)
    front = data.site_xpos[assembly.docks[:, 0]] - data.site_xpos[assembly.sites]
    centers = np.stack([frame @ chassis.center, np.linalg.norm(arm.center) / scout.arm_reach * front], axis=1)
    places = data.site_xpos[assembly.sites][:, None] + centers
    lever = places - data.subtree_com[model.body_rootid[bodies]]
    spin, turning = data.cvel[bodies][..., :3], data.cacc[bodies][..., :3]
    velocity = data.cvel[bodies][..., 3:] + np.cross(spin, lever)
    acceleration = data.cacc[bodies][..., 3:] + np.cross(turning, lever) + np.cross(spin, velocity)
    return chassis.mass * acceleration[:, 0] + arm.mass * acceleration[:, 1]


def _find_pushes(assembly: Assembly, data: mujoco.MjData) -> Float[np.ndarray, "N 3"]:
    """Return the sum of contact forces and applied forces on each robot [N]."""
    pushes = np.zeros((len(assembly.sites), 3))
    owners, forces = find_contact_forces(assembly, data)
    world = np.einsum("cji,cj->ci", data.contact.frame.reshape(-1, 3, 3), forces)
    world[owners[:, 0] == owners[:, 1]] = 0.0
    for side, sign in enumerate((-1.0, 1.0)):
        is_robot = owners[:, side] >= 0
        np.add.at(pushes, owners[is_robot, side], sign * world[is_robot])
    for body in np.flatnonzero(data.xfrc_applied[:, :3].any(axis=1)):
        on_body = assembly.owners[assembly.model.geom_bodyid == body]
        pushes[on_body.max(initial=-1)] += data.xfrc_applied[body, :3]
    return pushes


def find_contact_forces(
    assembly: Assembly, data: mujoco.MjData
) -> tuple[Int[np.ndarray, "C 2"], Float[np.ndarray, "C 3"]]:
    """Return the robots that each contact is between, -1 for the arena, and its force in its frame, normal first [N].

    With elliptic cones, as all models here have, the solver's forces are these.
    """
    contacts = data.contact
    rows = contacts.efc_address
    forces = np.zeros((len(rows), 3))
    is_active = rows >= 0
    forces[is_active] = data.efc_force[rows[is_active, None] + np.arange(3)]
    return assembly.owners[contacts.geom], forces
