"""Errors of what a robot reads of its slip: noise, offsets and gains, a localization that drifts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.slip.readings import SlipReadings
from symbrion_gym._src.sensing.friction_robot import SlipNoise


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
