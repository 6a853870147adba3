"""A color camera at a site of a running simulation, such as that of a Scout's laser: pictures, colors of readings."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.arenas.texture import compute_distances
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.camera import CameraConfig, expose, round_to_pixels
from symbrion_gym._src.sensing.laser_scanner import LaserScanner
from symbrion_gym._src.sensing.rangefinder import RangeFinder

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena

_FARTHEST = 50.0  # What is farther is not seen [m]
_ON_SURFACE = 0.01  # What is farther from the arena's surface is another body [m]
_BODY, _SKY, _WHITE = 0.4, 0.0, 255
"""Gray of other bodies, and of what is not there; the largest value of a channel."""
_AXES = {"x": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "z": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]}
"""Axis that the camera looks along -> ahead, left and up, in the frame of the site."""


class Camera:
    """A camera at a site: what it would see there now.

    It sees the colors of the arena; other bodies are gray.

    Attributes:
        config: exposure and noise, and the angle of a pixel for `color_readings`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        site: str | int,
        arena: Arena,
        config: CameraConfig | None = None,
        *,
        axis: str = "x",
        exclude: Iterable[str] | None = None,
    ) -> None:
        """Bind names to the model.

        Args:
            model: the compiled model, with the arena in it.
            site: name or id of the site.
            arena: whose surface has colors.
            config: None for the defaults; its `offset` is not used.
            axis: of the site that the camera looks along: "x", or "z" as for the sites of a Scout's laser.
            exclude: names of the bodies that are not seen. Default: that of the site.

        Raises:
            SurveyError: no such site, body or axis, or the arena has no colors.
        """
        check_choice("axis", axis, tuple(_AXES), SurveyError)
        if arena.texture is None:
            raise SurveyError(
                f"camera: the arena {arena.name!r} has no colors; give it some by sg.color_arena"
            )
        self.config = config or CameraConfig()
        self._model, self._site, self._arena = model, site, arena
        self._exclude = None if exclude is None else list(exclude)
        self._frame = np.array(_AXES[axis], dtype=np.float64)
        self._row = RangeFinder(model, site, exclude=self._exclude)._site

    def look(
        self,
        data: mujoco.MjData,
        rng: np.random.Generator | None = None,
        *,
        width: int = 160,
        height: int = 120,
        fovy: float = np.radians(60.0),
    ) -> UInt8[np.ndarray, "{height} {width} 3"]:
        """Return a picture without distortion, the first row the upper one.

        Args:
            data: a state whose positions are computed.
            rng: source of exposure and noise; None: without errors.
            width: pixels.
            height: pixels.
            fovy: angle from the lowest to the highest pixel [rad].
        """
        if width < 1 or height < 1 or not 0 < fovy < np.pi:
            raise SurveyError(
                f"camera: width, height and fovy must be above 0, fovy below pi, got {width}, {height}, {fovy}"
            )
        step = 2 * np.tan(fovy / 2) / height
        left = (width / 2 - 0.5 - np.arange(width)) * step
        up = (height / 2 - 0.5 - np.arange(height)) * step
        grid = np.stack(np.broadcast_arrays(1.0, left[None, :], up[:, None]), axis=-1).reshape(-1, 3)
        colors = self._see(data, grid / np.linalg.norm(grid, axis=1, keepdims=True))
        return self._expose(colors, rng).reshape(height, width, 3)

    def color_readings(
        self,
        data: mujoco.MjData,
        positions: Float[np.ndarray, "N 3"],
        rng: np.random.Generator | None = None,
    ) -> UInt8[np.ndarray, "N 3"]:
        """Return the colors of the pixels that readings fall on, 0 to 255.

        Args:
            data: a state whose positions are computed.
            positions: of the readings in the world, as a range finder measured them [m].
            rng: source of exposure and noise; None: without errors.
        """
        rotation = data.site_xmat[self._row].reshape(3, 3) @ self._frame.T
        ways = (np.asarray(positions, dtype=np.float64) - data.site_xpos[self._row]) @ rotation
        return self._expose(self._see(data, round_to_pixels(ways, self.config.pixel)), rng)

    def _see(self, data: mujoco.MjData, directions: Float[np.ndarray, "R 3"]) -> Float[np.ndarray, "R 3"]:
        """Return the colors (0 to 1) of what is in directions: ahead, left, up."""
        finder = RangeFinder(
            self._model,
            self._site,
            LaserScanner(max_range=_FARTHEST),
            directions=directions @ self._frame,
            exclude=self._exclude,
        )
        ranges = finder.read(data)
        rotation = data.site_xmat[self._row].reshape(3, 3)
        is_hit = np.isfinite(ranges)
        places = data.site_xpos[self._row] + ranges[is_hit, None] * (finder.directions[is_hit] @ rotation.T)
        colors = np.full((len(directions), 3), _SKY)
        if is_hit.any():
            distance = compute_distances(places, self._arena.surface)
            is_body = distance > _ON_SURFACE
            colors[is_hit] = np.where(is_body[:, None], _BODY, self._arena.find_colors(places))
        return colors

    def _expose(
        self, colors: Float[np.ndarray, "N 3"], rng: np.random.Generator | None
    ) -> UInt8[np.ndarray, "N 3"]:
        if rng is not None:
            return expose(colors, self.config, rng)
        return np.round(_WHITE * np.clip(self.config.exposure * colors, 0.0, 1.0)).astype(np.uint8)
