"""What a module senses with, and where its sensors sit."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import pi
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_not_negative
from reconstruction._src.geometry.pose import PlanarPose, make_quarter_turn, make_quaternion
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig

_ACCELEROMETERS = {"front": (0.03, 0.0, 0.02), "rear": (-0.03, 0.0, 0.02)}
"""Where they sit in the frame of the module [m] (estimate)."""
LASER_HEIGHT = 0.02  # Of the laser above the center of the module [m] (estimate)
_SKIN = 0.005
"""The zone in which contacts are felt reaches this far beyond the chassis [m], over all that touches."""
_SITE_GROUP = 5  # Geom group of the sites; not drawn unless asked for
_SITE_SIZE = 0.002  # Radius at which they are drawn [m]


def add_sensor_sites(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add the sites of a module's sensors: infrared units, accelerometers, skin, and the head's laser."""
    half = np.array(config.size) / 2
    for side, (x, y, heading) in compute_infrared_sides(config).items():
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


def compute_infrared_sides(config: ScoutConfig) -> dict[str, tuple[float, float, float]]:
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


class ScoutRays(NamedTuple):
    """Rays of a module's range sensors: the infrared units in the order of the observation, then the laser's beams."""

    origins: Float[np.ndarray, "R 3"]  # where they begin [m]
    directions: Float[np.ndarray, "R 3"]  # unit vectors
    max_ranges: Float[np.ndarray, " R"]  # what is farther is not seen [m]


def find_scout_rays(config: ScoutConfig | None = None) -> ScoutRays:
    """Return the rays of a lone Scout, `ir` before `laser`, as they stand in its observation."""
    config = config or ScoutConfig()
    origins, directions, ranges = [], [], []
    sides = compute_infrared_sides(config)
    for side in SIDES:
        x, y, heading = sides[side]
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        aside = np.array([-ahead[1], ahead[0], 0.0])
        for offset in (config.ir_spacing / 2, -config.ir_spacing / 2):
            origins.append(np.array([x, y, 0.0]) + offset * aside)
            directions.append(ahead)
            ranges.append(config.ir_range)
    for angle in np.linspace(*config.laser_angles, config.laser_beams):
        origins.append(np.array([config.size[0] / 2, 0.0, LASER_HEIGHT]))
        directions.append(np.array([np.cos(angle), 0.0, np.sin(angle)]))
        ranges.append(config.laser_range)
    return ScoutRays(np.array(origins), np.array(directions), np.array(ranges))


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviation of each part of an observation at noise level 1; the parts not listed have none.

    All are estimates for the real robot: none was measured on it.

    Raises:
        OptionError: a number is negative.
    """

    hinge_angle: float = 0.005  # [rad]
    hinge_rate: float = 0.05  # [rad/s]
    pitch: float = 0.01  # [rad]
    roll: float = 0.01  # [rad]
    acceleration: float = 0.3  # [m/s²]
    ir: float = 0.003  # standard deviation of a distance [m]
    contact: float = 0.5  # standard deviation of a force [N]
    odometry: float = 0.01  # [m]; the paper's robot was localized within 1 cm
    track_odometry: float = 0.01  # standard deviation of each reading [m]; slip comes from the physics
    laser: float = 0.006  # standard deviation of a distance [m]

    def __post_init__(self) -> None:
        check_not_negative(self, [each.name for each in fields(self)], OptionError)
