"""Two tracks for any robot of a MuJoCo model: `add_tracks`, the handle that drives them, and how they turn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from math import isfinite
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import least_squares

from reconstruction._src.base.range_checks import check_choice, check_counts, check_positive
from reconstruction._src.geometry.pose import make_quarter_turn
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.scout_constants import OTHER_FRICTION

_GRAVITY = 9.81  # [m/s²]
_LEAST_IMPEDANCE, _LARGEST_IMPEDANCE = 0.9, 0.95  # MuJoCo's defaults of `solimp`
_LEAST_SLIP = 1e-5  # Slip below which friction grows in proportion to it [m/s]: keeps the balance smooth
_STAGES = 12  # The gain is reached in as many stages, so that each balance starts near its solution


class Contacts(NamedTuple):
    """Where a robot's belts touch the ground."""

    points: Float[np.ndarray, "N 2"]  # x ahead and y left of the robot's middle [m]
    belts: Float[np.ndarray, " N"]  # speed of the belt at each [m/s]
    owner: Int[np.ndarray, " N"]  # index of the body that each belongs to
    centers: Float[np.ndarray, "bodies 2"]  # (x, y) of the center of mass of each body [m]
    weights: Float[np.ndarray, " bodies"]  # of each body; their sum does not matter


def compute_load_gain(friction: float, impratio: float = 1.0, time_constant: float = 0.02) -> float:
    """Return by how much the share of a body's weight at a contact grows with the speed of sliding [s/m].

    A contact is a damped spring of acceleration, b = 2 / (d_max time_constant), that bears its share with impedance d.
    In an elliptic cone, sliding with s acts like approaching with friction s, so the share grows by
    friction b d / ((1 - d) g (1 + friction² / impratio)). Nothing in it is fitted.

    References:
        MuJoCo's documentation, Computation, sections Constraint model and Solver parameters: impedance, reference
        acceleration, elliptic cones. Anitescu (2006), Math. Programming 105: why a convex model of friction couples
        sliding to the normal.
    """
    damping = 2.0 / (_LARGEST_IMPEDANCE * time_constant)
    stiff = _LEAST_IMPEDANCE / ((1.0 - _LEAST_IMPEDANCE) * _GRAVITY)
    return friction * damping * stiff / (1.0 + friction**2 / impratio)


def compute_sliding_rate(contacts: Contacts, gain: float) -> float:
    """Return the rate at which a robot turns to the left whose points of contact all slide [rad/s].

    Unknown are its motion and, for each body, how it lies on the ground: height and two tilts. Loads grow with depth
    and, by the gain, with sliding; none pulls; in each body they balance its weight; in the whole, friction balances.

    References:
        Wong and Chiang (2001), A general theory for skid steering of tracked vehicles on firm ground,
        Proc. IMechE D 215, with isotropic Coulomb friction and no centrifugal force: the case without gain.
    """
    speed, reach = float(np.abs(contacts.belts).max()), float(np.abs(contacts.points).max())
    if speed == 0.0:
        return 0.0
    left = contacts.points[:, 1] > 0
    sides = [contacts.belts[side].mean() / speed for side in (left, ~left)]
    motion = [np.mean(sides), 0.0, (sides[1] - sides[0]) / 2]
    guess = np.concatenate([motion, np.tile([1.0, 0.0, 0.0], len(contacts.weights))])
    for each in np.geomspace(1e-2, 1.0, _STAGES) * gain if gain > 0 else [0.0]:
        scales = (contacts, each, speed, reach)
        guess = least_squares(_sum_forces, guess, args=scales, xtol=1e-12, ftol=1e-12).x
    return float(guess[2] * speed / reach)


def _sum_forces(
    unknown: Float[np.ndarray, " U"], contacts: Contacts, gain: float, speed: float, reach: float
) -> Float[np.ndarray, " U"]:
    """Return what is not balanced: friction in the plane, then weight and tilting of each body."""
    x, y = contacts.points.T
    ahead, left, turn = unknown[0] * speed, unknown[1] * speed, unknown[2] * speed / reach
    slip = np.stack([ahead - turn * y - contacts.belts, left + turn * x])
    size = np.hypot(np.linalg.norm(slip, axis=0), _LEAST_SLIP)
    loads, sums = np.zeros(len(x)), []
    for body, (lying, center) in enumerate(zip(unknown[3:].reshape(-1, 3), contacts.centers, strict=True)):
        mine = contacts.owner == body
        arms = (contacts.points[mine] - center) / reach
        share = (lying[0] + arms @ lying[1:]) / mine.sum() + gain * (size[mine] - size[mine].mean())
        share = np.maximum(share, 0.0)
        loads[mine] = share * contacts.weights[body] / contacts.weights.sum()
        sums += [share.sum() - 1.0, *(share @ arms)]
    force = loads * slip / size
    moment = (x * force[1] - y * force[0]).sum() / reach
    return np.array([*force.sum(axis=1), moment, *sums])


BELT_MODELS = ("belts", "wheels")
_STILL = 1e-9
"""Surface velocity at compilation [rad/s]: MuJoCo ignores those that are written later to a model without any."""
_PARTS = 3  # Geoms of a belt
_RUBBER = (0.12, 0.12, 0.13, 1.0)


@dataclass(frozen=True)
class TracksConfig:
    """Two tracks, side by side.

    Raises:
        OrganismError: a value is out of range.
    """

    length: float = 0.4  # of a belt, over all [m]
    gauge: float = 0.3  # distance between the middles of both belts [m]
    width: float = 0.06  # of a belt [m]
    height: float = 0.1  # of a belt, twice the radius of the wheels at its ends [m]
    # middle between both belts in the frame of the body; x is ahead, y left, z up [m]
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass: float = 1.0  # of both belts together [kg]
    # sliding friction on the ground; it replaces that of the ground, but not that of a friction patch
    friction: float = 0.7
    # "belts" are geoms of the body with a surface velocity, without joints; "wheels" are driven wheels with
    # nothing between them and an actuator a side, so that the speed is a control. They turn 7 to 30 % slower
    # than `Tracks.turning_rate` says, and need the integrator `implicitfast`.
    model: str = "belts"
    num_wheels: int = 2  # of "wheels", a side
    # inertia of motor and gear of "wheels", as a mass that moves with the belt [kg]: with less, stiff wheels
    # tremble
    motor_mass: float = 5.0
    # pull of a belt per error of its speed [N s/m], of "wheels": stiff, so that slopes hardly slow it down
    gain: float = 5000.0
    max_force: float = 100.0  # largest pull of a belt [N], of "wheels"

    def __post_init__(self) -> None:
        positive = "length gauge width height mass friction motor_mass gain max_force"
        check_positive(self, positive.split(), OrganismError)
        check_counts(self, ("num_wheels",), OrganismError)
        check_choice("model", self.model, BELT_MODELS, OrganismError)
        if self.num_wheels < 2:
            raise OrganismError(f"num_wheels is {self.num_wheels}; a side needs 2 or more")
        if self.length <= self.height:
            raise OrganismError(f"a belt is longer than its height of {self.height} m: raise length")
        if self.gauge < self.width:
            raise OrganismError(f"belts {self.width} m wide overlap at {self.gauge} m: raise gauge")
        if len(self.position) != 3 or not all(isfinite(value) for value in self.position):
            raise OrganismError(f"position is {self.position!r}; three finite coordinates are needed [m]")

    @property
    def stations(self) -> Float[np.ndarray, " S"]:
        """Places along a belt where the ground carries it, from the middle [m]."""
        reach = (self.length - self.height) / 2
        return np.linspace(-reach, reach, self.num_wheels if self.model == "wheels" else 2)

    @property
    def places(self) -> Float[np.ndarray, "P 2"]:
        """Where the ground carries both belts: their edges at the stations, (x, y) in the frame of the body [m]."""
        edges = np.array([self.gauge - self.width, self.gauge + self.width]) / 2
        grid = np.meshgrid(self.stations, [*edges, *-edges], indexing="ij")
        return np.stack([axis.ravel() for axis in grid], axis=1) + self.position[:2]


@dataclass(frozen=True)
class Tracks:
    """The tracks of a robot, by their names: they hold in every model that is compiled of the spec."""

    config: TracksConfig  # their sizes
    prefix: str = ""  # put before the names of their geoms, joints and actuators

    def renamed(self, prefix: str) -> "Tracks":
        """Return the handle for a model into which the spec was attached with a prefix."""
        return replace(self, prefix=prefix + self.prefix)

    def drive(self, model: mujoco.MjModel, data: mujoco.MjData, left: float, right: float) -> None:
        """Set the speeds of both belts, from now on.

        Belts have no control in MuJoCo: `model.geom_surfacevel` is written, also where several simulations share the
        model. Wheels are driven by `data.ctrl`, which this writes.
        """
        for side, speed in (("left", left), ("right", right)):
            if not isfinite(speed):
                raise OrganismError(
                    f"the speed of the {side} belt is {speed}; finite numbers are needed [m/s]"
                )
            name = f"{self.prefix}belt_{side}"
            if self.config.model == "wheels":
                data.ctrl[_find_id(model.actuator, name)] = speed
                continue
            for i in range(_PARTS):
                geom = _find_id(model.geom, f"{name}_{i}")
                model.geom_surfacevel[geom] = _compute_belt_velocity(self.config, speed, is_end=i < 2)

    def turning_rate(self, left: float, right: float, others: "Sequence[Tracks]" = ()) -> float:
        """Return how fast the robot turns to the left on level ground [rad/s].

        Two tracks alone have equal loads at the ends of the belts. With more tracks before or behind, loads are those
        of MuJoCo's contacts: nearly all of it at the outermost ends, where belts slide fastest, so that the robot turns
        several times slower than on two of them.
        """
        points = np.concatenate([tracks.config.places for tracks in (self, *others)])
        points -= (points.max(axis=0) + points.min(axis=0)) / 2
        belts, owner = np.where(points[:, 1] > 0, left, right), np.zeros(len(points), int)
        gain = compute_load_gain(self.config.friction) if others else 0.0
        return compute_sliding_rate(Contacts(points, belts, owner, np.zeros((1, 2)), np.ones(1)), gain)


def _find_id(find: Callable[[str], Any], name: str) -> int:
    try:
        return find(name).id
    except KeyError as error:
        remedy = "after spec.attach(..., prefix) use tracks.renamed(prefix)"
        raise OrganismError(f"the model has no {name!r}; {remedy}") from error


def _compute_belt_velocity(config: TracksConfig, speed: float, is_end: bool) -> tuple[float, ...]:
    """Return the surface velocity of a part of a belt: linear [m/s], then angular [rad/s].

    It turns about the lateral axis, also in a box: MuJoCo keeps what is tangential, so that the lower side runs
    backwards, the upper side ahead. The axis of an end wheel, a cylinder, is its own z.
    """
    rate = 2.0 * speed / config.height
    return (0.0, 0.0, 0.0, 0.0, 0.0, rate) if is_end else (0.0, 0.0, 0.0, 0.0, rate, 0.0)


def add_tracks(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody | str,
    config: TracksConfig | None = None,
    *,
    prefix: str = "",
    **sizes: Any,
) -> Tracks:
    """Add two tracks to a body of any spec; the body's x axis points ahead, its z axis up.

    The speeds of the belts stay 0 until `Tracks.drive`. A robot with four tracks calls it twice, with two prefixes.
    It sets the friction cone of the spec to elliptic: with pyramids, MuJoCo's default, tracks hardly turn (0.07 instead
    of 0.65 rad/s). Where the spec is attached to another one, set `option.cone` there. With the model "wheels" the
    actuators `{prefix}belt_left` and `{prefix}belt_right` have the speeds [m/s] as controls; "belts" need MuJoCo 4.

    Args:
        spec: the model under construction; it is changed.
        body: what carries the tracks, or its name.
        config: sizes; None for the defaults.
        prefix: put before every name.
        sizes: fields of `TracksConfig` that differ from `config`.

    Returns:
        The handle that drives the tracks.

    Raises:
        OrganismError: a value is out of range, there is no such size or body, or a name is taken.
    """
    for name in sizes:
        check_choice("tracks", name, [field.name for field in fields(TracksConfig)], OrganismError)
    config = replace(config or TracksConfig(), **sizes)
    carrier = spec.body(body) if isinstance(body, str) else body
    if carrier is None:
        names = ", ".join(repr(one.name) for one in spec.bodies)
        raise OrganismError(f"the spec has no body {body!r}; there are: {names}")
    if any(geom.name == f"{prefix}belt_left_0" for geom in spec.geoms):
        raise OrganismError(f"the spec has tracks with the prefix {prefix!r}; give another prefix")
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    for side, lateral in (("left", config.gauge / 2), ("right", -config.gauge / 2)):
        add = _add_wheels if config.model == "wheels" else _add_belt
        add(spec, carrier, f"{prefix}belt_{side}", config, lateral)
    return Tracks(config, prefix)


def _add_belt(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, config: TracksConfig, lateral: float
) -> None:
    """Add a belt: the end wheel behind, the one ahead, and the box between them."""
    share = config.mass / 2 / _PARTS
    for i, x in enumerate([*config.stations, 0.0]):
        place = np.add(config.position, (x, lateral, 0.0))
        geom = _add_geom(body, f"{name}_{i}", place, share, config, is_wheel=i < 2)
        geom.surfacevel = _compute_belt_velocity(config, _STILL, is_end=i < 2)


def _add_wheels(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, config: TracksConfig, lateral: float
) -> None:
    """Add driven wheels that turn alike, and the servo of their belt, on the mean of their circumferences' ways."""
    count, joint = len(config.stations), mujoco.mjtJoint.mjJNT_HINGE
    belt = spec.add_tendon(name=name)
    inertia = config.motor_mass * (config.height / 2) ** 2 / count
    for i, x in enumerate(config.stations):
        wheel = body.add_body(name=f"{name}_{i}", pos=np.add(config.position, (x, lateral, 0.0)))
        wheel.add_joint(name=f"{name}_{i}", type=joint, axis=[0, 1, 0], armature=inertia)
        _add_geom(wheel, f"{name}_{i}", np.zeros(3), config.mass / 2 / count, config, is_wheel=True)
        belt.wrap_joint(f"{name}_{i}", config.height / 2 / count)
        if i > 0:
            equal = spec.add_equality(name=f"{name}_{i}", type=mujoco.mjtEq.mjEQ_JOINT)
            equal.name1, equal.name2 = f"{name}_{i}", f"{name}_0"
            equal.data[:5] = [0.0, 1.0, 0.0, 0.0, 0.0]
    servo = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_TENDON, target=name)
    servo.set_to_velocity(kv=config.gain)
    servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    servo.forcerange = [-config.max_force, config.max_force]


def _add_geom(
    body: mujoco.MjsBody,
    name: str,
    place: Float[np.ndarray, " 3"],
    mass: float,
    config: TracksConfig,
    is_wheel: bool,
) -> mujoco.MjsGeom:
    """Add a wheel or the box of a belt; they touch everything but each other."""
    radius, half_width = config.height / 2, config.width / 2
    half_length = (config.length - config.height) / 2
    geom = body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER if is_wheel else mujoco.mjtGeom.mjGEOM_BOX,
        size=[radius, half_width, 0.0] if is_wheel else [half_length, half_width, radius],
        pos=place,
        mass=mass,
        condim=3,
        priority=1,
        conaffinity=0,
        friction=[config.friction, *OTHER_FRICTION],
        rgba=_RUBBER,
    )
    if is_wheel:
        geom.quat = make_quarter_turn(x=-1.0)
    return geom
