"""What a module senses with, and where its sensors sit."""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np

from reconstruction._src.geometry.pose import PlanarPose, make_quarter_turn, make_quaternion
from symbrion_gym._src.robot.scout_constants import ScoutConfig

_ACCELEROMETERS = {"front": (0.03, 0.0, 0.02), "rear": (-0.03, 0.0, 0.02)}
"""Where they sit in the frame of the module [m] (estimate)."""
LASER_HEIGHT = 0.02
"""Of the laser above the center of the module [m] (estimate)."""
_SKIN = 0.005
"""The zone in which contacts are felt reaches this far beyond the chassis [m], over all that touches."""
_SITE_GROUP = 5
"""Geom group of the sites; not drawn unless asked for."""
_SITE_SIZE = 0.002
"""Radius at which they are drawn [m]."""


def add_sensor_sites(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add the sites of a module's sensors: infrared units, accelerometers, skin, and the head's laser."""
    half = np.array(config.size) / 2
    for side, (x, y, heading) in find_infrared_sides(config).items():
        for k, offset in enumerate((config.ir_spacing / 2, -config.ir_spacing / 2)):
            place = PlanarPose(x, y, heading).compose(PlanarPose(0.0, offset))
            quat = make_quarter_turn(x=-np.sin(heading), y=np.cos(heading))
            _add_site(frame, body, f"{prefix}ir_{side}_{k}", place.position, quat)
    for name, position in _ACCELEROMETERS.items():
        _add_site(frame, body, f"{prefix}accel_{name}", list(position))
    if prefix == "module_0_":
        for k, angle in enumerate(np.linspace(*config.laser_angles, config.laser_beams)):
            _add_site(
                frame,
                body,
                f"{prefix}laser_{k}",
                [half[0], 0.0, LASER_HEIGHT],
                make_quaternion(0.0, np.pi / 2 - angle),
            )
    zone = _add_site(frame, body, f"{prefix}touch", [0.0, 0.0, 0.0])
    zone.type, zone.size, zone.rgba = mujoco.mjtGeom.mjGEOM_BOX, half + _SKIN, [0.0, 0.0, 0.0, 0.0]


def find_infrared_sides(config: ScoutConfig) -> dict[str, tuple[float, float, float]]:
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
    site = body.add_site(name=name, pos=pos, quat=quat, size=[_SITE_SIZE] * 3, group=_SITE_GROUP)
    site.set_frame(frame)
    return site
