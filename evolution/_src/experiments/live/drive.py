"""A lone Scout drives a round in a place, and keeps what its infrared units and its laser read."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.errors import RunError
from reconstruction._src.base.progress import silent
from reconstruction._src.base.range_checks import check_positive
from reconstruction._src.geometry.pose import make_pose
from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.robot.scout_rays import find_scout_rays
from symbrion_gym._src.robot.sensor_noise import SensorNoise


@dataclass(frozen=True)
class DriveConfig:
    """A round of a Scout, and how well it knows where it is.

    Attributes:
        turn_speed: share of the track speed at which it turns on the spot to look around.
        reach: a place is reached within this distance [m].
        ticks: ticks of the environment (20 ms) from one reading that is kept to the next.
        duration: the round ends after this, wherever it is [s].
        position_error: standard deviation of the position it is told along each axis [m]: the paper's robot is
            localized within 1 cm ...
        angle_error: ... and 0.5 degrees; of each angle it is told [rad].
        memory: time in which these errors are forgotten [s]: they are not those of single readings.

    Raises:
        RunError: a field is not above 0.
    """

    turn_speed: float = 0.4
    reach: float = 0.04
    ticks: int = 1
    duration: float = 1500.0
    position_error: float = 0.005
    angle_error: float = float(np.deg2rad(0.25))
    memory: float = 2.0

    def __post_init__(self) -> None:
        check_positive(self, [field.name for field in fields(self)], RunError)


class Readings(NamedTuple):
    """What a Scout has read on a round.

    Attributes:
        ranges: of its rays (`find_scout_rays`) at every kept tick [m]; infinity where nothing is within range, nan
            where a ray begins in something.
        poses: module -> world, as it was told, with the errors of the configuration.
        true_poses: module -> world; only to measure localization by.
        times: [s].
    """

    ranges: Float[np.ndarray, "T R"]
    poses: Float[np.ndarray, "T 4 4"]
    true_poses: Float[np.ndarray, "T 4 4"]
    times: Float[np.ndarray, " T"]


_FACING = 0.1
"""A place is faced within this angle [rad]."""
_CERTAIN = 5.0
"""Standard deviations that noise never reaches."""


class Stop(NamedTuple):
    """A place to drive to, and to look around at.

    Attributes:
        x: [m].
        y: [m].
        sweep: by how much to turn on the spot there, to either side [rad].
        toward: where to face before [m]; None for the heading of the arrival.
        is_backward: whether it drives there backwards: up a ramp with the floor in sight. Forwards over its crest and
            down, a lone Scout may pitch over.
    """

    x: float
    y: float
    sweep: float
    toward: tuple[float, float] | None = None
    is_backward: bool = False


Plan = list[Stop]
"""Where a round goes."""


def drive_round(
    arena: sg.Arena, plan: Plan, config: DriveConfig, seed: int = 0, progress: rc.Progress = silent
) -> Readings:
    """Drive from place to place, look around at each, and return what was read.

    Args:
        arena: the place as it is now.
        plan: where to go; the round starts at the first place.
        config: how.
        seed: of the errors of sensors and localization.
        progress: called with the share of the places reached.

    Raises:
        RunError: the Scout has left the arena, rolled over or run out of time before its first place was done.
    """
    # A task of its own would end at a goal: this one is never reached.
    env = sg.SnakePitEnv(
        arena=arena, modules=1, track_control="skid", start=plan[0][:2], sensors=("ir", "laser"), noise=1.0,
        duration=config.duration, stuck_time=config.duration,
    )  # fmt: skip
    rng = np.random.default_rng((seed, 1))
    limits = _find_limits()
    observation, _ = env.reset(seed=seed)
    error, kept, done = rng.standard_normal(6), [], False
    share = float(np.exp(-env.dt / config.memory))
    scale = np.array([config.position_error] * 3 + [config.angle_error] * 3)
    steps = _Steps(plan, config)
    tick = 0
    while not done and not steps.is_done:
        true = np.eye(4)
        true[:3, :3], true[:3, 3] = env.physics.rotation[0, 0].reshape(3, 3), env.physics.position[0, 0]
        error = share * error + np.sqrt(1 - share**2) * rng.standard_normal(6)
        pose = apply_error(true, error * scale)
        if tick % config.ticks == 0:
            is_seen = (observation > 0.0) & (observation < limits)
            unseen = np.where(observation >= limits, np.inf, np.nan)
            kept.append((np.where(is_seen, observation, unseen), pose, true, tick * env.dt))
        observation, _, terminated, truncated, _ = env.step(steps.choose(pose))
        done = terminated or truncated
        tick += 1
        if tick % 250 == 0:
            progress("driving", steps.place / len(plan))
    env.close()
    if steps.place == 0:
        raise RunError(f"the Scout could not finish looking around at its start, {plan[0][:2]} m")
    return Readings(*(np.array(part) for part in zip(*kept, strict=True)))


def _find_limits() -> Float[np.ndarray, " R"]:
    """Return the ranges below which something was certainly seen [m]: nothing reads the range, and noise."""
    noise, ranges = SensorNoise(), find_scout_rays().max_ranges
    num_infrared = 2 * len(SIDES)
    deviation = np.where(np.arange(len(ranges)) < num_infrared, noise.ir, noise.laser)
    return ranges - _CERTAIN * deviation


def apply_error(pose: Float[np.ndarray, "4 4"], error: Float[np.ndarray, " 6"]) -> Float[np.ndarray, "4 4"]:
    """Return a pose moved by an error: x, y, z in the world [m], then yaw, pitch, roll of the module [rad]."""
    turn = make_pose(0.0, 0.0, error[3], roll=error[5], pitch=error[4])
    moved = pose @ np.asarray(turn).reshape(4, 4)
    moved[:3, 3] += error[:3]
    return moved


class _Steps:
    """Chooses track speeds: to a place, then turning there to both sides, then on to the next.

    Attributes:
        place: index of the place that is headed for.
    """

    def __init__(self, plan: Plan, config: DriveConfig) -> None:
        self.place = 0
        self._plan, self._config = plan, config
        self._turned, self._last_yaw, self._phase = 0.0, 0.0, 0

    @property
    def is_done(self) -> bool:
        """Whether the plan has ended."""
        return self.place >= len(self._plan)

    def choose(self, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, " 2"]:
        """Return the speeds of the left and the right track, -1 to 1."""
        x, y, angle, toward, is_backward = self._plan[self.place]
        yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
        if self._phase == 0:
            way = np.array([x, y]) - pose[:2, 3]
            if np.hypot(*way) > self._config.reach:
                turn = _wrap(float(np.arctan2(way[1], way[0])) - yaw + np.pi * is_backward)
                speed = max(0.0, np.cos(turn)) ** 2 if abs(turn) < 0.5 else 0.0
                speed = -speed if is_backward else speed
                turn = float(np.clip(turn, -1.0, 1.0)) * self._config.turn_speed
                return np.clip([speed - turn, speed + turn], -1.0, 1.0)
            self._phase, self._turned, self._last_yaw = -1, 0.0, yaw
        if self._phase < 0:
            turn = 0.0 if toward is None else _wrap(float(np.arctan2(toward[1] - y, toward[0] - x)) - yaw)
            if abs(turn) > _FACING:
                speed = float(np.copysign(self._config.turn_speed, turn))
                return np.array([-speed, speed])
            self._phase, self._turned, self._last_yaw = 1, 0.0, yaw
        self._turned += _wrap(yaw - self._last_yaw)
        self._last_yaw = yaw
        # To the left by the angle, to the right by twice the angle, and back.
        goal = (angle, -angle, 0.0)[self._phase - 1]
        if (self._turned - goal) * (1.0 if self._phase in (1, 3) else -1.0) >= 0.0:
            self._phase += 1
            if self._phase > 3:
                self.place, self._phase = self.place + 1, 0
            return np.zeros(2)
        way = self._config.turn_speed * (1.0 if self._phase in (1, 3) else -1.0)
        return np.array([-way, way])


def _wrap(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
