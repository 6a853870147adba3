"""What the simulation does in each law: the steepest slope, the widest gap, the highest step, the rate of turning."""

from __future__ import annotations

import numpy as np

from benchmarks.material.physics_theory import find_largest
from benchmarks.material.physics_worlds import Bench, World

SLOPE_SPEED, GAP_SPEED, STEP_SPEED, TURN_SPEED = 0.05, 0.05, 0.02, 0.05
"""Speeds of the tracks, slow enough for statics [m/s]."""
_SETTLING = 0.3
"""Time after which a robot that was put down is at rest [s]."""
_UPRIGHT = 0.8
"""Cosine of the largest tilt of a module against the ground that is not tipping over."""
_PROGRESS = 0.002
"""A robot that moves by less within a second does not climb [m]."""
_EDGE = 0.15
"""Distance of an edge from the head's center at the start [m]."""
_FALLEN = -0.15
"""Height of a module's center that says that it fell [m]."""
SLOPE_TOLERANCE, LENGTH_TOLERANCE, STEP_TOLERANCE = 0.1, 2e-4, 4e-5
"""To which limits are found [°], and gaps (ten times as much) and steps [m]."""


def climbs_slope(world: World, slope_deg: float, heading_deg: float = 0.0) -> bool:
    """Return whether a robot drives up a slope, its whole body upright.

    Args:
        world: robot and options.
        slope_deg: slope [°].
        heading_deg: heading, straight up the slope, against the axes of the world [°].
    """
    heading = np.radians(heading_deg)
    bench = Bench(world, slope=np.radians(slope_deg), heading=heading)
    bench.step(_SETTLING)
    bench.start(SLOPE_SPEED, seconds=2.0)
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    before = bench.places[0] @ ahead
    bench.step(1.0)
    return bool(bench.places[0] @ ahead - before > _PROGRESS and bench.up.min() > _UPRIGHT)


def measure_slope_limit(world: World, heading_deg: float = 0.0) -> float:
    """Return the steepest slope that a robot climbs [°]."""
    return find_largest(lambda slope: climbs_slope(world, slope, heading_deg), 2.0, 60.0, SLOPE_TOLERANCE)


def crosses_gap(world: World, gap: float, speed: float = GAP_SPEED) -> bool:
    """Return whether a stiff snake drives across a bottomless gap, its tracks at a speed [m/s]."""
    bench = Bench(world, boxes=((-20.0, _EDGE, 0.0), (_EDGE + gap, 20.0, 0.0)))
    bench.drive(speed)
    length = world.modules * bench.organism.scout.pitch + gap + _EDGE
    for _ in range(round(1.3 * length / speed) + 1):
        bench.step(1.0)
        places = bench.places
        if places[:, 2].min() < _FALLEN:
            return False
        if places[:, 0].min() > _EDGE + gap:
            return True
    return False


def measure_gap_limit(world: World, speed: float = GAP_SPEED) -> float:
    """Return the widest gap that a stiff snake crosses [m]."""
    longest = world.modules * world.organism.scout.pitch
    return find_largest(lambda gap: crosses_gap(world, gap, speed), 0.0, longest, 10 * LENGTH_TOLERANCE)


def climbs_step(world: World, height: float) -> bool:
    """Return whether a lone module drives up a step."""
    bench = Bench(world, boxes=((-20.0, _EDGE, 0.0), (_EDGE, 20.0, height)))
    bench.step(_SETTLING)
    bench.start(STEP_SPEED)
    for _ in range(40):
        bench.step(0.5)
        if bench.up.min() < _UPRIGHT / 2:
            return False
        if bench.places[0, 0] > _EDGE + 0.08:
            return True
    return False


def measure_step_limit(world: World) -> float:
    """Return the highest step that a lone module climbs [m]."""
    return find_largest(lambda height: climbs_step(world, height), 0.0, 0.05, STEP_TOLERANCE)


def measure_turning_rate(world: World, speed: float = TURN_SPEED, seconds: float = 4.0) -> float:
    """Return the mean rate at which a robot turns on the spot, its tracks against each other [rad/s]."""
    bench = Bench(world)
    bench.step(_SETTLING)
    bench.start(-speed, speed)
    turned, before = 0.0, _find_yaw(bench)
    for _ in range(round(seconds / 0.05)):
        bench.step(0.05)
        after = _find_yaw(bench)
        turned += (after - before + np.pi) % (2 * np.pi) - np.pi
        before = after
    return float(turned / seconds)


def _find_yaw(bench: Bench) -> float:
    """Return the heading of a body that stands level [rad]."""
    quaternion = bench.data.qpos[3:7]
    return float(2 * np.arctan2(quaternion[3], quaternion[0]))
