"""A published tracked robot on `sg.add_tracks`: the drives with which Gazebo tests its contact surface motion.

Sizes, masses, obstacles, commands and what is expected are those of gazebosim/gz-sim (main branch),
`test/integration/tracked_vehicle_system.cc` and `examples/worlds/tracked_vehicle_simple.sdf`, which follow
Pecka, Zimmermann and Svoboda, arXiv 1703.04316. Differs: friction is the same in all directions (there 0.7 across the
belts and 150 along), and the rear flippers are a mass only.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

import symbrion_gym as sg
from symbrion_gym._src.robot.belts import Tracks

HEIGHT, GAUGE, WIDTH, WHEELBASE = 0.18094, 0.397, 0.09728, 0.5
"""Of the main belts [m]."""
FRICTION, FRICTION_ALONG = 0.7, 150.0
"""Across and along the belts there; here one of them in all directions."""
_EFFICIENCY, _SEPARATION = 0.5, 0.4
"""From a commanded rate of turning to the speeds of the belts, as set there; the second in [m]."""
_FLIPPER_PITCH = 0.5 + float(np.arctan2(0.06, 0.33))
"""Of the lower side of a front flipper [rad]."""
_SETTLING = 0.3
_STEPS, _TREAD, _RISE, _FIRST_EDGE = 20, 0.175, 0.075, 5.25
"""The stairs: number, sizes and place [m]."""


class Drive(NamedTuple):
    """One drive, and what is expected there.

    Attributes:
        start: x [m] and heading [rad].
        linear: commanded speed [m/s].
        angular: commanded rate of turning to the left [rad/s].
        seconds: duration.
        expected: name -> least and largest value of x ahead, y left [m], height gained [m], yaw and pitch turned [rad].
    """

    start: tuple[float, float]
    linear: float
    angular: float
    seconds: float
    expected: dict[str, tuple[float, float]]


DRIVES = {
    "straight": Drive((20.0, 0.0), 1.0, 0.0, 1.0, {"ahead": (0.9, 1.1), "left": (-0.1, 0.1), "yaw": (-0.1, 0.1)}),
    "turning on the spot": Drive(
        (20.0, 0.0), 0.0, 0.25, 1.0, {"ahead": (-0.1, 0.1), "left": (-0.1, 0.1), "yaw": (0.15, 0.35)}
    ),
    "curve": Drive((20.0, 0.0), 0.5, 0.2, 1.0, {"yaw": (0.1, 0.3)}),
    "stairs": Drive(
        (3.0, 0.0), 1.0, 0.0, 3.5,
        {"ahead": (3.25, 3.55), "left": (-0.1, 0.1), "up": (0.45, np.inf), "yaw": (-0.1, 0.1), "pitch": (-0.5, -0.3)},
    ),
    "cylinder": Drive((1.0, np.pi), 1.0, 0.0, 2.0, {"ahead": (1.99, np.inf), "left": (-0.5, 0.5), "up": (-0.1, 0.1)}),
}  # fmt: skip
"""Name -> drive. The test of the stairs wants z above 0.55 m, set down at 0.1 m."""


def measure_drive(drive: Drive, friction: float = FRICTION, timestep: float = 0.001) -> dict[str, float]:
    """Return where a drive led: ahead, left and up [m], yaw and pitch [rad], against the start."""
    model, tracks = make_robot(friction, timestep)
    data = mujoco.MjData(model)
    data.qpos[:3] = [drive.start[0], 0.0, 0.1]
    data.qpos[3:7] = [np.cos(drive.start[1] / 2), 0.0, 0.0, np.sin(drive.start[1] / 2)]
    mujoco.mj_step(model, data, round(_SETTLING / timestep))
    before, heading = data.qpos[:3].copy(), find_angles(data.qpos[3:7])
    turn = drive.angular * _SEPARATION / 2 / _EFFICIENCY
    for each in tracks:
        each.drive(model, data, drive.linear - turn, drive.linear + turn)
    mujoco.mj_step(model, data, round(drive.seconds / timestep))
    moved, angles = data.qpos[:3] - before, find_angles(data.qpos[3:7]) - heading
    ahead = np.array([np.cos(heading[0]), np.sin(heading[0])])
    yaw = (angles[0] + np.pi) % (2 * np.pi) - np.pi
    return {
        "ahead": float(moved[:2] @ ahead),
        "left": float(moved[1] * ahead[0] - moved[0] * ahead[1]),
        "up": float(moved[2]),
        "yaw": float(yaw),
        "pitch": float(angles[1]),
    }


def find_misses(drive: Drive, found: dict[str, float]) -> list[str]:
    """Return the names of what is outside of what is expected."""
    return [name for name, (low, high) in drive.expected.items() if not low <= found[name] <= high]


def find_angles(quaternion: Float[np.ndarray, " 4"]) -> Float[np.ndarray, " 2"]:
    """Return yaw and pitch of an attitude [rad]; the nose up is a negative pitch, as there."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return np.array([np.arctan2(matrix[3], matrix[0]), -np.arcsin(np.clip(matrix[6], -1.0, 1.0))])


def make_robot(friction: float, timestep: float) -> tuple[mujoco.MjModel, list[Tracks]]:
    """Return the robot on its ground with the obstacles, and the handles of its belts and front flippers."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    _add_ground(spec)
    base = spec.worldbody.add_body(name="base")
    base.add_freejoint()
    half = np.array([0.50017, 0.24093, 0.139]) / 2
    base.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[-0.122, 0.0, 0.118], mass=13.14)
    rear = base.add_geom(size=[0.02, 0.0, 0.0], pos=[-0.33, 0.0, 0.05], mass=1.5)
    rear.contype = rear.conaffinity = 0
    main = sg.add_tracks(
        spec, base, length=WHEELBASE + HEIGHT, gauge=GAUGE, width=WIDTH, height=HEIGHT, mass=12.12,
        position=(0.0, 0.0, 0.01855), friction=friction,
    )  # fmt: skip
    pitch = -_FLIPPER_PITCH
    low = np.array([np.sin(-0.5), 0.0, np.cos(-0.5)]) * -0.06
    flippers = base.add_body(
        name="flippers", pos=np.array([0.25, 0.0, 0.0195]) + low, quat=[np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0]
    )  # fmt: skip
    reach = float(np.hypot(0.33, 0.06))
    front = sg.add_tracks(
        spec, flippers, prefix="flipper_", length=reach + 0.058, gauge=0.544, width=0.04981, height=0.058, mass=1.5,
        position=(reach / 2, 0.0, 0.0), friction=friction,
    )  # fmt: skip
    return spec.compile(), [main, front]


def _add_ground(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[40.0, 40.0, 1.0])
    for step in range(_STEPS):
        top, start = _RISE * (step + 1), _FIRST_EDGE + _TREAD * step
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[_TREAD / 2, 0.5, _RISE / 2],
            pos=[start + _TREAD / 2, 0.0, top - _RISE / 2],
        )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[0.15, 0.4, 0.0],
        pos=[0.0, 0.0, -0.06],
        quat=[np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0, 0.0],
    )
