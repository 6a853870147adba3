"""Where a lone Scout's infrared units and laser look, in the frame of the module."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.robot.scout_sensors import LASER_HEIGHT, find_infrared_sides


class ScoutRays(NamedTuple):
    """Rays of a module's range sensors: the infrared units in the order of the observation, then the laser's beams.

    Attributes:
        origins: where they begin [m].
        directions: unit vectors.
        max_ranges: what is farther is not seen [m].
    """

    origins: Float[np.ndarray, "R 3"]
    directions: Float[np.ndarray, "R 3"]
    max_ranges: Float[np.ndarray, " R"]


def find_scout_rays(config: ScoutConfig | None = None) -> ScoutRays:
    """Return the rays of a lone Scout, `ir` before `laser`, as they stand in its observation."""
    config = config or ScoutConfig()
    origins, directions, ranges = [], [], []
    sides = find_infrared_sides(config)
    for side in SIDES:
        x, y, heading = sides[side]
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        aside = np.array([-ahead[1], ahead[0], 0.0])
        for offset in (config.ir_spacing / 2, -config.ir_spacing / 2):
            origins.append(np.array([x, y, 0.0]) + offset * aside)
            directions.append(ahead)
            ranges.append(config.ir_range)
    for angle in np.linspace(*config.laser_angles, config.laser_beams):
        origins.append(np.array([config.size[0] / 2, 0.0, LASER_HEIGHT]))
        directions.append(np.array([np.cos(angle), 0.0, np.sin(angle)]))
        ranges.append(config.laser_range)
    return ScoutRays(np.array(origins), np.array(directions), np.array(ranges))
