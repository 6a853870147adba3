"""Welds that pull two latched docks from where they latched to their exact pose."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.dynamic.assembly import Assembly

EXACT = 3e-5
"""Docks this near to their exact pose have mated [m]."""
EXACT_ANGLE = 2e-4
"""Likewise [rad]: over the length of eight modules this is 0.2 mm, which the fit of a tree halves."""
_HALF_TURN = Rotation.from_rotvec([0.0, 0.0, np.pi])


@dataclass(frozen=True)
class Mating:
    """A latched pair on its way to the exact pose.

    Attributes:
        offset: displacement of the second dock in the frame of the first, beyond the exact one, when they latched [m].
        turn: its rotation likewise, as a rotation vector [rad].
        began: when they latched [s].
    """

    offset: Float[np.ndarray, " 3"]
    turn: Float[np.ndarray, " 3"]
    began: float


def find_error(
    assembly: Assembly, data: mujoco.MjData, link: Docking, scout: ScoutConfig
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return how far two docks are from their exact pose: displacement [m] and rotation vector [rad]."""
    first, second = (assembly.docks[robot, SIDES.index(side)] for robot, side in link.ends)
    frame = data.site_xmat[first].reshape(3, 3)
    offset = frame.T @ (data.site_xpos[second] - data.site_xpos[first]) - [scout.dock_gap, 0.0, 0.0]
    turned = Rotation.from_matrix(frame.T @ data.site_xmat[second].reshape(3, 3))
    return offset, (turned * _HALF_TURN.inv()).as_rotvec()


def has_mated(assembly: Assembly, data: mujoco.MjData, link: Docking, scout: ScoutConfig) -> bool:
    """Return whether two docks are in their exact pose, so that a tree can take them over without a jump."""
    offset, turn = find_error(assembly, data, link, scout)
    return bool(np.linalg.norm(offset) <= EXACT and np.linalg.norm(turn) <= EXACT_ANGLE)


def write_weld(
    assembly: Assembly,
    data: mujoco.MjData,
    index: int,
    mating: Mating,
    scout: ScoutConfig,
    share: float,
) -> None:
    """Set the pose that a weld holds, and activate it.

    A weld holds its pose of compilation until `eq_data` says another one: anchor in the second body, the same point in
    the first, and the rotation of the second body in the frame of the first.
    """
    model = assembly.model
    weld = model.equality(f"weld_{index}").id
    first, second = (
        assembly.docks[robot, SIDES.index(side)] for robot, side in assembly.layout.welds[index].ends
    )
    frame, other = (Rotation.from_quat(model.site_quat[site], scalar_first=True) for site in (first, second))
    wanted = frame.apply(np.array([scout.dock_gap, 0.0, 0.0]) + share * mating.offset)
    turn = frame * Rotation.from_rotvec(share * mating.turn) * _HALF_TURN * other.inv()
    model.eq_data[weld, :3] = model.site_pos[second]
    model.eq_data[weld, 3:6] = model.site_pos[first] + wanted
    model.eq_data[weld, 6:10] = turn.as_quat(scalar_first=True)
    data.eq_active[weld] = 1


def find_share(elapsed: float, mating_time: float) -> float:
    """Return how much of the way is left after a time [s]: it begins and ends at rest."""
    if elapsed >= mating_time:
        return 0.0
    part = elapsed / mating_time
    return 1.0 - part * part * (3.0 - 2.0 * part)
