"""What a module senses with: where its sensors sit, and MuJoCo's sensors that read them."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from symbrion_gym.robot.pose import Pose
from symbrion_gym.robot.scout_constants import SIDES, ScoutConfig

if TYPE_CHECKING:
    from symbrion_gym.robot.organism import Organism

LARGEST_ACCELERATION = 4 * 9.81
"""Range of an accelerometer [m/s²] (estimate)."""
LARGEST_TOUCH = 50.0
"""Range of the touch reading [N]."""
NUM_LASER_BEAMS = 19
"""Beams of the forward laser, an upright fan (estimate)."""
IR_SPACING = 0.06
"""Distance between the two infrared units of a side [m] (estimate)."""
MEASURED = ("acceleration", "ir", "contact", "dock_force", "laser")
"""Parts of the observation that MuJoCo's own sensors measure."""
_SITE_GROUP = 5


def add_sensor_sites(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add the sites of a module's sensors: infrared units, accelerometers, skin, and the head's laser."""
    half = np.array(config.size) / 2
    for side, (x, y, heading) in _find_infrared(config).items():
        for k, offset in enumerate((IR_SPACING / 2, -IR_SPACING / 2)):
            place = Pose(x, y, heading).compose(Pose(0.0, offset))
            quat = np.sqrt(0.5) * np.array([1.0, -np.sin(heading), np.cos(heading), 0.0])
            _add_site(frame, body, f"{prefix}ir_{side}_{k}", place.position, quat)
    for name, x in (("front", 0.03), ("rear", -0.03)):
        _add_site(frame, body, f"{prefix}accel_{name}", [x, 0.0, 0.02])
    if prefix == "module_0_":
        for k, angle in enumerate(np.linspace(*config.laser_angles, NUM_LASER_BEAMS)):
            _add_site(frame, body, f"{prefix}laser_{k}", [half[0], 0.0, 0.02], _lift_z_to(angle))
    zone = _add_site(frame, body, f"{prefix}touch", [0.0, 0.0, 0.0])
    zone.type, zone.size, zone.rgba = mujoco.mjtGeom.mjGEOM_BOX, half + 0.005, [0.0, 0.0, 0.0, 0.0]


def add_sensors(spec: mujoco.MjSpec, organism: Organism, parts: tuple[str, ...], interval: float) -> None:
    """Add MuJoCo's sensors for the wanted parts of the observation, part by part in their order.

    Args:
        spec: a model with the organism in it.
        organism: who senses.
        parts: of `MEASURED`; others are passed over.
        interval: time between two readings of the infrared units and the laser [s].
    """
    modules = range(organism.num_modules)
    for part in parts:
        if part == "acceleration":
            for module in modules:
                for name in ("front", "rear"):
                    _add_sensor(
                        spec, f"module_{module}_accel_{name}", "ACCELEROMETER", cutoff=LARGEST_ACCELERATION
                    )
        elif part == "ir":
            for module, side in find_free_sides(organism):
                for k in range(2):
                    _add_ray(spec, f"module_{module}_ir_{side}_{k}", interval)
        elif part == "contact":
            for module in modules:
                _add_sensor(spec, f"module_{module}_touch", "TOUCH", cutoff=LARGEST_TOUCH)
        elif part == "dock_force":
            for module in organism.hinges:
                _add_sensor(spec, f"module_{module}", "FORCE", f"dock_force_{module}")
        elif part == "laser":
            for k in range(NUM_LASER_BEAMS):
                _add_ray(spec, f"module_0_laser_{k}", interval)


def find_free_sides(organism: Organism) -> list[tuple[int, str]]:
    """Return (module, side) of every side with nothing docked to it: its infrared units see the world."""
    used = {end for docking in organism.dockings for end in docking.ends}
    return [(i, side) for i in range(organism.num_modules) for side in SIDES if (i, side) not in used]


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


def _add_sensor(
    spec: mujoco.MjSpec, site: str, kind: str, name: str | None = None, cutoff: float = 0.0
) -> None:
    spec.add_sensor(
        name=name or site,
        type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"),
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=site,
        cutoff=cutoff,
    )


def _add_ray(spec: mujoco.MjSpec, site: str, interval: float) -> None:
    """Add a distance along the z axis of a site [m], -1 where nothing is hit, read every `interval`."""
    spec.add_sensor(
        name=site,
        type=mujoco.mjtSensor.mjSENS_RANGEFINDER,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=site,
        nsample=1,
        interval=[interval, 0.0],
        intprm=[1, 0, 0],
    )


def _lift_z_to(angle: float) -> np.ndarray:
    """Return the rotation about y that brings the z axis forward, `angle` above the horizontal."""
    turn = np.pi / 2 - angle
    return np.array([np.cos(turn / 2), 0.0, np.sin(turn / 2), 0.0])
