"""Laser scans and infrared readings in a running simulation, by casting rays on exact surfaces."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from symbrion_gym._src.arenas.spec import CONTACT_GROUP
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.laser_scanner import LaserScanner

_STEP_BEYOND = 1e-6  # How far behind an excluded geom a ray goes on [m]
_MAX_LAYERS = 32
"""A ray that meets more excluded geoms than this hits nothing: an organism has fewer along any line."""
_INFRARED_NOISE = 0.002  # Standard deviation of an infrared unit's distance [m] (estimate)


class RangeFinder:
    """A range finder at a site: what it would read there now.

    Its beams lie in the site's x-y plane, beam angle 0 along x, unless other directions are given. Rays see
    every geom but those of group 3 (an arena's contact pieces, which are not where the surface is) and those of the
    excluded bodies. One
    `mj_multiRay` casts a scan; where beams meet an excluded body first, those beams are cast once more from
    behind it. With a generator the reading has the scanner's errors, the same as in a survey
    (`LaserScanner`), and needs a second cast for the rims of the light spots.

    Attributes:
        scanner: beams, range and errors.
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
        self._model = model
        self._site = _find_id(model, mujoco.mjtObj.mjOBJ_SITE, site)
        self.scanner = scanner or LaserScanner()
        self.directions = self._find_directions(directions)
        bodies = [int(model.site_bodyid[self._site])]
        if exclude is not None:
            bodies = [_find_id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in exclude]
        bodies = [body for body in bodies if body > 0]  # the world is the body of no site that moves
        self._is_excluded = np.isin(model.geom_bodyid, bodies)
        self._first_body = bodies[0] if len(bodies) else -1
        self._groups = np.isin(np.arange(mujoco.mjNGROUP), list(groups)).astype(np.uint8)
        if CONTACT_GROUP in set(groups):
            raise SurveyError(f"geom group {CONTACT_GROUP} holds contact shapes, which are not the surface")

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
        pose = self._pose(data)

        def cast(origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
            return self._cast(data, origin, directions)

        if rng is not None:
            return self.scanner.measure(cast, pose, self.directions, rng)[0]
        ranges = cast(pose[:3, 3], self.directions @ pose[:3, :3].T)
        return np.where(ranges <= self.scanner.max_range, ranges, np.nan)

    def _find_directions(self, directions: ArrayLike | None) -> Float[np.ndarray, "R 3"]:
        if directions is None:
            return self.scanner.directions
        array = np.asarray(directions, dtype=np.float64)
        length = np.linalg.norm(array, axis=-1, keepdims=True) if array.ndim == 2 else np.zeros(1)
        if array.ndim != 2 or array.shape[1] != 3 or not (np.isfinite(length) & (length > 0)).all():
            raise SurveyError(f"directions must be [R, 3] vectors with a length, got shape {array.shape}")
        return array / length

    def _pose(self, data: mujoco.MjData) -> Float[np.ndarray, "4 4"]:
        """Return the pose of the site, site -> world."""
        pose = np.eye(4)
        pose[:3, :3] = data.site_xmat[self._site].reshape(3, 3)
        pose[:3, 3] = data.site_xpos[self._site]
        return pose

    def _cast(
        self, data: mujoco.MjData, origin: Float[np.ndarray, " 3"], directions: Float[np.ndarray, "R 3"]
    ) -> Float[np.ndarray, " R"]:
        """Return distances to the first geom that is not excluded, inf where there is none."""
        distances, geoms = self._cast_once(data, origin, directions)
        for ray in np.flatnonzero((geoms >= 0) & self._is_excluded[geoms]):
            distances[ray], geoms[ray] = self._go_on(data, origin, directions[ray], distances[ray])
        distances[geoms < 0] = np.inf
        return distances

    def _cast_once(
        self, data: mujoco.MjData, origin: Float[np.ndarray, " 3"], directions: Float[np.ndarray, "R 3"]
    ) -> tuple[Float[np.ndarray, " R"], Int[np.ndarray, " R"]]:
        """Return distances to the first geom and its id; -1 where there is none."""
        count = len(directions)
        distances, geoms = np.empty(count), np.empty(count, np.int32)
        mujoco.mj_multiRay(
            self._model, data, np.ascontiguousarray(origin), np.ascontiguousarray(directions).ravel(),
            self._groups, True, self._first_body, geoms, distances, None, count, mujoco.mjMAXVAL,
        )  # fmt: skip
        return distances, geoms

    def _go_on(
        self,
        data: mujoco.MjData,
        origin: Float[np.ndarray, " 3"],
        direction: Float[np.ndarray, " 3"],
        distance: float | Float[np.ndarray, ""],
    ) -> tuple[float, int]:
        """Follow a ray through excluded geoms; return the distance and what is hit at last, -1: nothing."""
        for _ in range(_MAX_LAYERS):
            distance += _STEP_BEYOND
            further, geoms = self._cast_once(data, origin + distance * direction, direction[None])
            if geoms[0] < 0:
                return np.inf, -1
            distance += float(further[0])
            if not self._is_excluded[geoms[0]]:
                return float(distance), int(geoms[0])
        return np.inf, -1


def _find_id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str | int) -> int:
    """Return the id of a name, or a checked id."""
    count = model.nsite if kind == mujoco.mjtObj.mjOBJ_SITE else model.nbody
    what = "site" if kind == mujoco.mjtObj.mjOBJ_SITE else "body"
    found = mujoco.mj_name2id(model, kind, name) if isinstance(name, str) else int(name)
    if not 0 <= found < count:
        names = [mujoco.mj_id2name(model, kind, i) or str(i) for i in range(count)]
        raise SurveyError(f"the model has no {what} {name!r}; there are: {', '.join(names) or 'none'}")
    return found
