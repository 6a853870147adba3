"""The numbers behind a Scout module, each with its source, and the parts of its observation."""

from dataclasses import dataclass, fields
from math import pi

from reconstruction._src.base.range_checks import as_floats, check_counts, check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError, OrganismError

SIDES = ("front", "back", "left", "right")
CONTACT_GROUP = 4  # Geom group of what touches; not drawn unless asked for
SCOUT_LIMITS = {"friction": (1e-3, 5.0), "track_speed": (0.0, 2.0), "hinge_torque": (1e-3, 100.0)}
"""Smallest and largest value of what options set: within these a snake sinks by less than 10 mm into the ground."""
OTHER_FRICTION = (0.005, 0.0001)
"""Torsional and rolling friction [m]: MuJoCo's defaults, without effect in contacts of three dimensions."""
ARM_RADIUS = 0.015  # The arm ends in a rounded bar across, 60 mm wide and of this radius [m] (estimate)


@dataclass(frozen=True)
class ScoutConfig:
    """Constants of a module. Source in brackets; E marks an estimate of ours.

    [R] Russo et al. (2013), IEEE/ASME Trans. Mechatronics 18(6). [S] the authors' simulator, danfis/sim,
    and the configurations of symbrion-morph. [M] the control program of the robots, symbrion-morph.

    Attributes:
        size: edge of the chassis along x, y and z [m] [R: 105 x 105 mm; 123.5 mm with the arm].
        dock_reach: distance of the back, left and right dock from the center [m] [S].
        arm_reach: distance of the front dock, on the hinged arm, from the center [m] [S].
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
        acceleration_range: largest reading of an accelerometer [m/s²] [E: 4 g].
        contact_range: largest reading of the force on a module's skin [N] [E].
        ir_range: range of an infrared proximity unit [m] [E].
        ir_spacing: distance between the two infrared units of a side [m] [E].
        laser_range: range of the forward laser [m] [E].
        laser_beams: number of beams of the laser's vertical scan [E].
        laser_angles: angles of its lowest and highest beam above the horizontal [rad] [E].
        dofs: rotational degrees of freedom. The robot has 2 [R]; the authors' simulator has 1 [S], the hinge. The axis
            of the second is not in the sources at hand: [R] says "for reconfiguration and macrolocomotion", [M] has two
            commands, one for the hinge and one that rotates a docking unit. So it turns the front dock, and what is
            docked to it, about the long axis of the arm [E].
        twist_range: largest angle of that rotation to either side [rad] [E].
        twist_torque: its largest torque [N m] [E]; speed, gains, inertia and damping are those of the hinge.
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
    hinge_stiffness: float = 120.0
    hinge_derivative: float = 6.0
    hinge_armature: float = 0.01
    hinge_damping: float = 0.05
    track_speed: float = 0.10
    track_radius: float = 0.020
    friction: float = 0.7
    dock_force: float = 100.0
    acceleration_range: float = 4 * 9.81
    contact_range: float = 50.0
    ir_range: float = 0.20
    ir_spacing: float = 0.06
    laser_range: float = 4.0
    laser_beams: int = 19
    laser_angles: tuple[float, float] = (-pi / 3, pi / 6)
    dofs: int = 1
    twist_range: float = pi / 2
    twist_torque: float = 4.5

    def __post_init__(self) -> None:
        positive = (
            "dock_reach arm_reach pitch chassis_mass arm_mass hinge_range hinge_torque hinge_speed "
            "hinge_stiffness track_radius friction dock_force acceleration_range "
            "contact_range ir_range laser_range twist_range twist_torque"
        )
        check_positive(self, positive.split(), OrganismError)
        not_negative = "hinge_derivative hinge_armature hinge_damping track_speed ir_spacing"
        check_not_negative(self, not_negative.split(), OrganismError)
        for name, limits in SCOUT_LIMITS.items():
            as_floats(name, [getattr(self, name)], *limits, OrganismError)
        check_counts(self, ("laser_beams",), OrganismError)
        if isinstance(self.dofs, bool) or self.dofs not in (1, 2):
            raise OrganismError(
                f"dofs must be 1 (the hinge) or 2 (and the arm's rotation), got {self.dofs!r}"
            )

    @property
    def dock_gap(self) -> float:
        """What the two docking units add between a front and a back dock [m]."""
        return self.pitch - self.arm_reach - self.dock_reach

    def compute_dock(self, side: str) -> tuple[float, float, float]:
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
        if side not in SIDES:
            raise OrganismError(f"no dock {side!r}; there are: {', '.join(SIDES)}")
        return places[side]


SENSORS = (
    *("hinge_angle", "hinge_rate", "pitch", "roll", "acceleration", "ir", "contact", "previous_action"),
    *("hinge_target", "dock_force", "odometry", "track_odometry", "laser", "goal", "goal_direction"),
)
"""The names of the parts of an observation."""
DEFAULT_SENSORS = SENSORS[:8]


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviation of each part of an observation at noise level 1; the parts not listed have none.

    All are estimates for the real robot: none was measured on it.
    """

    hinge_angle: float = 0.005  # [rad]
    hinge_rate: float = 0.05  # [rad/s]
    pitch: float = 0.01  # [rad]
    roll: float = 0.01  # [rad]
    acceleration: float = 0.3  # [m/s²]
    ir: float = 0.003  # of a distance [m]
    contact: float = 0.5  # of a force [N]
    odometry: float = 0.01  # [m]; the paper's robot was localized within 1 cm
    track_odometry: float = 0.01  # of each reading [m]; slip comes from the physics
    laser: float = 0.006  # of a distance [m]

    def __post_init__(self) -> None:
        check_not_negative(self, [each.name for each in fields(self)], OptionError)
