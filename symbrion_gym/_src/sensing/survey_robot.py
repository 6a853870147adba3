"""The virtual robot that surveys an arena: how it drives, where its scanners sit, how it errs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from reconstruction._src.geometry.pose import make_rotation
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.laser_scanner import LaserScanner

_SCAN_PLANE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Scanner -> robot without a tilt: angle 0 to the right, 90 degrees up."""
_NOT_NEGATIVE = (
    "rest",
    "shake",
    "distance_drift",
    "turn_drift",
    "step_noise",
    "turn_weight",
    "head_room",
)


@dataclass(frozen=True)
class SurveyRobot:
    """A differential-drive robot with a mast: speeds, positions of its scanners, its sway, its wheels' errors.

    Attributes:
        scanner: model of both scanners.
        speed: driving speed [m/s].
        turn_rate: turning speed on the spot [rad/s].
        scan_rate: scans a second [Hz]; the LMS 200 reaches 75 Hz at one degree, 37.5 Hz at half a degree.
        rest: standing still at the start [s]: the sway averages out of the first pose.
        mast: height of the vertical scanner above the ground [m]; more over high arenas, see `survey`.
        tilt: its middle beam points to the right and this far below the horizon [rad]; at 60 degrees it sees
            the ground on both sides of the robot, which leveling needs.
        low_height: height of the horizontal scanner above the ground [m].
        shake: standard deviation of the sway in roll and pitch [rad], about the point of contact with the ground.
        shake_memory: correlation of the sway from one scan to the next.
        distance_drift, turn_drift: relative error of the wheels in distance and turning, drawn once a survey
            (standard deviations).
        step_noise: random error of the wheels, per square root of a meter [m] (and [rad]).
        turn_weight: meters that a turn of one radian counts as in that error.
        head_room: the mast is at least this much higher than the arena [m].

    Raises:
        SurveyError: a number is out of range.
    """

    scanner: LaserScanner = field(default_factory=LaserScanner)
    speed: float = 0.25
    turn_rate: float = 1.0
    scan_rate: float = 20.0
    rest: float = 4.0
    mast: float = 2.2
    tilt: float = np.pi / 3
    low_height: float = 0.3
    shake: float = np.radians(0.7)
    shake_memory: float = 0.5
    distance_drift: float = 0.01
    turn_drift: float = 0.02
    step_noise: float = 0.005
    turn_weight: float = 0.2
    head_room: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, ("speed", "turn_rate", "scan_rate", "mast", "low_height"), SurveyError)
        check_not_negative(self, _NOT_NEGATIVE, SurveyError)
        if not 0 <= self.shake_memory < 1:
            raise SurveyError(f"SurveyRobot: shake_memory must lie in [0, 1), got {self.shake_memory}")

    @property
    def vertical_mount(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the vertical scanner in the robot; its plane is the robot's y-z plane."""
        mount = np.eye(4)
        mount[:3, :3] = make_rotation(roll=self.tilt) @ _SCAN_PLANE
        mount[2, 3] = self.mast
        return mount

    @property
    def horizontal_mount(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the horizontal scanner in the robot: its middle beam ahead."""
        mount = np.eye(4)
        mount[2, 3] = self.low_height
        return mount
