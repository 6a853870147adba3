"""A sled and a wheel drawn along an arena, over every seam between its pieces."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from symbrion_gym.arenas.arena import Arena

SPEED = 0.3
LANES = (-0.7, -0.45, -0.2, 0.05, 0.3, 0.55, 0.8)
"""y of the ways [m]: seams run across, each way meets all of them."""
_END = 3.0
_GRID = np.linspace(-_END + 0.3, _END - 0.3, 4000)
_NEARBY = 0.04
"""The truth's height and pace are taken from so far before and behind: a crease may lie a little elsewhere [m]."""
_PIT = 0.5
"""Nothing is compared this close to the middle of the pit, where bodies fall in and are drawn out [m]."""
_SMOOTH = 0.05
"""Speeds are means over this time [s]: 15 mm of way."""
_TIMESTEP = 0.002


class Drawn(NamedTuple):
    """What a body did on its way, at evenly spaced x.

    Attributes:
        height: `[N]` [m].
        pace: `[N]` speed over the wanted speed.
    """

    height: np.ndarray
    pace: np.ndarray


def compare_drawn(truth: Arena, arenas: dict[str, Arena]) -> dict[str, dict[str, dict[str, float]]]:
    """Vertical kicks [mm] and loss of speed of a sled and a wheel against the truth, worst of seven lanes.

    A kick is how much higher a body is than the truth lets it be within 4 cm; a loss is how much slower than the
    slowest there. Both are given with the x where they are.
    """
    is_open = np.abs(_GRID) > _PIT
    reach = 2 * int(_NEARBY / (_GRID[1] - _GRID[0])) + 1
    found: dict[str, dict[str, dict[str, float]]] = {}
    for body in ("sled", "wheel"):
        start = {"kick_mm": -np.inf, "kick_at": 0.0, "speed_loss": -np.inf, "loss_at": 0.0, "lanes_off": 0}
        found[body] = {name: dict(start) for name in arenas}
        for y in LANES:
            exact = draw(truth, body, y)
            highest, slowest = maximum_filter1d(exact.height, reach), minimum_filter1d(exact.pace, reach)
            for name, arena in arenas.items():
                drawn, row = draw(arena, body, y), found[body][name]
                kick = np.where(is_open, 1e3 * (drawn.height - highest), -np.inf)
                loss = np.where(is_open, slowest - drawn.pace, -np.inf)
                row["lanes_off"] += bool(kick.max() > 2.0 or loss.max() > 0.05)
                for key, place, values in (("kick_mm", "kick_at", kick), ("speed_loss", "loss_at", loss)):
                    if values.max() > row[key]:
                        row[key], row[place] = float(values.max()), float(_GRID[values.argmax()])
    return found


def draw(arena: Arena, body: str, y: float) -> Drawn:
    """Draw a body along x at constant speed by a spring: a "sled" that slides, or a "wheel" that rolls."""
    spec = arena.spec()
    z = float(arena.height(-_END, y)) + (0.02 if body == "sled" else 0.045)
    moved = spec.worldbody.add_body(name=body, pos=[-_END, y, z])
    for axis in np.eye(3)[[0, 2]]:
        moved.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    moved.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    shape = moved.add_geom(mass=0.5)
    if body == "sled":
        shape.type, shape.size = mujoco.mjtGeom.mjGEOM_BOX, [0.04, 0.04, 0.01]
        shape.friction = [0.2, 0.005, 0.0001]
    else:
        shape.type, shape.size = mujoco.mjtGeom.mjGEOM_ELLIPSOID, [0.04, 0.02, 0.04]
    spec.option.timestep = _TIMESTEP
    model = spec.compile()
    data = mujoco.MjData(model)
    trace = []
    for step in range(int(2 * _END / SPEED / _TIMESTEP)):
        wanted = SPEED * step * _TIMESTEP
        data.qfrc_applied[0] = 300.0 * (wanted - data.qpos[0]) + 30.0 * (SPEED - data.qvel[0])
        mujoco.mj_step(model, data)
        trace.append((data.qpos[0] - _END, z + data.qpos[1], data.qvel[0] / SPEED))
    x, height, pace = np.array(trace).T
    order = np.argsort(x, kind="stable")
    window = round(_SMOOTH / _TIMESTEP)
    smooth = np.convolve(pace, np.ones(window) / window, mode="same")
    return Drawn(*(np.interp(_GRID, x[order], values[order]) for values in (height, smooth)))
