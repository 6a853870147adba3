"""How a module touches the ground: sphere tracks with a surface velocity, or wheels with joints."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from reconstruction._src.geometry.pose import PlanarPose, make_quarter_turn
from symbrion_gym._src.robot.scout_constants import CONTACT_GROUP, CYLINDER_TRACKS, ScoutConfig

_CYLINDER_RADIUS = 0.011  # Of the authors' cylinders [m] (danfis/sim)
_CYLINDER_HALF_WIDTH = 0.004  # Likewise [m] (danfis/sim)
_CYLINDER_PLACES = [(25, 42), (-16, 42), (25, -42), (-16, -42), (-42.5, 16), (-42.5, -16)]
"""(x, z) of the authors' cylinders of a side [mm] (danfis/sim)."""
_CYLINDER_LATERAL = 0.0458  # Distance of their centers from the middle of the module [m] (danfis/sim)
_WHEEL_SHAPES = {
    "wheels": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinders": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsules": mujoco.mjtGeom.mjGEOM_CAPSULE,
}
_OTHER_FRICTION = (0.005, 0.0001)
"""Torsional and rolling friction: MuJoCo's defaults, without effect in contacts of three dimensions."""
_CONTACT_COLOR = (0.9, 0.4, 0.1, 0.0)  # Transparent, so that rays pass


def find_road_wheels(config: ScoutConfig) -> list[tuple[float, float, float]]:
    """Return the centers of the spheres of both tracks in the frame of the module [m].

    Five a side: three below and two above, so that the envelope is the chassis with rounded edges.
    """
    half_x, half_y, half_z = (edge / 2 - config.track_radius for edge in config.size)
    places = [(half_x, -half_z), (0.0, -half_z), (-half_x, -half_z), (half_x, half_z), (-half_x, half_z)]
    return [(x, y, z) for y in (half_y, -half_y) for x, z in places]


def compute_surface_velocity(config: ScoutConfig, speed: float) -> tuple[float, ...]:
    """Return the surface velocity of a road wheel that drives forward: linear [m/s], then angular [rad/s].

    It turns about its own y axis: at the ground the surface runs backwards, at a wall ahead it runs down.
    """
    return (0.0, 0.0, 0.0, 0.0, speed / config.track_radius, 0.0)


def find_driven_wheels(config: ScoutConfig) -> list[tuple[float, float, float]]:
    """Return the centers of what drives, in the frame of the module, the left side before the right [m]."""
    if config.tracks not in CYLINDER_TRACKS:
        return find_road_wheels(config)
    places = [(x / 1000.0, z / 1000.0) for x, z in _CYLINDER_PLACES]
    return [(x, y, z) for y in (_CYLINDER_LATERAL, -_CYLINDER_LATERAL) for x, z in places]


def compute_wheel_radius(config: ScoutConfig) -> float:
    """Return the radius of what drives [m]."""
    return _CYLINDER_RADIUS if config.tracks in CYLINDER_TRACKS else config.track_radius


def add_tracks(
    spec: mujoco.MjSpec,
    frame: mujoco.MjsFrame,
    body: mujoco.MjsBody,
    prefix: str,
    pose: PlanarPose,
    config: ScoutConfig,
) -> None:
    """Add both tracks of a module at a pose in a body; `frame` is that of the module."""
    if config.tracks != "spheres":
        _add_wheels(spec, body, prefix, pose, config)
        return
    for i, place in enumerate(find_road_wheels(config)):
        name, size = f"{prefix}track_{i}", [config.track_radius]
        geom = add_contact(frame, body, name, mujoco.mjtGeom.mjGEOM_SPHERE, size, config, pos=place)
        geom.surfacevel = compute_surface_velocity(config, config.track_speed)


def _add_wheels(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, pose: PlanarPose, config: ScoutConfig
) -> None:
    """Add driven wheels, each a body of its own with a joint and a velocity servo.

    Wheels touch everything but other wheels, as those of a side overlap.
    """
    kind, size = _WHEEL_SHAPES[config.tracks], [compute_wheel_radius(config), _CYLINDER_HALF_WIDTH]
    for i, (x, y, z) in enumerate(find_driven_wheels(config)):
        name, place = f"{prefix}wheel_{i}", pose.compose(PlanarPose(x, y))
        wheel = body.add_body(name=name, pos=[place.x, place.y, z], quat=pose.quaternion)
        wheel.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            armature=config.wheel_armature,
            limited=mujoco.mjtLimited.mjLIMITED_FALSE,
        )
        track, mass = f"{prefix}track_{i}", config.wheel_mass
        geom = add_contact(wheel.add_frame(), wheel, track, kind, size, config, mass=mass)
        geom.quat, geom.conaffinity = make_quarter_turn(x=1.0), 0
        servo = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        servo.set_to_velocity(kv=config.wheel_gain)


def limit_wheels(spec: mujoco.MjSpec, torque: float) -> None:
    """Limit the torque of all driven wheels of a model under construction [N m]."""
    for servo in spec.actuators:
        if "_wheel_" in servo.name:
            servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            servo.forcerange = [-torque, torque]


def add_contact(
    frame: mujoco.MjsFrame,
    body: mujoco.MjsBody,
    name: str,
    kind: int,
    size: Sequence[float] | np.ndarray,
    config: ScoutConfig,
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    mass: float = 0.0,
) -> mujoco.MjsGeom:
    """Add a geom that touches, is not drawn and is not seen by rays; its friction replaces the ground's."""
    geom = body.add_geom(
        name=name,
        type=kind,
        size=[*size, 0.0, 0.0][:3],
        pos=pos,
        mass=mass,
        group=CONTACT_GROUP,
        condim=3,
        priority=1,
        friction=[config.friction, *_OTHER_FRICTION],
        rgba=_CONTACT_COLOR,
        solref=[config.contact_time, 1.0],
    )
    geom.set_frame(frame)
    return geom
