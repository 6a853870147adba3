"""MuJoCo's sensors that read what the modules of an organism sense."""

from __future__ import annotations

import mujoco

from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import SIDES

MEASURED = ("acceleration", "ir", "contact", "dock_force", "laser")
"""Parts of the observation that MuJoCo's own sensors measure."""


def add_sensors(spec: mujoco.MjSpec, organism: Organism, parts: tuple[str, ...], interval: float) -> None:
    """Add MuJoCo's sensors for the wanted parts of the observation, part by part in their order."""
    modules, scout = range(organism.num_modules), organism.scout
    for part in parts:
        if part == "acceleration":
            for module in modules:
                for name in ("front", "rear"):
                    site, limit = f"module_{module}_accel_{name}", scout.acceleration_range
                    _add_sensor(spec, site, "ACCELEROMETER", cutoff=limit)
        elif part == "ir":
            for module, side in find_free_sides(organism):
                for k in range(2):
                    _add_ray(spec, f"module_{module}_ir_{side}_{k}", interval)
        elif part == "contact":
            for module in modules:
                _add_sensor(spec, f"module_{module}_touch", "TOUCH", cutoff=scout.contact_range)
        elif part == "dock_force":
            for module in organism.hinges:
                _add_sensor(spec, f"module_{module}", "FORCE", f"dock_force_{module}")
        elif part == "laser":
            for k in range(scout.laser_beams):
                _add_ray(spec, f"module_0_laser_{k}", interval)


def find_free_sides(organism: Organism) -> list[tuple[int, str]]:
    """Return (module, side) of every side with nothing docked to it: its infrared units see the world."""
    used = {end for docking in organism.dockings for end in docking.ends}
    return [(i, side) for i in range(organism.num_modules) for side in SIDES if (i, side) not in used]


def _add_sensor(
    spec: mujoco.MjSpec, site: str, kind: str, name: str | None = None, cutoff: float = 0.0
) -> None:
    """Add a sensor at a site that clips at the cutoff; 0 for none."""
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
