"""Docked Scouts feel the ground of a place by the slip of their tracks; what they felt against the true friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.errors import RunError
from evolution._src.experiments.live.scene import SceneConfig
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.errors import ScanError
from reconstruction._src.slip.readings import SlipReadings
from symbrion_gym._src.sensing.friction_drive import drive_lanes, find_lanes
from symbrion_gym._src.sensing.friction_robot import FrictionRobot

_CELL = 0.05
"""Spacing of the places at which frictions are compared [m]."""


class FeltFriction(NamedTuple):
    """Friction of a part of the ground, as models have it.

    Attributes:
        truth: the true one.
        before: mean of the model before.
        after: mean of the model after.
        error_before: mean distance of the true friction from that of the model before.
        error_after: the same of the model after.
        half_width: mean half-width of the 95 % interval of the model after.
    """

    truth: float
    before: float
    after: float
    error_before: float
    error_after: float
    half_width: float


def feel_ground(
    truth: sg.Arena,
    arena: sg.Arena,
    surface: trimesh.Trimesh,
    scene: SceneConfig,
    robot: FrictionRobot,
    seed: int,
    progress: rc.Progress = rc.silent,
) -> SlipReadings:
    """Drive lanes on this side of the pit, and return what the module read that drags its tracks.

    The lanes are those of the model: they end where it has steps. Only the physics is that of the truth.

    Args:
        truth: the place as it is now.
        arena: the model before.
        surface: of the model, as far as it is known now.
        scene: where the pit is.
        robot: how the Scouts drive.
        seed: of the errors of their sensors.
        progress: called with the share of the lanes done.

    Raises:
        RunError: no lane is long enough.
    """
    known = replace(arena, surface=surface)
    edge = scene.course.pit_edges[0]
    lanes = [lane for lane in find_lanes(known, robot) if max(lane.start[0], lane.end[0]) < edge]
    if not lanes:
        raise RunError(
            f"no lane of {robot.least_run} m without steps on this side of the pit; take a shorter least_run"
        )
    return drive_lanes(truth, robot, np.random.default_rng((seed, 3)), progress, lanes)


def load_slip(path: Path) -> SlipReadings:
    """Read what `feel_ground` has returned, from a file.

    Raises:
        RunError: the file holds something else.
    """
    try:
        arrays = read_npz(path)
        return SlipReadings(**{**arrays, "mass": float(arrays["mass"])})
    except (KeyError, TypeError, ScanError) as error:
        raise RunError(
            f"{path} holds no slip of Scouts ({error}); remove it to feel the ground again"
        ) from error


def compare_friction(
    scene: SceneConfig, truth: sg.Arena, before: sg.Arena, after: sg.Arena
) -> dict[str, FeltFriction]:
    """Return the friction of the ice, and of the other ground on this side of the pit, in the truth and in models."""
    course = scene.course
    places = np.stack(
        np.meshgrid(
            np.arange(-course.length / 2 + _CELL / 2, course.pit_edges[0], _CELL),
            np.arange(-course.width / 2 + _CELL / 2, course.width / 2, _CELL),
        ),
        axis=-1,
    ).reshape(-1, 2)
    known = [arena.find_friction(places) for arena in (truth, before, after)]
    width = _find_half_widths(after, places)
    is_ice = (
        np.zeros(len(places), bool)
        if truth.friction_map is None
        else truth.friction_map.find_patches(places) >= 0
    )
    return {
        name: _compare(known[0][part], known[1][part], known[2][part], width[part])
        for name, part in (("ice", is_ice), ("other ground", ~is_ice))
        if part.any()
    }


def _find_half_widths(arena: sg.Arena, places: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, " N"]:
    known = arena.friction_map
    if known is None:
        return np.zeros(len(places))
    widths = np.array([*(patch.half_width for patch in known.patches), known.half_width])
    return widths[known.find_patches(places)]


def _compare(
    truth: Float[np.ndarray, " N"],
    before: Float[np.ndarray, " N"],
    after: Float[np.ndarray, " N"],
    width: Float[np.ndarray, " N"],
) -> FeltFriction:
    return FeltFriction(
        truth=float(truth.mean()),
        before=float(before.mean()),
        after=float(after.mean()),
        error_before=float(np.abs(before - truth).mean()),
        error_after=float(np.abs(after - truth).mean()),
        half_width=float(width.mean()),
    )
