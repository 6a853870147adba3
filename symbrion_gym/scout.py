"""One Scout module of the Symbrion project as part of a MuJoCo model, and the numbers behind it.

Frame of a module: origin in the centre of the chassis, x forward (towards the hinged arm), y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import mujoco
import numpy as np

from symbrion_gym.errors import OrganismError

TRACK_MODELS = ("spheres", "wheels", "cylinders")
CONTACT_GROUP = 4
"""Geom group of what touches; not drawn unless asked for."""
VISUAL_GROUP = 1
"""Geom group of what is drawn and hit by rays."""
LARGEST_ACCELERATION = 4 * 9.81
"""Range of an accelerometer [m/s²] (estimate)."""
LARGEST_TOUCH = 50.0
"""Range of the touch reading [N]."""
ARM_RADIUS = 0.015
"""The arm ends in a rounded bar across, 60 mm wide and of this radius [m] (estimate)."""
_CYLINDER_RADIUS = 0.011
_CYLINDER_CHASSIS = (0.033, 0.040, 0.040)
"""Half sizes of the chassis within the authors' cylinders [m] (estimate)."""
_WHEEL_GAIN = 2.0
"""Torque of a wheel's servo per error of its rate [N m s/rad]: stiff, so that wheels keep their speed."""
SIDES = ("front", "back", "left", "right")

_GREEN, _DARK, _STEEL, _RUBBER = (
    (0.36, 0.55, 0.22, 1.0),
    (0.16, 0.17, 0.18, 1.0),
    (0.72, 0.73, 0.74, 1.0),
    (0.09, 0.09, 0.09, 1.0),
)


@dataclass(frozen=True)
class ScoutConfig:
    """Constants of a module. Source in brackets; E marks an estimate of ours.

    [R] Russo et al. (2013), IEEE/ASME Trans. Mechatronics 18(6). [S] the authors' simulator, danfis/sim,
    and the configurations of symbrion-morph.

    Attributes:
        size: edge of the chassis along x, y and z [m] [R: 105 x 105 mm; 123.5 mm with the arm].
        dock_reach: distance of the back, left and right dock from the centre [m] [S].
        arm_reach: distance of the front dock, on the hinged arm, from the centre [m] [S].
        pitch: distance of two modules docked front to back [m] [S]; the docks' own depth is the rest.
        chassis_mass: [kg] [E; R: a module is below 1 kg; S: chassis to arm as 5 to 1, not measured there].
        arm_mass: [kg] [E, as above].
        hinge_range: largest angle of the hinge to either side [rad] [R].
        hinge_torque: largest torque [N m] [E: 4-5].
        hinge_speed: speed at which the servo's target moves [rad/s] [E: 0.5-1 loaded].
        hinge_stiffness: gain of the position servo [N m/rad] [E].
        hinge_derivative: gain of the servo on the rate [N m s/rad] [E].
        hinge_armature: inertia of motor and gear at the hinge [kg m²] [E].
        hinge_damping: [N m s/rad] [E].
        track_speed: surface speed of the tracks [m/s] [E: 0.06-0.15].
        track_radius: radius of a road wheel, a sphere, of a track [m] [E; S: cylinders of 11 mm].
        friction: sliding friction of the tracks on the ground [E].
        dock_force: force that a docking unit holds [N] [E]; a larger one is reported, docks never tear.
        ir_range: range of an infrared proximity unit [m] [E].
        laser_range: range of the forward laser [m] [E].
        laser_angle: half the opening angle of the laser [rad] [E].
        tracks: "spheres" (surface velocity, no joint), "wheels" (four driven wheels), "cylinders" (the
            authors' twelve small cylinders, driven).
    """

    size: tuple[float, float, float] = (0.105, 0.105, 0.105)
    dock_reach: float = 0.0525
    arm_reach: float = 0.072
    pitch: float = 0.1254
    chassis_mass: float = 0.79
    arm_mass: float = 0.16
    hinge_range: float = pi / 2
    hinge_torque: float = 4.5
    hinge_speed: float = 0.8
    hinge_stiffness: float = 60.0
    hinge_derivative: float = 3.0
    hinge_armature: float = 0.01
    hinge_damping: float = 0.05
    track_speed: float = 0.10
    track_radius: float = 0.020
    friction: float = 0.7
    dock_force: float = 100.0
    ir_range: float = 0.20
    laser_range: float = 4.0
    laser_angle: float = pi / 3
    tracks: str = "spheres"

    def __post_init__(self) -> None:
        positive = (
            "dock_reach arm_reach pitch chassis_mass arm_mass hinge_range hinge_torque hinge_speed "
            "hinge_stiffness track_radius friction dock_force ir_range laser_range laser_angle"
        )
        for name in positive.split():
            if not 0.0 < getattr(self, name) < np.inf:
                raise OrganismError(f"ScoutConfig: {name} must be above 0, got {getattr(self, name)}")
        for name in ("hinge_derivative", "hinge_armature", "hinge_damping", "track_speed"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise OrganismError(f"ScoutConfig: {name} must not be negative, got {getattr(self, name)}")
        if self.tracks not in TRACK_MODELS:
            raise OrganismError(f"no tracks {self.tracks!r}; there are: {', '.join(TRACK_MODELS)}")

    @property
    def dock_gap(self) -> float:
        """What the two docking units add between a front and a back dock [m]."""
        return self.pitch - self.arm_reach - self.dock_reach

    def find_dock(self, side: str) -> tuple[float, float, float]:
        """Return x [m], y [m] and heading [rad] of a dock in the frame of the module.

        Raises:
            OrganismError: no such side.
        """
        places = {
            "front": (self.arm_reach, 0.0, 0.0),
            "back": (-self.dock_reach, 0.0, pi),
            "left": (0.0, self.dock_reach, pi / 2),
            "right": (0.0, -self.dock_reach, -pi / 2),
        }
        if side not in places:
            raise OrganismError(f"no dock {side!r}; there are: {', '.join(SIDES)}")
        return places[side]


def find_road_wheels(config: ScoutConfig) -> list[tuple[float, float, float]]:
    """Return the centres of the spheres of both tracks in the frame of the module [m].

    Five a side: three below and two above, so that the envelope is the chassis with rounded edges.
    """
    half_x, half_y, half_z = (edge / 2 - config.track_radius for edge in config.size)
    places = [(half_x, -half_z), (0.0, -half_z), (-half_x, -half_z), (half_x, half_z), (-half_x, half_z)]
    return [(x, y, z) for y in (half_y, -half_y) for x, z in places]


def find_track_field(config: ScoutConfig, speed: float) -> tuple[float, ...]:
    """Return the surface velocity of a road wheel that drives forward: it turns about its own y axis.

    At the ground the surface runs backwards, at a wall ahead it runs down, as the belt round a wheel does.
    """
    return (0.0, 0.0, 0.0, 0.0, speed / config.track_radius, 0.0)


def add_chassis(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, pose: Pose, config: ScoutConfig
) -> None:
    """Add chassis, tracks, docks and sensors of one module to a body.

    Args:
        spec: the model under construction.
        body: what carries the chassis.
        prefix: put before every name, such as "module_3_".
        pose: the module in the frame of the body.
        config: constants.
    """
    half = np.array(config.size) / 2
    recess = 0.45 * config.track_radius
    frame = body.add_frame(pos=pose.position, quat=pose.quaternion)
    _add_contact(
        frame,
        body,
        f"{prefix}chassis",
        mujoco.mjtGeom.mjGEOM_BOX,
        np.array(_CYLINDER_CHASSIS) if config.tracks == "cylinders" else half - recess,
        config,
        mass=config.chassis_mass,
    )
    _add_chassis_visuals(frame, body, prefix, config)
    if config.tracks == "spheres":
        field = find_track_field(config, config.track_speed)
        for i, place in enumerate(find_road_wheels(config)):
            geom = _add_contact(
                frame,
                body,
                f"{prefix}track_{i}",
                mujoco.mjtGeom.mjGEOM_SPHERE,
                [config.track_radius, 0, 0],
                config,
                pos=place,
            )
            geom.surfacevel = field
    else:
        _add_wheels(spec, body, prefix, pose, config)
    body.add_site(name=prefix.rstrip("_"), size=[0.004] * 3, group=5).set_frame(frame)
    for side in ("back", "left", "right"):
        _add_dock(frame, body, prefix, side, config)
    for name, x in (("front", 0.03), ("rear", -0.03)):
        site = body.add_site(name=f"{prefix}accel_{name}", pos=[x, 0, 0.02], size=[0.004] * 3, group=5)
        site.set_frame(frame)
    zone = body.add_site(
        name=f"{prefix}touch", type=mujoco.mjtGeom.mjGEOM_BOX, size=half + 0.005, group=5, rgba=[0, 0, 0, 0]
    )
    zone.set_frame(frame)


def add_arm(
    body: mujoco.MjsBody, prefix: str, pose: Pose, config: ScoutConfig, is_folded: bool = False
) -> None:
    """Add the hinged arm of one module, with the front dock, to the body that it is part of.

    Args:
        body: what carries the arm.
        prefix: put before every name.
        pose: the module in the frame of the body.
        config: constants.
        is_folded: a free arm is held up, out of the way of the tracks.
    """
    lift = [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0] if is_folded else [1.0, 0.0, 0.0, 0.0]
    quaternion = np.empty(4)
    mujoco.mju_mulQuat(quaternion, np.array(pose.quaternion), np.array(lift))
    frame = body.add_frame(pos=pose.position, quat=quaternion)
    nose = _add_contact(
        frame,
        body,
        f"{prefix}arm",
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        [ARM_RADIUS, ARM_RADIUS],
        config,
        pos=[config.arm_reach - ARM_RADIUS, 0, 0],
        mass=config.arm_mass,
    )
    nose.quat = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    _add_arm_visuals(frame, body, prefix, config)
    _add_dock(frame, body, prefix, "front", config)


@dataclass(frozen=True)
class Pose:
    """A place in the plane of a body.

    Attributes:
        x: [m].
        y: [m].
        heading: about z [rad].
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    @property
    def position(self) -> list[float]:
        """As MuJoCo wants it, `[3]` [m]."""
        return [self.x, self.y, 0.0]

    @property
    def quaternion(self) -> list[float]:
        """As MuJoCo wants it, w first."""
        return [np.cos(self.heading / 2), 0.0, 0.0, np.sin(self.heading / 2)]

    def compose(self, other: Pose) -> Pose:
        """Return the pose of `other`, given in this frame, in the frame of this one's parent."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return Pose(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            self.heading + other.heading,
        )

    def invert(self) -> Pose:
        """Return the pose of the parent in this frame."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.heading)


def _add_contact(frame, body, name, kind, size, config, pos=(0.0, 0.0, 0.0), mass=0.0):
    size = [*size, 0.0, 0.0][:3]
    geom = body.add_geom(
        name=name,
        type=kind,
        size=size,
        pos=pos,
        mass=mass,
        group=CONTACT_GROUP,
        condim=3,
        priority=1,
        friction=[config.friction, 0.005, 0.0001],
        rgba=[0.9, 0.4, 0.1, 0.0],
    )
    geom.set_frame(frame)
    return geom


def _add_visual(frame, body, kind, size, pos=(0.0, 0.0, 0.0), rgba=_STEEL, quat=(1.0, 0.0, 0.0, 0.0)):
    size = [*size, 0.0, 0.0][:3]
    geom = body.add_geom(
        type=kind,
        size=size,
        pos=pos,
        quat=quat,
        mass=0,
        group=VISUAL_GROUP,
        contype=0,
        conaffinity=0,
        rgba=rgba,
    )
    geom.set_frame(frame)
    return geom


def _add_chassis_visuals(frame, body, prefix, config):
    box = mujoco.mjtGeom.mjGEOM_BOX
    half_x, half_y, half_z = np.array(config.size) / 2
    _add_visual(frame, body, box, [0.044, 0.030, 0.044], rgba=_DARK)
    _add_visual(frame, body, box, [0.036, 0.024, 0.003], pos=[0, 0, 0.046], rgba=_GREEN)
    for side in (1, -1):
        y = side * (half_y - 0.010)
        _add_visual(frame, body, box, [half_x - 0.02, 0.010, half_z], pos=[0, y, 0], rgba=_RUBBER)
        _add_visual(frame, body, box, [half_x, 0.010, half_z - 0.02], pos=[0, y, 0], rgba=_RUBBER)


def _add_arm_visuals(frame, body, prefix, config):
    box = mujoco.mjtGeom.mjGEOM_BOX
    _add_visual(frame, body, box, [0.006, 0.030, 0.030], pos=[config.arm_reach - 0.006, 0, 0], rgba=_STEEL)
    _add_visual(frame, body, box, [0.016, 0.018, 0.012], pos=[config.arm_reach - 0.024, 0, 0], rgba=_STEEL)


def _add_dock(frame, body, prefix, side, config):
    x, y, heading = config.find_dock(side)
    site = body.add_site(
        name=f"{prefix}dock_{side}",
        pos=[x, y, 0],
        quat=[np.cos(heading / 2), 0, 0, np.sin(heading / 2)],
        size=[0.004] * 3,
        group=5,
    )
    site.set_frame(frame)


def find_driven_wheels(config: ScoutConfig) -> list[tuple[float, float, float]]:
    """Return the centres of the driven wheels of the models with wheel joints, in the frame of the module [m].

    "wheels" are the road wheels of the spheres; "cylinders" the authors' six a side [S].
    """
    if config.tracks == "wheels":
        return find_road_wheels(config)
    places = [(x, z) for z in (0.042, -0.042) for x in (0.025, -0.016)] + [
        (-0.0425, z) for z in (0.016, -0.016)
    ]
    return [(x, y, z) for y in (0.0458, -0.0458) for x, z in places]


def find_wheel_radius(config: ScoutConfig) -> float:
    """Return the radius of what drives [m]."""
    return _CYLINDER_RADIUS if config.tracks == "cylinders" else config.track_radius


def _add_wheels(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, prefix: str, pose: Pose, config: ScoutConfig
) -> None:
    """Add driven wheels, each a body of its own with a joint and a velocity servo.

    Wheels touch everything but other wheels, as those of a side overlap.
    """
    radius = find_wheel_radius(config)
    for i, (x, y, z) in enumerate(find_driven_wheels(config)):
        place = pose.compose(Pose(x, y))
        wheel = body.add_body(name=f"{prefix}wheel_{i}", pos=[place.x, place.y, z], quat=pose.quaternion)
        wheel.add_joint(
            name=f"{prefix}wheel_{i}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            armature=1e-4,
            limited=mujoco.mjtLimited.mjLIMITED_FALSE,
        )
        is_sphere = config.tracks == "wheels"
        kind = mujoco.mjtGeom.mjGEOM_SPHERE if is_sphere else mujoco.mjtGeom.mjGEOM_CYLINDER
        geom = _add_contact(
            wheel.add_frame(),
            wheel,
            f"{prefix}track_{i}",
            kind,
            [radius, 0.004],
            config,
            mass=0.002,
        )
        geom.quat = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
        geom.conaffinity = 0
        servo = spec.add_actuator(
            name=f"{prefix}wheel_{i}", trntype=mujoco.mjtTrn.mjTRN_JOINT, target=f"{prefix}wheel_{i}"
        )
        servo.set_to_velocity(kv=_WHEEL_GAIN)


def add_accelerometers(spec: mujoco.MjSpec, module: int) -> None:
    """Add the front and rear accelerometer of a module, three numbers each [m/s²], clipped at 4 g."""
    for name in ("front", "rear"):
        spec.add_sensor(
            name=f"module_{module}_accel_{name}",
            type=mujoco.mjtSensor.mjSENS_ACCELEROMETER,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=f"module_{module}_accel_{name}",
            cutoff=LARGEST_ACCELERATION,
        )


def add_touch(spec: mujoco.MjSpec, module: int) -> None:
    """Add the sum of the normal forces on a module [N], clipped at 50 N; an aid, the Scout has no such skin."""
    spec.add_sensor(
        name=f"module_{module}_touch",
        type=mujoco.mjtSensor.mjSENS_TOUCH,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=f"module_{module}_touch",
        cutoff=LARGEST_TOUCH,
    )


def make_scout(config: ScoutConfig | None = None, is_hinged: bool = True) -> mujoco.MjSpec:
    """Return one module alone, on a free joint, with its hinge and servo."""
    config = config or ScoutConfig()
    spec = mujoco.MjSpec()
    spec.modelname = "scout"
    spec.compiler.degree = False
    body = spec.worldbody.add_body(name="scout")
    body.add_freejoint(name="root")
    add_chassis(spec, body, "module_0_", Pose(), config)
    arm = body
    if is_hinged:
        arm = body.add_body(name="arm")
        add_hinge(spec, arm, "hinge_0", Pose(), config, lifts=True)
    add_arm(arm, "module_0_", Pose(), config)
    return spec


def add_hinge(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, pose: Pose, config: ScoutConfig, lifts: bool
) -> None:
    """Add the main hinge of a module, with its servo, to the body that it moves.

    A positive angle lifts the arm, and what is docked to it, against the chassis.

    Args:
        spec: the model under construction.
        body: the moving side.
        name: of joint and actuator.
        pose: the module in the frame of the body.
        config: constants.
        lifts: whether the body is the side of the arm (else that of the chassis).
    """
    sign = -1.0 if lifts else 1.0
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        pos=pose.position,
        axis=[-sign * np.sin(pose.heading), sign * np.cos(pose.heading), 0.0],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=[-config.hinge_range, config.hinge_range],
        armature=config.hinge_armature,
        damping=[config.hinge_damping, 0, 0],
    )
    servo = spec.add_actuator(
        name=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=name,
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=[-config.hinge_range, config.hinge_range],
        forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        forcerange=[-config.hinge_torque, config.hinge_torque],
    )
    servo.set_to_position(kp=config.hinge_stiffness, kv=config.hinge_derivative)
