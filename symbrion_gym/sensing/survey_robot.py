"""The virtual robot that surveys an arena: how it drives, where its scanners sit, how it errs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from reconstruction.geometry.pose import make_rotation
from symbrion_gym.errors import ArenaError
from symbrion_gym.sensing.laser_scanner import LaserScanner

_SCAN_PLANE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Scanner -> robot without a tilt: angle 0 to the right, 90 degrees up."""


@dataclass(frozen=True)
class SurveyRobot:
    """A differential-drive robot with a mast: speeds, places of its scanners, its shaking, its wheels' errors.

    Attributes:
        scanner: both scanners' model.
        speed: driving speed [m/s].
        turn_rate: turning speed on the spot [rad/s].
        scan_rate: scans a second [Hz]; the LMS 200 reaches 75 Hz at one degree, 37.5 Hz at half a degree.
        rest: standing still at the start [s]: the sway averages out of the first place.
        mast: height of the vertical scanner above the ground [m]; more over high arenas, see `survey`.
        tilt: its middle beam points to the right and this far below the horizon [rad]; at 60 degrees it sees
            the ground on both sides of the robot, which levelling needs.
        low_height: height of the horizontal scanner above the ground [m].
        shake: standard deviation of roll and pitch [rad], about the point of contact with the ground.
        shake_memory: correlation of the shaking from one scan to the next.
        distance_drift, turn_drift: relative error of the wheels in distance and turning, drawn once a survey
            (standard deviations).
        step_noise: random error of the wheels, per square root of a metre [m] (and [rad]).
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

    def __post_init__(self) -> None:
        for name in ("speed", "turn_rate", "scan_rate", "mast", "low_height"):
            if not 0 < getattr(self, name) < np.inf:
                raise ArenaError(f"SurveyRobot: {name} must be above 0, got {getattr(self, name)}")
        for name in ("rest", "shake", "distance_drift", "turn_drift", "step_noise"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ArenaError(f"SurveyRobot: {name} must be 0 or more, got {getattr(self, name)}")
        if not 0 <= self.shake_memory < 1:
            raise ArenaError(f"SurveyRobot: shake_memory must lie in [0, 1), got {self.shake_memory}")

    @property
    def vertical_mount(self) -> np.ndarray:
        """Pose of the vertical scanner in the robot, `[4, 4]`; its plane is the robot's y-z plane."""
        mount = np.eye(4)
        mount[:3, :3] = make_rotation(roll=self.tilt) @ _SCAN_PLANE
        mount[2, 3] = self.mast
        return mount

    @property
    def horizontal_mount(self) -> np.ndarray:
        """Pose of the horizontal scanner in the robot, `[4, 4]`: its middle beam ahead."""
        mount = np.eye(4)
        mount[2, 3] = self.low_height
        return mount
