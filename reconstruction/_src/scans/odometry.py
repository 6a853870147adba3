"""Fusion of matched poses with wheel odometry: the scanner sways with the robot, its track on the ground is smooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import solveh_banded

from reconstruction._src.base.errors import ScanError
from reconstruction._src.geometry.pose import rotate_planar
from reconstruction._src.scans.noise_priors import estimate_slip

_MIN_VARIANCE = 1e-10
"""Of a step [m^2]: where the robot stands still, its wheels err by 0.01 mm, which keeps the weights finite."""
_UNKNOWN_SWAY = 0.005
"""Sway of a scanner where too few scans tell [m]: 1 degree at 0.3 m."""
_MIN_SQUARED_WAY = 1e-6
"""Least sum of squared ways [m^2] that a scale is found from: a robot that stands still has none."""


@dataclass(frozen=True)
class OdometryConfig:
    """How far odometry is trusted (`fuse_odometry`).

    Attributes:
        yaw_noise: standard deviation of the matched yaw [rad], in a room of 10 m; smaller ones trust the matches more.
        slip: standard deviation of the wheels' error after one meter [m] (and [rad]); it grows with the square root
            of the way; larger values trust the matches more. None: estimated, for way and turns apart.
        turn_way: way [m] that a turn of one radian counts as: the radius that the wheels turn on.
        calibration_window: scans between the poses whose distances are compared to calibrate the wheels: many, as
            matched and counted ways differ by the sway over a few.
        max_scale_error: a scale that differs from 1 by more than this is not used: something else is wrong then.
    """

    yaw_noise: float = 0.0006
    slip: float | None = None
    turn_way: float = 0.2
    calibration_window: int = 20
    max_scale_error: float = 0.2

    def __post_init__(self) -> None:
        if self.slip is not None and not self.slip >= 0:
            raise ScanError(f"slip must not be negative, got {self.slip}; None estimates it")
        for name in ("yaw_noise", "turn_way", "max_scale_error"):
            if not getattr(self, name) >= 0:
                raise ScanError(f"{name} must not be negative, got {getattr(self, name)}")
        if self.calibration_window < 1:
            raise ScanError(f"calibration_window must be 1 or more, got {self.calibration_window}")


def fuse_odometry(
    planar: Float[np.ndarray, "S 3"],
    odometry: Float[np.ndarray, "S 3"],
    sway: float | None = None,
    config: OdometryConfig | None = None,
) -> Float[np.ndarray, "S 3"]:
    """Smooth matched poses by the steps of the odometry.

    The wheels are calibrated first, by the mean ratio of matched and counted ways and turns. Then this minimizes
    ``sum |x_i - z_i|^2 / sway^2 + sum |x_(i+1) - x_i - R(yaw_i) u_i|^2 / (slip^2 way_i)`` over all positions x, z
    the matched ones and u the steps of the wheels: a tridiagonal system, solved exactly. Likewise for yaw.
    """
    config = config or OdometryConfig()
    if len(planar) < 3:
        return planar
    step, turn = np.diff(odometry[:, :2], axis=0), np.diff(odometry[:, 2])
    turn *= _find_scale(planar[:, 2:], turn[:, None], config)
    way = np.hypot(*step.T) + config.turn_way * np.abs(turn)
    turn_slip, _ = _find_slip(planar[:, 2] - planar[0, 2] - _add_up(turn), way, config)
    variance = turn_slip**2 * way + _MIN_VARIANCE
    yaw = _smooth_track(planar[:, 2:], turn[:, None], config.yaw_noise**2 / variance)[:, 0]
    step = rotate_planar(step, yaw[:-1] - odometry[:-1, 2])
    step *= _find_scale(planar[:, :2], step, config)
    middle = yaw[:-1] + turn / 2
    ahead = ((np.diff(planar[:, :2], axis=0) - step) * np.c_[np.cos(middle), np.sin(middle)]).sum(axis=1)
    slip, found = _find_slip(_add_up(ahead), way, config)
    variance = slip**2 * way + _MIN_VARIANCE
    sway = sway if sway is not None else found if np.isfinite(found) else _UNKNOWN_SWAY
    return np.c_[_smooth_track(planar[:, :2], step, sway**2 / variance), yaw]


def _add_up(steps: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N+1"]:
    """Return where steps lead to, from 0."""
    return np.concatenate([[0.0], np.cumsum(steps)])


def _find_slip(
    error: Float[np.ndarray, " S"], way: Float[np.ndarray, " S-1"], config: OdometryConfig
) -> tuple[float, float]:
    """Return the slip that is given, else estimated, and the estimated error that does not grow with the way."""
    slip, rest = estimate_slip(error, _add_up(way))
    return (slip if config.slip is None else config.slip), rest


def _find_scale(
    measured: Float[np.ndarray, "S D"], steps: Float[np.ndarray, "S-1 D"], config: OdometryConfig
) -> float:
    """Return the true way where the wheels count 1, by least squares over stretches of the track."""
    window = config.calibration_window
    counted = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
    if len(measured) <= 2 * window:
        return 1.0
    real, counted = measured[window:] - measured[:-window], counted[window:] - counted[:-window]
    total = float((counted * counted).sum())
    scale = float((real * counted).sum()) / total if total > _MIN_SQUARED_WAY else 1.0
    return scale if abs(scale - 1) < config.max_scale_error else 1.0


def _smooth_track(
    measured: Float[np.ndarray, "S D"], steps: Float[np.ndarray, "S-1 D"], weight: Float[np.ndarray, " S-1"]
) -> Float[np.ndarray, "S D"]:
    """Solve the normal equations of the sum that `fuse_odometry` minimizes, `weight` those of the steps."""
    bands = np.zeros((2, len(measured)))
    bands[0, 1:] = -weight
    bands[1] = 1.0
    bands[1, 1:] += weight
    bands[1, :-1] += weight
    pull = np.zeros_like(measured)
    pull[1:] += weight[:, None] * steps
    pull[:-1] -= weight[:, None] * steps
    return solveh_banded(bands, measured + pull)
