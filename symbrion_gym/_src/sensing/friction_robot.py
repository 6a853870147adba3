"""The robot that feels the friction of the ground: docked Scouts, the last of which drags its tracks now and then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_counts, check_not_negative, check_positive
from reconstruction._src.scans.slip_readings import SlipReadings
from symbrion_gym._src.errors import SurveyError

_POSITIVE = ("speed", "drag_speed", "cruise", "drag", "spacing", "margin", "least_run", "patience", "tick")


@dataclass(frozen=True)
class SlipNoise:
    """Errors of the sensors (standard deviations); estimates, none was measured on the robot.

    Attributes:
        force: of the force in the dock, a tick [N].
        force_bias: its offset along each axis, drawn once a survey [N].
        force_gain: its relative error, drawn once a survey: a strain gauge calibrated with weights.
        mass: relative error of the mass that the robot is told, drawn once a survey.
        acceleration: of the accelerometers, a tick [m/s²].
        acceleration_bias: their offset, drawn once a survey [m/s²].
        position: of the localization, a tick [m].
        drift: of the localization, slow: it is lost within `drift_time` [m].
        drift_time: how long an error of the localization lasts [s].
        angle: of heading and pitch [rad].
    """

    force: float = 0.25
    force_bias: float = 0.1
    force_gain: float = 0.01
    mass: float = 0.005
    acceleration: float = 0.15
    acceleration_bias: float = 0.1
    position: float = 0.003
    drift: float = 0.005
    drift_time: float = 10.0
    angle: float = float(np.radians(0.3))

    def __post_init__(self) -> None:
        check_not_negative(self, list(vars(self)), SurveyError)
        check_positive(self, ("drift_time",), SurveyError)


@dataclass(frozen=True)
class FrictionRobot:
    """A snake of Scouts that drives lanes over an arena, its last module ahead, which drags in turn to either side.

    Raises:
        SurveyError: a number is out of range.
    """

    # length of the snake; two pull, so that one that drags does not stop them on level ground
    modules: int = 3
    speed: float = 0.12  # of the tracks [m/s] (estimates of the Scout's: 0.06 to 0.15)
    # how much slower, and in turn faster, the tracks of the last module run in a drag [m/s]: tracks hold with
    # all that friction gives from a slip of some 0.1 m/s
    drag_speed: float = 0.24
    cruise: float = 0.5  # time from one drag to the next [s]
    drag: float = 0.5  # length of a drag [s]
    spacing: float = 0.4  # distance of the lanes, along the longer side of the arena [m]
    margin: float = 0.15  # of the lanes from the rim, and of their ends from steps [m]
    highest_step: float = 0.01  # a lane ends where the ground changes by more within a centimeter [m]
    least_run: float = 0.8  # stretches of a lane that are shorter are left out [m]
    patience: float = 12.0  # a drive that gets nowhere for this long ends [s]
    tick: float = 0.02  # from one reading to the next [s]
    noise: SlipNoise = field(default_factory=SlipNoise)  # errors of the sensors

    def __post_init__(self) -> None:
        check_counts(self, ("modules",), SurveyError)
        check_positive(self, _POSITIVE, SurveyError)
        check_not_negative(self, ("highest_step",), SurveyError)
        if self.modules < 2:
            raise SurveyError(
                f"FrictionRobot: modules is {self.modules}; one drags and one or more pull: 2 or more"
            )

    def find_offset(self, time: float) -> float:
        """Return how much faster the tracks of the last module run than the others, at a time [m/s]."""
        period = self.cruise + self.drag
        number, phase = divmod(time, period)
        if phase < self.cruise:
            return 0.0
        return self.drag_speed * (-1.0 if int(number) % 2 == 0 else 1.0)


class Tick(NamedTuple):
    """One row of `SlipReadings`, exact or as read."""

    time: float
    run: int
    position: Float[np.ndarray, " 3"]
    heading: float
    pitch: float
    commanded: float
    acceleration: Float[np.ndarray, " 3"]
    force: Float[np.ndarray, " 3"]


class SlipSensors:
    """The sensors of one survey.

    Args:
        noise: standard deviations.
        mass: true mass of the module [kg].
        rng: of all errors.
    """

    def __init__(self, noise: SlipNoise, mass: float, rng: np.random.Generator) -> None:
        self._noise, self._rng = noise, rng
        self._gain = 1.0 + noise.force_gain * rng.standard_normal()
        self._mass = mass * (1.0 + noise.mass * rng.standard_normal())
        self._force_bias = noise.force_bias * rng.standard_normal(3)
        self._acceleration_bias = noise.acceleration_bias * rng.standard_normal(3)
        self._drift, self._last = np.zeros(3), 0.0

    def begin(self) -> None:
        """Begin a run: the localization begins with an error of its own."""
        self._drift, self._last = self._noise.drift * self._rng.standard_normal(3), 0.0

    def read(self, exact: Tick) -> Tick:
        """Return a tick as it is read."""
        noise, draw = self._noise, self._rng.standard_normal
        memory = float(np.exp(-(exact.time - self._last) / noise.drift_time))
        self._drift = memory * self._drift + noise.drift * np.sqrt(1 - memory**2) * draw(3)
        self._last = exact.time
        return exact._replace(
            position=exact.position + self._drift + noise.position * draw(3),
            heading=exact.heading + noise.angle * draw(),
            pitch=exact.pitch + noise.angle * draw(),
            acceleration=exact.acceleration + self._acceleration_bias + noise.acceleration * draw(3),
            force=self._gain * exact.force + self._force_bias + noise.force * draw(3),
        )

    def collect(self, ticks: Sequence[Tick]) -> SlipReadings:
        """Return the ticks of all runs."""
        columns = zip(*ticks, strict=True) if ticks else [()] * len(Tick._fields)
        times, runs, positions, headings, pitches, commanded, accelerations, forces = map(np.array, columns)
        return SlipReadings(
            times,
            runs,
            positions.reshape(-1, 3),
            headings,
            pitches,
            commanded,
            accelerations.reshape(-1, 3),
            forces.reshape(-1, 3),
            self._mass,
        )
