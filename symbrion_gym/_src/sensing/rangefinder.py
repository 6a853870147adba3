"""Range finders and cameras at a site of a running simulation, by casting rays on exact surfaces."""

from collections.abc import Callable, Iterable
from copy import copy
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, UInt8
from numpy.typing import ArrayLike

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.spec import CONTACT_GROUP
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.survey_robot import CameraConfig, LaserScanner, expose
from symbrion_gym._src.sensing.survey_world import cast_rays


class RangeFinder:
    """A range finder at a site: what it would read there now.

    Its beams lie in the site's x-y plane, beam angle 0 along x, unless other directions are given. Rays see
    every geom but those of group 3 (an arena's contact pieces, which are not where the surface is) and those of the
    excluded bodies, in the shape that the model had when the finder was made. With a generator the reading has the
    scanner's errors, the same as in a survey (`LaserScanner`), and needs a second cast for the rims of the light spots.

    Attributes:
        scanner: beams, range and errors.
        site: id of the site.
        directions: `[R, 3]` unit vectors of the beams at the site.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        site: str | int,
        scanner: LaserScanner | None = None,
        *,
        directions: ArrayLike | None = None,
        exclude: Iterable[str] | None = None,
        groups: Iterable[int] = (0, 1, 2, 4, 5),
    ) -> None:
        """Bind names to the model.

        Args:
            model: the compiled model.
            site: name or id of the site that the beams leave from.
            scanner: default: the LMS 200 at half a degree.
            directions: `[R, 3]` beams at the site, instead of the scanner's fan.
            exclude: names of the bodies whose geoms are not seen. Default: the body that carries the site.
            groups: geom groups that are seen.

        Raises:
            SurveyError: there is no such site or body, a direction has no length, or a group
                holds contact shapes.
        """
        if CONTACT_GROUP in set(groups):
            raise SurveyError(f"geom group {CONTACT_GROUP} holds contact shapes, which are not the surface")
        self.site = _find_id(model.site, "site", site)
        self.scanner = scanner or LaserScanner()
        self.directions = self.scanner.directions if directions is None else _normalize(directions)
        bodies = [int(model.site_bodyid[self.site])]
        if exclude is not None:
            bodies = [_find_id(model.body, "body", name) for name in exclude]
        bodies = [body for body in bodies if body > 0]  # the world is the body of no site that moves
        self._model = copy(model)  # in which what is excluded is in a group that is not seen
        self._model.geom_group[np.isin(model.geom_bodyid, bodies)] = CONTACT_GROUP
        self._groups = np.isin(np.arange(mujoco.mjNGROUP), list(groups)).astype(np.uint8)

    @property
    def num_beams(self) -> int:
        """Number of beams."""
        return len(self.directions)

    def read(self, data: mujoco.MjData, rng: np.random.Generator | None = None) -> Float[np.ndarray, " R"]:
        """Return the ranges now [m], nan where nothing is within the scanner's range.

        Args:
            data: a state whose positions are computed (`mj_forward`, or any step).
            rng: source of the errors; None: exact.
        """
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.site_xmat[self.site].reshape(3, 3), data.site_xpos[self.site]

        def cast(origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
            return cast_rays(self._model, data, self._groups, origin, directions)[0]

        if rng is not None:
            return self.scanner.scan(cast, pose, rng, self.directions)[0]
        ranges = cast(pose[:3, 3], self.directions @ pose[:3, :3].T)
        return np.where(ranges <= self.scanner.max_range, ranges, np.nan)


def _normalize(directions: ArrayLike) -> Float[np.ndarray, "R 3"]:
    array = np.asarray(directions, dtype=np.float64)
    length = np.linalg.norm(array, axis=-1, keepdims=True)
    if array.ndim != 2 or array.shape[1] != 3 or not (np.isfinite(length) & (length > 0)).all():
        raise SurveyError(f"directions must be [R, 3] vectors with a length, got shape {array.shape}")
    return array / length


def _find_id(find: Callable[[Any], Any], what: str, name: str | int) -> int:
    """Return the id of what MuJoCo finds by a name or an id."""
    try:
        return int(find(name).id)
    except (KeyError, IndexError) as error:
        raise SurveyError(f"the model has no {what} {name!r}: {error.args[0]}") from error


_FARTHEST = 50.0  # What is farther is not seen [m]
_ON_SURFACE = 0.01  # What is farther from the arena's surface is another body [m]
_BODY, _SKY = 0.4, 0.0  # Gray of other bodies, and of what is not there
_AXES = {"x": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "z": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]}
"""Axis that the camera looks along -> ahead, left and up, in the frame of the site."""


class Camera:
    """A camera at a site: what it would see there now.

    It sees the colors of the arena; other bodies are gray.

    Attributes:
        config: exposure and noise.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        site: str | int,
        arena: "Arena",
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
        self._arena, self._frame = arena, np.array(_AXES[axis], dtype=np.float64)
        self._finder = RangeFinder(model, site, LaserScanner(max_range=_FARTHEST), exclude=exclude)

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
        return expose(colors, self.config, rng).reshape(height, width, 3)

    def _see(self, data: mujoco.MjData, directions: Float[np.ndarray, "R 3"]) -> Float[np.ndarray, "R 3"]:
        """Return the colors (0 to 1) of what is in directions: ahead, left, up."""
        finder = self._finder
        finder.directions = directions @ self._frame
        ranges = finder.read(data)
        rotation = data.site_xmat[finder.site].reshape(3, 3)
        is_hit = np.isfinite(ranges)
        places = data.site_xpos[finder.site] + ranges[is_hit, None] * (finder.directions[is_hit] @ rotation.T)
        colors = np.full((len(directions), 3), _SKY)
        if is_hit.any():
            surface = self._arena.surface
            distance, _, _ = find_nearest(places, np.asarray(surface.vertices), np.asarray(surface.faces))
            is_body = distance > _ON_SURFACE
            colors[is_hit] = np.where(is_body[:, None], _BODY, self._arena.find_colors(places))
        return colors
