"""One Scout module of the Symbrion project as part of a MuJoCo model: chassis, tracks, arm, joints, sensors, look.

It touches the ground with the wheels of its tracks, which are spheres with a surface velocity.

Frame of a module: origin in the center of the chassis, x forward (towards the hinged arm), y left, z up.
"""

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.pose import PlanarPose, make_quarter_turn, make_quaternion
from symbrion_gym._src.robot.scout_constants import (
    ARM_RADIUS,
    CONTACT_GROUP,
    OTHER_FRICTION,
    SIDES,
    ScoutConfig,
)

_FRICTION_STIFFNESS = (12.0, 1.5)
"""Of friction against that of contacts, over the number of modules, and the least: at rest on 20° they creep by less
than 0.1 mm/s, a few modules faster than many if it were the same for all. More of it costs more time."""
CONTACT_TIME = 0.01
"""Time in which a contact of the robot gives way, of MuJoCo's `solref` [s]: twice the usual physics step, the stiffest
that stays stable. With twice as much, robots sink by more than 10 mm where friction is high."""
MIDDLE_RISE = 0.002  # Of the middle wheel of a track above the outer ones [m] (estimate)
_CONTACT_COLOR = (0.9, 0.4, 0.1, 0.0)  # Transparent, so that rays pass


def compute_friction_stiffness(num_modules: int) -> float:
    """Return how much stiffer friction is than contacts for a body: MuJoCo's `impratio`."""
    few, least = _FRICTION_STIFFNESS
    return max(few / num_modules, least)


def set_physics(option: mujoco.MjOption, timestep: float, num_modules: int = 1) -> None:
    """Set how robots are simulated: friction alike in all directions, a dense Newton solver.

    Sparse matrices are factored wrongly by MuJoCo 4.0.0 from 60 degrees of freedom on.
    """
    option.timestep = timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, compute_friction_stiffness(num_modules)
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def find_road_wheels(config: ScoutConfig) -> list[tuple[float, float, float]]:
    """Return the centers of the wheels of both tracks in the frame of the module, the left side before the right [m].

    Five a side: three below and two above, so that the envelope is the chassis with rounded edges. The middle one
    does not reach level ground, as in the authors' simulator a track stands on two wheels (danfis/sim); it drives where
    an edge is between them.
    """
    half_x, half_y, half_z = (edge / 2 - config.track_radius for edge in config.size)
    middle = (0.0, MIDDLE_RISE - half_z)
    places = [(half_x, -half_z), middle, (-half_x, -half_z), (half_x, half_z), (-half_x, half_z)]
    return [(x, y, z) for y in (half_y, -half_y) for x, z in places]


def compute_surface_velocity(config: ScoutConfig, speed: float) -> tuple[float, ...]:
    """Return the surface velocity of a road wheel that drives forward: linear [m/s], then angular [rad/s].

    It turns about its own y axis: at the ground the surface runs backwards, at a wall ahead it runs down.
    """
    return (0.0, 0.0, 0.0, 0.0, speed / config.track_radius, 0.0)


def add_tracks(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add both tracks of a module to a body; `frame` is that of the module."""
    for i, place in enumerate(find_road_wheels(config)):
        name, size = f"{prefix}track_{i}", [config.track_radius]
        geom = add_contact(frame, body, name, mujoco.mjtGeom.mjGEOM_SPHERE, size, config, pos=place)
        geom.surfacevel = compute_surface_velocity(config, config.track_speed)


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
        friction=[config.friction, *OTHER_FRICTION],
        rgba=_CONTACT_COLOR,
        solref=[CONTACT_TIME, 1.0],
    )
    geom.set_frame(frame)
    return geom


_BODY_RECESS = 0.009  # How far the chassis lies within the tracks [m] (estimate)
_MARKER_SIZE = 0.004  # Radius at which the sites of modules and docks are drawn [m]
_SITE_GROUP = 5  # Geom group of all sites; not drawn unless asked for


def add_chassis(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, pose: PlanarPose, config: ScoutConfig
) -> None:
    """Add chassis, tracks, docks and sensors of one module to a body."""
    frame = body.add_frame(pos=pose.position, quat=pose.quaternion)
    half = np.array(config.size) / 2 - _BODY_RECESS
    kind, mass = mujoco.mjtGeom.mjGEOM_BOX, config.chassis_mass
    chassis = add_contact(frame, body, f"{prefix}chassis", kind, half, config, mass=mass)
    chassis.rgba[3] = 1.0  # rays see the chassis
    _add_look(spec, frame, body, "chassis", _make_chassis_look(config))
    add_tracks(frame, body, prefix, config)
    _add_site(frame, body, prefix.rstrip("_"), PlanarPose(), _MARKER_SIZE)
    for side in ("back", "left", "right"):
        place = PlanarPose(*config.compute_dock(side))
        _add_site(frame, body, f"{prefix}dock_{side}", place, _MARKER_SIZE)
    _add_sensor_sites(frame, body, prefix, config)


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
    kind, size = mujoco.mjtGeom.mjGEOM_CAPSULE, [ARM_RADIUS, ARM_RADIUS]
    place = [config.arm_reach - ARM_RADIUS, 0, 0]
    nose = add_contact(frame, body, f"{prefix}arm", kind, size, config, place, config.arm_mass)
    nose.quat = make_quarter_turn(x=1.0)
    _add_look(spec, frame, body, "arm", _make_arm_look(config))
    dock = PlanarPose(*config.compute_dock("front"))
    _add_site(frame, body, f"{prefix}dock_front", dock, _MARKER_SIZE)


def make_scout(config: ScoutConfig | None = None) -> mujoco.MjSpec:
    """Return one module alone, on a free joint, with its joints and servos."""
    config = config or ScoutConfig()
    spec = mujoco.MjSpec()
    spec.modelname = "scout"
    spec.compiler.degree = False
    body = spec.worldbody.add_body(name="scout")
    body.add_freejoint(name="root")
    add_chassis(spec, body, "module_0_", PlanarPose(), config)
    arm = body.add_body(name="arm")
    add_joints(spec, arm, 0, PlanarPose(), config, lifts=True)
    add_arm(spec, arm, "module_0_", PlanarPose(), config)
    return spec


def add_joints(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, module: int, pose: PlanarPose, config: ScoutConfig, lifts: bool
) -> None:
    """Add the joints of a module with their servos, `hinge_i` and with two degrees of freedom `twist_i`.

    `lifts` says whether the body that they move is the arm, or the chassis seen from the arm. A positive hinge lifts
    the arm, and what is docked to it, against the chassis; a positive twist, about the long axis of the arm, lifts its
    left side. The hinge is at the chassis, the twist beyond it, in the arm. MuJoCo turns a body about its joints in
    their order, seen from the parent.
    """
    sign = 1.0 if lifts else -1.0
    ahead = sign * np.array([np.cos(pose.heading), np.sin(pose.heading), 0.0])
    joints = [("hinge", np.array([ahead[1], -ahead[0], 0.0]), config.hinge_range, config.hinge_torque)]
    if config.dofs == 2:
        joints.append(("twist", ahead, config.twist_range, config.twist_torque))
    for kind, axis, limit, torque in joints if lifts else reversed(joints):
        name = f"{kind}_{module}"
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


_ACCELEROMETERS = {"front": (0.03, 0.0, 0.02), "rear": (-0.03, 0.0, 0.02)}
"""Where they sit in the frame of the module [m] (estimate)."""
LASER_HEIGHT = 0.02  # Of the laser above the center of the module [m] (estimate)
_SKIN = 0.005
"""The zone in which contacts are felt reaches this far beyond the chassis [m], over all that touches."""
_SENSOR_SIZE = 0.002  # Radius at which sensors are drawn [m]


def _add_sensor_sites(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add the sites of a module's sensors: infrared units, accelerometers, skin, and the head's laser."""
    half = np.array(config.size) / 2
    for side, units in _place_infrared(config).items():
        for k, place in enumerate(units):
            site = _add_site(frame, body, f"{prefix}ir_{side}_{k}", place)
            site.quat = make_quarter_turn(x=-np.sin(place.heading), y=np.cos(place.heading))
    for name, position in _ACCELEROMETERS.items():
        _add_site(frame, body, f"{prefix}accel_{name}").pos = position
    if prefix == "module_0_":
        for k, angle in enumerate(np.linspace(*config.laser_angles, config.laser_beams)):
            site = _add_site(frame, body, f"{prefix}laser_{k}")
            site.pos, site.quat = [half[0], 0.0, LASER_HEIGHT], make_quaternion(0.0, pi / 2 - angle)
    zone = _add_site(frame, body, f"{prefix}touch")
    zone.type, zone.size, zone.rgba = mujoco.mjtGeom.mjGEOM_BOX, half + _SKIN, [0.0, 0.0, 0.0, 0.0]


def _place_infrared(config: ScoutConfig) -> dict[str, list[PlanarPose]]:
    """Return the poses of the two infrared units of each side."""
    half_x, half_y, aside = config.size[0] / 2, config.size[1] / 2, config.ir_spacing / 2
    middles = [(half_x, 0.0, 0.0), (-half_x, 0.0, pi), (0.0, half_y, pi / 2), (0.0, -half_y, -pi / 2)]
    return {
        side: [PlanarPose(*middle).compose(PlanarPose(0.0, offset)) for offset in (aside, -aside)]
        for side, middle in zip(SIDES, middles, strict=True)
    }


def _add_site(
    frame: mujoco.MjsFrame,
    body: mujoco.MjsBody,
    name: str,
    pose: PlanarPose | None = None,
    size: float = _SENSOR_SIZE,
) -> mujoco.MjsSite:
    pose = pose or PlanarPose()
    look = {"size": [size] * 3, "group": _SITE_GROUP}
    site = body.add_site(name=name, pos=pose.position, quat=pose.quaternion, **look)
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
    units = [place for pair in _place_infrared(config).values() for place in pair]
    headings = np.array([place.heading for place in units])
    angles = np.linspace(*config.laser_angles, config.laser_beams)
    laser = [config.size[0] / 2, 0.0, LASER_HEIGHT]
    return ScoutRays(
        np.array([*(place.position for place in units), *([laser] * len(angles))]),
        np.concatenate(
            [
                np.stack([np.cos(headings), np.sin(headings), np.zeros(len(units))], axis=1),
                np.stack([np.cos(angles), np.zeros(len(angles)), np.sin(angles)], axis=1),
            ]
        ),
        np.repeat([config.ir_range, config.laser_range], [len(units), len(angles)]),
    )


VISUAL_GROUP = 1
"""Geom group of what is drawn; rays pass through it and hit the chassis boxes instead, which is faster."""
_COLORS = {
    "dark": (0.17, 0.18, 0.20, 1.0),
    "rubber": (0.07, 0.07, 0.08, 1.0),
    "steel": (0.74, 0.76, 0.78, 1.0),
    "green": (0.28, 0.62, 0.30, 1.0),
    "lens": (0.85, 0.16, 0.12, 1.0),
}
_UNSEEN = "scout_unseen_by_rays"
"""A material without opacity: rays pass, while the color of the geom itself is drawn."""
_BELT_WIDTH = 0.019  # Of the tracks' belts [m]; these and the sizes below are estimated from photographs


def _add_look(
    spec: mujoco.MjSpec,
    frame: mujoco.MjsFrame,
    body: mujoco.MjsBody,
    part: str,
    solids: dict[str, list[trimesh.Trimesh]],
) -> None:
    """Add what is drawn of a part: a mesh for each color, shared by all modules; it changes images alone."""
    if spec.material(_UNSEEN) is None:
        spec.add_material(name=_UNSEEN, rgba=[1.0, 1.0, 1.0, 0.0], specular=0.3, shininess=0.4)
    for color, parts in solids.items():
        name = f"scout_{part}_{color}"
        if spec.mesh(name) is None:
            mesh, shell = trimesh.util.concatenate(parts), mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            shape = {"uservert": mesh.vertices.ravel(), "userface": mesh.faces.astype(np.int32).ravel()}
            spec.add_mesh(name=name, inertia=shell, **shape)
        kind, look = mujoco.mjtGeom.mjGEOM_MESH, {"group": VISUAL_GROUP, "contype": 0, "conaffinity": 0}
        color = _COLORS[color]
        geom = body.add_geom(type=kind, meshname=name, material=_UNSEEN, mass=0, rgba=color, **look)
        geom.set_frame(frame)


def _make_chassis_look(config: ScoutConfig) -> dict[str, list[trimesh.Trimesh]]:
    """Return hull, belts, docking plates, board and eyes of a chassis by color."""
    half_x, half_y, half_z = np.array(config.size) / 2
    hull = _bevel((half_x - 0.006, half_y - _BELT_WIDTH, half_z - 0.008), 0.008)
    belts, discs = [], []
    for side in (1.0, -1.0):
        y = side * half_y
        belts += _make_belt(half_x, half_z, config.track_radius, y - side * _BELT_WIDTH / 2)
        corners = [(a * (half_x - 0.02), y, b * (half_z - 0.02)) for a in (1, -1) for b in (1, -1)]
        discs += [_disc(0.0125, 0.004, center) for center in corners]
        discs.append(_disc(0.020, 0.005, (0.0, y, 0.0)))
    plate = _box((0.003, 0.034, 0.034), (-half_x + 0.0005, 0.0, 0.0))
    bars = [_box((0.005, a, b), (-half_x, 0.0, 0.0)) for a, b in ((0.008, 0.030), (0.030, 0.008))]
    board = _box((0.052, 0.044, 0.004), (-0.006, 0.0, half_z - 0.007))
    eyes = [_disc(0.006, 0.006, (half_x - 0.004, 0.0, 0.020), axis="x")]
    eyes += [_disc(0.0035, 0.004, (half_x - 0.005, y, 0.020), axis="x") for y in (0.022, -0.022)]
    return {"dark": [hull, *bars], "rubber": belts, "steel": [*discs, plate], "green": [board], "lens": eyes}


def _make_arm_look(config: ScoutConfig) -> dict[str, list[trimesh.Trimesh]]:
    """Return two plates to the hinge and the docking plate in front by color."""
    near, reach = config.size[0] / 2 - 0.012, config.arm_reach
    middle = (near + reach) / 2 - 0.004
    plates = [_box((reach - near, 0.004, 0.020), (middle, y, 0.0)) for y in (-0.024, 0.024)]
    front = _bevel((0.005, 0.030, 0.5 * 0.046), 0.004)
    front.apply_translation((reach - 0.006, 0.0, 0.0))
    bars = [_box((0.004, a, b), (reach, 0.0, 0.0)) for a, b in ((0.008, 0.036), (0.036, 0.008))]
    axle = _disc(ARM_RADIUS * 0.6, 0.056, (near + 0.008, 0.0, 0.0))
    return {"steel": [*plates, front, axle], "dark": bars}


def _make_belt(half_x: float, half_z: float, radius: float, y: float) -> list[trimesh.Trimesh]:
    """Return a belt round four corners, and its treads."""
    angles = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    turn = np.stack([np.cos(angles), np.sin(angles)])
    rim = np.sign(turn) * [[half_x - radius], [half_z - radius]] + (radius - 0.001) * turn
    outline = [(x, y + dy, z) for dy in (-_BELT_WIDTH / 2, _BELT_WIDTH / 2) for x, z in rim.T]
    parts = [trimesh.convex.convex_hull(np.array(outline))]
    for x in np.linspace(-half_x + 0.012, half_x - 0.012, 9):
        parts += [_box((0.004, _BELT_WIDTH, 0.002), (x, y, z)) for z in (half_z - 0.001, -half_z + 0.001)]
    for z in np.linspace(-half_z + 0.018, half_z - 0.018, 7):
        parts += [_box((0.002, _BELT_WIDTH, 0.004), (x, y, z)) for x in (half_x - 0.001, -half_x + 0.001)]
    return parts


def _box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(center)


def _bevel(half: tuple[float, float, float], edge: float) -> trimesh.Trimesh:
    """Return a box with its edges cut off."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    points = [corners * (np.array(half) - edge * (1 - np.eye(3)[axis])) for axis in range(3)]
    return trimesh.convex.convex_hull(np.concatenate(points))


def _disc(
    radius: float, height: float, center: tuple[float, float, float], axis: str = "y"
) -> trimesh.Trimesh:
    turn = [1.0, 0.0, 0.0] if axis == "y" else [0.0, 1.0, 0.0]
    disc = trimesh.creation.cylinder(radius, height, sections=24)
    disc.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, turn))
    return disc.apply_translation(center)
