"""Range finders at a site of a running simulation, by casting rays on exact surfaces."""

from collections.abc import Callable, Iterable
from copy import copy
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from symbrion_gym._src.arenas.spec import CONTACT_GROUP
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.survey_robot import LaserScanner
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
