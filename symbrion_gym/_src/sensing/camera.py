"""A color camera, by casting rays: which color each pixel sees, with its exposure and noise.

Pictures are made without OpenGL: equal seeds give equal pictures on any machine. Light is even and white: no shades, no
highlights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.laser_scanner import Cast

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
