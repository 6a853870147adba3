"""The colors of a survey's readings: pictures of a camera beside the vertical scanner."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from jaxtyping import Float, UInt8

from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.camera import CameraConfig, Paint, expose, look_at

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.arenas.course import Course, StairsCourse
    from symbrion_gym._src.sensing.survey_robot import SurveyRobot
    from symbrion_gym._src.sensing.survey_world import SurveyWorld

DEFAULT_PATTERN = "checker"
"""Of the courses by name, which have no colors of their own."""
_GROUND = 0.5
"""Gray of the ground around an arena, and of a pixel that shows nothing."""
_RIM = 1e-3
"""The arena ends this far outside of its box [m]."""
_STREAM = 20
"""The camera draws from a stream of its own: ranges are those of a survey without it."""


def take_arena(arena: str | os.PathLike | Arena | trimesh.Trimesh) -> Arena:
    """Return an arena with colors for what a survey takes as one.

    The courses by name are painted.
    """
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.arenas.course import Course, StairsCourse
    from symbrion_gym._src.arenas.loading import load_arena

    if isinstance(arena, str) and arena in ("truth", "stairs"):
        kind = StairsCourse if arena == "stairs" else Course
        return Arena.from_course(kind(color_pattern=DEFAULT_PATTERN), arena)
    if isinstance(arena, str | os.PathLike):
        arena = load_arena(str(arena))
    if isinstance(arena, Arena) and arena.texture is None:
        raise SurveyError(
            f"camera: the arena {arena.name!r} has no colors; make it of a colored scan or mesh, or of a Course with a "
            "color_pattern"
        )
    if isinstance(arena, Arena):
        return arena
    raise SurveyError(
        f"camera: give an Arena with colors (make_arena of a colored mesh), not {type(arena).__name__}"
    )


def take_course(
    arena: str | os.PathLike | Arena | Course | StairsCourse | trimesh.Trimesh,
) -> str | os.PathLike | Arena | trimesh.Trimesh:
    """Return the arena of a course, and whatever else it is as it is."""
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.arenas.course import Course, StairsCourse

    return Arena.from_course(arena) if isinstance(arena, Course | StairsCourse) else arena


def color_readings(
    ranges: Float[np.ndarray, "S B"],
    robot_poses: Float[np.ndarray, "S 4 4"],
    robot: SurveyRobot,
    world: SurveyWorld,
    arena: Arena,
    config: CameraConfig,
    seed: int,
) -> UInt8[np.ndarray, "S B 3"]:
    """Return the color that the camera sees where each reading falls on its picture; zeros without a reading."""
    angles = robot.scanner.angles
    beams = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    is_read = np.isfinite(ranges)
    places, seen = np.zeros((*ranges.shape, 3)), np.zeros(ranges.shape, dtype=bool)
    for scan, robot_pose in enumerate(robot_poses):
        pose, read = robot_pose @ robot.vertical_mount, is_read[scan]
        if read.any():
            ends = (ranges[scan, read, None] * beams[read]) @ pose[:3, :3].T + pose[:3, 3]
            places[scan, read], seen[scan, read] = look_at(ends, pose, world.cast_on_arena, config)
    colors = np.full((*ranges.shape, 3), _GROUND)
    colors[seen] = _paint_within(arena.find_colors, np.asarray(arena.surface.bounds, float), places[seen])
    rng = np.random.default_rng([seed, _STREAM])
    pictures = np.stack([expose(row, config, rng) for row in colors])
    pictures[~is_read] = 0
    return pictures


def _paint_within(
    paint: Paint, bounds: Float[np.ndarray, "2 3"], places: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    """Return the colors of places: those of the arena in its box, gray on the ground around."""
    inside = ((places >= bounds[0] - _RIM) & (places <= bounds[1] + _RIM)).all(axis=1)
    colors = np.full((len(places), 3), _GROUND)
    colors[inside] = paint(places[inside])
    return colors
