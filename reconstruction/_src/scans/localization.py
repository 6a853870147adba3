"""Localization of the robot: odometry corrected by matching its horizontal scans (paper, section II-A)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.pose import make_pose, to_planar, transform_planar
from reconstruction._src.scans.leveling import LevelingConfig, compute_tilt, estimate_declination, use_priors
from reconstruction._src.scans.scan import HorizontalScans, ScanLog
from reconstruction._src.scans.scan_matching import (
    fuse_odometry,
    match_to_map,
)
from reconstruction._src.scans.smoothing import UNKNOWN_SHAKE, NoisePriors, estimate_shake

_LEAST_VIBRATION = 1e-5  # A robot that does not sway keeps the weights finite [rad]


_MATCH_ERROR = 0.001  # Standard deviation of the position of a scan matched to the final map [m]
_MIN_HEIGHT = 0.1
"""A horizontal scanner below this height [m] shows no pitch: its sway is less than the error of matching."""
_MAX_PITCH = 0.1  # Largest sine of the pitch: more is a wrong match


@dataclass(frozen=True)
class LocalizationConfig:
    """How the robot is localized (`localize`).

    Attributes:
        slip: standard deviation of the wheels' error after one meter [m] (and [rad]); it grows with the square root of
            the way; larger values trust the matches more. None: estimated, for way and turns apart.
        leveling: finds the tilt across the robot, which moves the horizontal scanner.
        vibration: standard deviation of the robot's pitch as it drives [rad]; larger values smooth the track more.
            None: estimated, as that of its roll, which leveling finds.
    """

    slip: float | None = None
    leveling: LevelingConfig = field(default_factory=LevelingConfig)
    vibration: float | None = None

    def __post_init__(self) -> None:
        if self.vibration is not None and not self.vibration > 0:
            raise ScanError(f"vibration must be above 0, got {self.vibration}; None estimates it")
        if self.slip is not None and not self.slip >= 0:
            raise ScanError(f"slip must not be negative, got {self.slip}; None estimates it")

    def compute_sway(self, height: float) -> float:
        """Return the standard deviation of the position of a scanner at this height, matching error included [m]."""
        vibration = UNKNOWN_SHAKE if self.vibration is None else self.vibration
        return float(np.hypot(vibration * height, _MATCH_ERROR))


def localize(
    log: ScanLog,
    progress: Progress = silent,
    *,
    config: LocalizationConfig | None = None,
    priors: NoisePriors | None = None,
) -> ScanLog:
    """Return the log with poses from scan matching, and with its errors reported where the truth is known.

    Four degrees of freedom are found: x, y and yaw of the robot's foot, and its pitch, approximately (see
    `estimate_pitch`). Leveling finds a fifth, see `level_floor`; the foot stands on the ground.

    Args:
        log: with horizontal scans.
        progress: called with the current step.
        config: configuration of matching, odometry and leveling.
        priors: what is known of the robot's noise; replaces `vibration`, and `slip` and `max_tilt` of odometry and
            leveling. What neither gives is estimated from the log.

    Raises:
        ScanError: the log has no horizontal scans.
        MissingExtraError: the extra `scan` is not installed.
    """
    config = _use_priors(config or LocalizationConfig(), priors)
    if log.horizontal is None:
        raise ScanError(
            "the log has no horizontal scans to localize the robot by; give poses with the ScanLog"
        )
    ground = (log.poses @ np.linalg.inv(log.mount))[:, 2, 3]
    place = log.horizontal.mount[:3, 3]
    if config.vibration is None:
        config = replace(config, vibration=_estimate_vibration(log, config))
    sway = (compute_tilt(log, config.leveling)[:, :3, :3] @ place - place)[:, :2]
    matched = match_to_map(log.horizontal, sway, progress)
    height = float(place[2])
    planar = fuse_odometry(matched, log.horizontal.odometry, config.compute_sway(height), config.slip)
    pitch = estimate_pitch(matched, planar, height, config)
    planar = _move_to_start(planar, log.horizontal.start)
    robot = make_pose(*planar.T, pitch=pitch)
    robot[:, 2, 3] = ground
    report = dict(log.report)
    if log.truth is not None:
        report |= measure_localization(planar, to_planar(log.truth.robot_poses))
    return log.replace(poses=robot @ log.mount, report=report)


def _use_priors(config: LocalizationConfig, priors: NoisePriors | None) -> LocalizationConfig:
    if priors is None:
        return config
    slip = config.slip if priors.slip is None else priors.slip
    vibration = config.vibration if priors.shake is None else max(priors.shake, _LEAST_VIBRATION)
    leveling = use_priors(config.leveling, priors)
    return replace(config, slip=slip, leveling=leveling, vibration=vibration)


def _estimate_vibration(log: ScanLog, config: LocalizationConfig) -> float:
    """Return the sway of the robot [rad], estimated from the floor that its scans show."""
    return max(estimate_shake(estimate_declination(log, config.leveling)), _LEAST_VIBRATION)


def measure_localization(
    planar: Float[np.ndarray, "S 3"], true: Float[np.ndarray, "S 3"]
) -> dict[str, float]:
    """Return the largest and the median error [m] and [deg] of poses (x, y, yaw)."""
    distance = np.hypot(*(planar - true)[:, :2].T)
    angle = np.degrees(np.abs((planar[:, 2] - true[:, 2] + np.pi) % (2 * np.pi) - np.pi))
    return {
        "localization_max": float(distance.max()),
        "localization_median": float(np.median(distance)),
        "localization_max_deg": float(angle.max()),
        "localization_median_deg": float(np.median(angle)),
    }


def match_scans(
    scans: HorizontalScans,
    sway: Float[np.ndarray, "S 2"] | None = None,
    progress: Progress = silent,
    config: LocalizationConfig | None = None,
) -> Float[np.ndarray, "S 3"]:
    """Match horizontal scans to a map that is made of them, and return x, y, yaw.

    1. to 3. Every scan is matched to the map (`match_to_map`).
    4. The track is fused with the odometry (`fuse_odometry`): the scanner sways with the robot, its foot does
       not. The whole is moved so that it begins at the start.
    """
    config = config or LocalizationConfig()
    planar = match_to_map(scans, sway, progress)
    sigma = None if config.vibration is None else config.compute_sway(float(scans.mount[2, 3]))
    return _move_to_start(fuse_odometry(planar, scans.odometry, sigma, config.slip), scans.start)


def estimate_pitch(
    matched: Float[np.ndarray, "S 3"],
    planar: Float[np.ndarray, "S 3"],
    height: float,
    config: LocalizationConfig | None = None,
) -> Float[np.ndarray, " S"]:
    """Find the robot's pitch at every scan from the sway of its horizontal scanner [rad].

    A scanner at height h is carried ahead of the foot by ``h sin(p)``. With d the way from the smooth track to
    the matched pose, ahead: ``p = d / h * s^2 / (s^2 + m^2)``, s the sway to be expected, m the error of matching.

    The wheels leave the track uncertain, and sway that lasts looks like driving. For a scanner at 0.3 m, vibration of
    0.7 degrees with a memory of half a scan, wheels wrong by 5 mm a square root of a meter and matches good to
    0.8 mm, the optimal (Wiener) filter leaves 0.29 degrees; this leaves 0.30.
    """
    config = config or LocalizationConfig()
    if height < _MIN_HEIGHT:
        return np.zeros(len(planar))
    ahead = np.stack([np.cos(planar[:, 2]), np.sin(planar[:, 2])], axis=1)
    lead = ((matched - planar)[:, :2] * ahead).sum(axis=1)
    sway = float(np.std(lead)) if config.vibration is None else config.compute_sway(height)
    share = sway**2 / (sway**2 + _MATCH_ERROR**2)
    return np.arcsin(np.clip(share * lead / height, -_MAX_PITCH, _MAX_PITCH))


def _move_to_start(
    planar: Float[np.ndarray, "S 3"], start: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "S 3"]:
    """Move and turn the whole track so that it begins at the start."""
    turn = start[2] - planar[0, 2]
    moved = transform_planar(planar[:, :2] - planar[0, :2], np.array([*start[:2], turn]))
    return np.c_[moved, planar[:, 2] + start[2] - planar[0, 2]]
