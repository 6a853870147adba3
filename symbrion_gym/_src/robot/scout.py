"""One Scout module of the Symbrion project as part of a MuJoCo model.

Frame of a module: origin in the center of the chassis, x forward (towards the hinged arm), y left, z up.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reconstruction._src.geometry.pose import PlanarPose, make_quarter_turn
from symbrion_gym._src.robot.scout_constants import (
    ARM_RADIUS,
    CYLINDER_TRACKS,
    SIDES,
    TRACK_MODELS,
    ScoutConfig,
)
from symbrion_gym._src.robot.scout_look import add_arm_visual, add_chassis_visual
from symbrion_gym._src.robot.scout_sensors import add_sensor_sites
from symbrion_gym._src.robot.tracks import add_contact, add_tracks

__all__ = [
    "SIDES",
    "TRACK_MODELS",
    "PlanarPose",
    "ScoutConfig",
    "add_arm",
    "add_chassis",
    "add_hinge",
    "add_joints",
    "add_twist",
    "make_scout",
]

_BODY_RECESS = 0.009  # How far the chassis lies within the tracks [m] (estimate)
_CYLINDER_CHASSIS = (0.033, 0.040, 0.040)
"""Half sizes of the chassis within the authors' cylinders [m] (estimate)."""
_MARKER_SIZE = 0.004  # Radius at which the sites of modules and docks are drawn [m]
_MARKER_GROUP = 5  # Their geom group; not drawn unless asked for


def add_chassis(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, pose: PlanarPose, config: ScoutConfig
) -> None:
    """Add chassis, tracks, docks and sensors of one module to a body."""
    frame = body.add_frame(pos=pose.position, quat=pose.quaternion)
    add_contact(
        frame,
        body,
        f"{prefix}chassis",
        mujoco.mjtGeom.mjGEOM_BOX,
        _CYLINDER_CHASSIS if config.tracks in CYLINDER_TRACKS else np.array(config.size) / 2 - _BODY_RECESS,
        config,
        mass=config.chassis_mass,
    ).rgba[3] = 1.0  # rays see the chassis
    add_chassis_visual(spec, frame, body, config)
    add_tracks(spec, frame, body, prefix, pose, config)
    body.add_site(name=prefix.rstrip("_"), size=[_MARKER_SIZE] * 3, group=_MARKER_GROUP).set_frame(frame)
    for side in ("back", "left", "right"):
        _add_dock(frame, body, prefix, side, config)
    add_sensor_sites(frame, body, prefix, config)


def add_arm(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    prefix: str,
    pose: PlanarPose,
    config: ScoutConfig,
    is_folded: bool = False,
) -> None:
    """Add the hinged arm of one module, with the front dock, to the body that it is part of."""
    lift = make_quarter_turn(y=-1.0) if is_folded else np.array([1.0, 0.0, 0.0, 0.0])
    quaternion = np.empty(4)
    mujoco.mju_mulQuat(quaternion, np.array(pose.quaternion), lift)
    frame = body.add_frame(pos=pose.position, quat=quaternion)
    nose = add_contact(
        frame,
        body,
        f"{prefix}arm",
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        [ARM_RADIUS, ARM_RADIUS],
        config,
        pos=[config.arm_reach - ARM_RADIUS, 0, 0],
        mass=config.arm_mass,
    )
    nose.quat = make_quarter_turn(x=1.0)
    add_arm_visual(spec, frame, body, config)
    _add_dock(frame, body, prefix, "front", config)


def make_scout(config: ScoutConfig | None = None, is_hinged: bool = True) -> mujoco.MjSpec:
    """Return one module alone, on a free joint, with its joints and servos.

    Args:
        config: constants; None for the defaults.
        is_hinged: whether the arm moves; else it is part of the chassis.
    """
    config = config or ScoutConfig()
    spec = mujoco.MjSpec()
    spec.modelname = "scout"
    spec.compiler.degree = False
    body = spec.worldbody.add_body(name="scout")
    body.add_freejoint(name="root")
    add_chassis(spec, body, "module_0_", PlanarPose(), config)
    arm = body
    if is_hinged:
        arm = body.add_body(name="arm")
        add_joints(spec, arm, 0, PlanarPose(), config, lifts=True)
    add_arm(spec, arm, "module_0_", PlanarPose(), config)
    return spec


def add_joints(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, module: int, pose: PlanarPose, config: ScoutConfig, lifts: bool
) -> None:
    """Add the joints of a module, `hinge_i` and with two degrees of freedom `twist_i`, to the body that they move.

    The hinge is at the chassis, the twist beyond it, in the arm. MuJoCo turns a body about its joints in their order,
    seen from the parent.
    """
    if config.dofs == 2 and not lifts:
        add_twist(spec, body, f"twist_{module}", pose, config, lifts)
    add_hinge(spec, body, f"hinge_{module}", pose, config, lifts)
    if config.dofs == 2 and lifts:
        add_twist(spec, body, f"twist_{module}", pose, config, lifts)


def add_hinge(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, pose: PlanarPose, config: ScoutConfig, lifts: bool
) -> None:
    """Add the main hinge of a module, with its servo, to the body that it moves.

    A positive angle lifts the arm, and what is docked to it, against the chassis.
    """
    sign = -1.0 if lifts else 1.0
    axis = [-sign * np.sin(pose.heading), sign * np.cos(pose.heading), 0.0]
    _add_joint(spec, body, name, pose, axis, config.hinge_range, config.hinge_torque, config)


def add_twist(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, pose: PlanarPose, config: ScoutConfig, lifts: bool
) -> None:
    """Add the second rotation of a module, about the long axis of its arm, with its servo; see `add_hinge`.

    A positive angle lifts the left side of the arm, and of what is docked to it, against the chassis.
    """
    sign = 1.0 if lifts else -1.0
    axis = [sign * np.cos(pose.heading), sign * np.sin(pose.heading), 0.0]
    _add_joint(spec, body, name, pose, axis, config.twist_range, config.twist_torque, config)


def _add_joint(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    pose: PlanarPose,
    axis: list[float],
    limit: float,
    torque: float,
    config: ScoutConfig,
) -> None:
    """Add a joint through the center of a module, and its servo."""
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        pos=pose.position,
        axis=axis,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=[-limit, limit],
        armature=config.hinge_armature,
        damping=[config.hinge_damping, 0, 0],
    )
    servo = spec.add_actuator(
        name=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=name,
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=[-limit, limit],
        forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        forcerange=[-torque, torque],
    )
    servo.set_to_position(kp=config.hinge_stiffness, kv=config.hinge_derivative)


def _add_dock(
    frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, side: str, config: ScoutConfig
) -> None:
    dock = PlanarPose(*config.compute_dock(side))
    site = body.add_site(
        name=f"{prefix}dock_{side}",
        pos=dock.position,
        quat=dock.quaternion,
        size=[_MARKER_SIZE] * 3,
        group=_MARKER_GROUP,
    )
    site.set_frame(frame)
