"""Surveys by robots that sway and slip more or less than expected, localized with several priors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from reconstruction._src.scans.leveling import level_floor
from reconstruction._src.scans.localization import localize
from reconstruction._src.scans.noise_priors import NoisePriors
from reconstruction._src.scans.scan import ScanLog
from symbrion_gym._src.sensing.survey import survey
from symbrion_gym._src.sensing.survey_robot import SurveyRobot

FACTORS = (0.5, 1.0, 2.0)
"""Noise of the robot, in that of the default one."""
_NOISES = ("shake", "step_noise", "distance_drift", "turn_drift")
_FIGURES = ("localization_max", "localization_median", "localization_max_deg", "localization_median_deg")


def measure_noise(surface: trimesh.Trimesh, quick: bool = False) -> list[dict[str, float | str]]:
    """Return errors of localization and leveling for noisier and calmer robots, one row for noise and priors.

    Priors are estimated from the log, those of the robot itself, or those of the default robot: wrong by a factor of
    two either way.

    Args:
        surface: what is surveyed.
        quick: one survey for each robot, else three.
    """
    rows = []
    for factor in FACTORS:
        robot = make_robot(factor)
        logs = [survey(surface, sensor=robot, seed=seed) for seed in range(1 if quick else 3)]
        for name, priors in find_priors(factor).items():
            errors = [measure_errors(log, priors) for log in logs]
            mean = {key: float(np.mean([each[key] for each in errors])) for key in errors[0]}
            rows.append({"noise": factor, "priors": name, "surveys": len(logs), **mean})
    return rows


def make_robot(factor: float) -> SurveyRobot:
    """Return the default robot with all of its sway and its wheels' errors multiplied."""
    robot = SurveyRobot()
    return replace(robot, **{name: factor * getattr(robot, name) for name in _NOISES})


def find_priors(factor: float) -> dict[str, NoisePriors]:
    """Return the priors that are compared for a robot with this factor on its noise."""
    robots = {"stated": make_robot(factor), "stated for the default robot": make_robot(1.0)}
    stated = {name: NoisePriors(slip=one.step_noise, shake=one.shake) for name, one in robots.items()}
    return {"estimated": NoisePriors(), **stated}


def measure_errors(log: ScanLog, priors: NoisePriors) -> dict[str, float]:
    """Localize and level a log again; return its errors [m], [deg]."""
    assert log.truth is not None
    localized = localize(log, priors=priors)
    level = level_floor(localized, priors=priors)
    rest = np.linalg.inv(log.truth.robot_poses) @ level.poses @ np.linalg.inv(log.mount)
    roll = np.degrees(np.arctan2(rest[:, 2, 1], rest[:, 2, 2]))
    pitch = np.degrees(np.arcsin(np.clip(rest[:, 2, 0], -1.0, 1.0)))
    figures = {name: float(localized.report[name]) for name in _FIGURES}
    return {**figures, "roll_rms_deg": float(np.std(roll)), "pitch_rms_deg": float(np.std(pitch))}
