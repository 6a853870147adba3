"""Where the modules of any organism are, worked out from its coordinates without MuJoCo; for the second judge."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.pose import make_rotation, to_rotation
from symbrion_gym._src.robot.organism import Organism


def place_tree(
    qpos: Float[np.ndarray, "T Q"], organism: Organism
) -> tuple[Float[np.ndarray, "T n 3"], Float[np.ndarray, "T n 3 3"]]:
    """Return centers [m] and rotations of the modules of an organism.

    What is docked to the front of a module is fixed to its arm, which the hinge turns about the module's lateral axis
    and the second joint, if there is one, about its own.
    """
    arms = _turn_arms(qpos[:, 7:], organism)
    straight = organism.find_poses()
    sides = {(one, other): side for one, side, other in _list_dockings(organism)}
    centers = np.zeros((len(qpos), organism.num_modules, 3))
    rotations = np.zeros((len(qpos), organism.num_modules, 3, 3))
    centers[:, 0], rotations[:, 0] = qpos[:, :3], to_rotation(qpos[:, 3:7])
    for module in organism.order[1:]:
        parent = organism.parents[module]
        step = straight[parent].invert().compose(straight[module])
        frame = rotations[:, parent]
        if sides[parent, module] == "front":
            frame = frame @ arms[parent]
        there = frame @ make_rotation(yaw=step.heading)
        if sides[module, parent] == "front":
            there = there @ np.swapaxes(arms[module], -1, -2)
        # The step leads from the pivot of one module to that of the other; both pivots are centers.
        centers[:, module] = centers[:, parent] + frame @ np.array([step.x, step.y, 0.0])
        rotations[:, module] = there
    return centers, rotations


def _turn_arms(angles: Float[np.ndarray, "T J"], organism: Organism) -> dict[int, Float[np.ndarray, "T 3 3"]]:
    """Return the rotation of the arm of each module with a hinge, seen from its chassis."""
    count = len(organism.hinges)
    arms = {}
    for index, module in enumerate(organism.hinges):
        arm = make_rotation(pitch=-angles[:, index])
        if angles.shape[1] >= 2 * count > 0 and organism.scout.dofs == 2:
            arm = arm @ make_rotation(roll=angles[:, count + index])
        arms[module] = arm
    return arms


def _list_dockings(organism: Organism) -> list[tuple[int, str, int]]:
    """Return (module, its side, its neighbor) of every dock in use."""
    found = []
    for docking in organism.dockings:
        found.append((docking.first, docking.first_side, docking.second))
        found.append((docking.second, docking.second_side, docking.first))
    return found
