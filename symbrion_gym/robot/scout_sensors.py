"""What a module senses with, and where its sensors sit."""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np

from reconstruction.geometry.pose import PlanarPose, make_quarter_turn, make_quaternion
from symbrion_gym.robot.scout_constants import ScoutConfig

LARGEST_ACCELERATION = 4 * 9.81
"""Range of an accelerometer [m/s²] (estimate)."""
LARGEST_TOUCH = 50.0
"""Range of the touch reading [N]."""
NUM_LASER_BEAMS = 19
"""Beams of the forward laser, an upright fan (estimate)."""
IR_SPACING = 0.06
"""Distance between the two infrared units of a side [m] (estimate)."""
_SITE_GROUP = 5


def add_sensor_sites(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add the sites of a module's sensors: infrared units, accelerometers, skin, and the head's laser."""
    half = np.array(config.size) / 2
    for side, (x, y, heading) in _find_infrared(config).items():
        for k, offset in enumerate((IR_SPACING / 2, -IR_SPACING / 2)):
            place = PlanarPose(x, y, heading).compose(PlanarPose(0.0, offset))
            quat = make_quarter_turn(x=-np.sin(heading), y=np.cos(heading))
            _add_site(frame, body, f"{prefix}ir_{side}_{k}", place.position, quat)
    for name, x in (("front", 0.03), ("rear", -0.03)):
        _add_site(frame, body, f"{prefix}accel_{name}", [x, 0.0, 0.02])
    if prefix == "module_0_":
        for k, angle in enumerate(np.linspace(*config.laser_angles, NUM_LASER_BEAMS)):
            _add_site(
                frame,
                body,
                f"{prefix}laser_{k}",
                [half[0], 0.0, 0.02],
                make_quaternion(0.0, np.pi / 2 - angle),
            )
    zone = _add_site(frame, body, f"{prefix}touch", [0.0, 0.0, 0.0])
    zone.type, zone.size, zone.rgba = mujoco.mjtGeom.mjGEOM_BOX, half + 0.005, [0.0, 0.0, 0.0, 0.0]


def _find_infrared(config: ScoutConfig) -> dict[str, tuple[float, float, float]]:
    """Return x, y [m] and heading [rad] of the middle between the two infrared units of each side."""
    half_x, half_y = config.size[0] / 2, config.size[1] / 2
    return {
        "front": (half_x, 0.0, 0.0),
        "back": (-half_x, 0.0, pi),
        "left": (0.0, half_y, pi / 2),
        "right": (0.0, -half_y, -pi / 2),
    }


def _add_site(
    frame: mujoco.MjsFrame,
    body: mujoco.MjsBody,
    name: str,
    pos: list[float],
    quat: np.ndarray | tuple[float, ...] = (1.0, 0.0, 0.0, 0.0),
) -> mujoco.MjsSite:
    site = body.add_site(name=name, pos=pos, quat=quat, size=[0.002] * 3, group=_SITE_GROUP)
    site.set_frame(frame)
    return site
