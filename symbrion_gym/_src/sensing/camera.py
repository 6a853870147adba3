"""A color camera, by casting rays: which color each pixel sees, with its exposure and noise.

Pictures are made without OpenGL: equal seeds give equal pictures on any machine. Light is even and white: no shades, no
highlights.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from jaxtyping import Bool, Float, UInt8

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.laser_scanner import Cast

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.arenas.course import Course, StairsCourse
    from symbrion_gym._src.sensing.survey_robot import SurveyRobot
    from symbrion_gym._src.sensing.survey_world import SurveyWorld

Paint = Callable[[Float[np.ndarray, "N 3"]], Float[np.ndarray, "N 3"]]
"""Returns the colors (0 to 1) of the surface at positions [m]."""
_WHITE = 255


@dataclass(frozen=True)
class CameraConfig:
    """A camera beside a range finder: it looks along the x axis of the sensor, z up in the picture.

    Its lens is a fisheye, a pixel an equal angle everywhere, so that one picture holds all beams of a scan.

    Attributes:
        pixel: angle between neighboring pixels [rad]; 0.2 degrees are 950 pixels over 190 degrees.
        field_of_view: full angle of the lens [rad].
        offset: of the camera from the range finder, along the sensor's axes [m]: what hides a place from one of them
            alone takes a wrong color.
        exposure: factor on all colors; above 1 bright ones are clipped.
        exposure_noise: relative standard deviation of the exposure from one picture to the next.
        noise: standard deviation of a channel of a pixel, of 1; then it is rounded to bytes.

    Raises:
        SurveyError: a number is out of range.
    """

    pixel: float = np.radians(0.2)
    field_of_view: float = np.radians(190.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.08)
    exposure: float = 1.0
    exposure_noise: float = 0.02
    noise: float = 0.02

    def __post_init__(self) -> None:
        check_positive(self, ("pixel", "field_of_view", "exposure"), SurveyError)
        check_not_negative(self, ("exposure_noise", "noise"), SurveyError)
        if self.field_of_view > 2 * np.pi:
            raise SurveyError(
                f"CameraConfig: field_of_view must be up to 2 pi = 6.283, got {self.field_of_view}"
            )
        if np.shape(self.offset) != (3,) or not np.isfinite(self.offset).all():
            raise SurveyError(f"CameraConfig: offset must be three finite lengths, got {self.offset}")


def look_at(
    positions: Float[np.ndarray, "N 3"], pose: Float[np.ndarray, "4 4"], cast: Cast, config: CameraConfig
) -> tuple[Float[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
    """Return the places that the pixels show which readings fall on, and which of them show any."""
    center = pose[:3, 3] + pose[:3, :3] @ np.asarray(config.offset)
    ways = (positions - center) @ pose[:3, :3]
    directions = round_to_pixels(ways, config.pixel)
    distance = cast(center, directions @ pose[:3, :3].T)
    is_seen = np.isfinite(distance) & (
        np.arccos(np.clip(directions[:, 0], -1, 1)) <= config.field_of_view / 2
    )
    length = np.where(is_seen, distance, 0.0)
    return center + length[:, None] * (directions @ pose[:3, :3].T), is_seen


def expose(
    colors: Float[np.ndarray, "*N 3"], config: CameraConfig, rng: np.random.Generator
) -> UInt8[np.ndarray, "*N 3"]:
    """Return colors as the camera measures them in one picture, 0 to 255."""
    gain = config.exposure * (1.0 + config.exposure_noise * rng.standard_normal())
    measured = gain * colors + config.noise * rng.standard_normal(colors.shape)
    return np.round(_WHITE * np.clip(measured, 0.0, 1.0)).astype(np.uint8)


def round_to_pixels(ways: Float[np.ndarray, "N 3"], pixel: float) -> Float[np.ndarray, "N 3"]:
    """Return the directions of the middles of the pixels that ways fall on, as unit vectors."""
    aside = np.hypot(ways[:, 1], ways[:, 2])
    angle = np.arctan2(aside, ways[:, 0])
    share = ways[:, 1:] / np.maximum(aside, np.finfo(float).tiny)[:, None]
    middle = pixel * np.round(angle[:, None] * share / pixel)
    angle = np.hypot(*middle.T)
    side = middle / np.maximum(angle, np.finfo(float).tiny)[:, None]
    return np.concatenate([np.cos(angle)[:, None], np.sin(angle)[:, None] * side], axis=1)


DEFAULT_PATTERN = "checker"  # Of the courses by name, which have no colors of their own
_GROUND = 0.5  # Gray of the ground around an arena, and of a pixel that shows nothing
_RIM = 1e-3  # The arena ends this far outside of its box [m]
_STREAM = 20  # The camera draws from a stream of its own: ranges are those of a survey without it


def take_arena(arena: str | os.PathLike | Arena | trimesh.Trimesh) -> Arena:
    """Return an arena with colors for what a survey takes as one.

    The courses by name are painted.
    """
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.arenas.course import Course, StairsCourse
    from symbrion_gym._src.arenas.making import load_arena

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
