"""Where a camera sees an organism: not from inside a hill, and not through a wall."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.spec import SURFACE_GROUP

_TURNS = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 120.0, -120.0, 150.0, -150.0, 180.0)
"""Changes of the azimuth that are tried, the nearest first [deg] ..."""
_LIFTS = (0.0, -20.0, -40.0, -65.0)
"""... at each of these changes of the elevation [deg]: looking down more steeply, up to `_STEEPEST`."""
_STEEPEST = -85.0
_MOST_SHEETS = 8
"""Surfaces seen from behind, which are not drawn, that a line of sight passes at most."""
_STEP = 1e-4
"""A line of sight goes on this far behind a surface [m]."""
_CLEARANCE = 0.9
"""Share of the free way that is used where no view is free."""
_LEAST_DISTANCE = 0.3
"""The camera is not nearer to the organism than this [m]."""


_SEEN_SHARE = 0.5
"""Share of the points that a free view shows."""


class View(NamedTuple):
    """Where a camera stands, seen from what it looks at.

    Attributes:
        azimuth: direction in plan in which it looks [deg].
        elevation: negative looks down [deg].
        distance: [m].
    """

    azimuth: float
    elevation: float
    distance: float


class Sight:
    """Lines of sight in a scene; only the arena's surface, as it is drawn, ends them."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look at a simulation; nothing of it is changed."""
        self._model, self._data = model, data
        self._groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        self._groups[SURFACE_GROUP] = 1

    def find_view(
        self,
        target: Float[np.ndarray, " 3"],
        wanted: View,
        current: View | None = None,
        points: Float[np.ndarray, "P 3"] | None = None,
    ) -> View:
        """Return the wanted view where it is free, else the current one, else the nearest that is free.

        A view is free that shows at least half of the points. Where none does, it is the one that shows most of them;
        where none shows any, the camera comes as near as it must.
        """
        seen = target[None] if points is None else points
        views = [
            View(wanted.azimuth + turn, max(wanted.elevation + lift, _STEEPEST), wanted.distance)
            for lift in _LIFTS
            for turn in _TURNS
        ]
        candidates = [wanted, *([] if current is None else [current]), *views]
        best, most = wanted, 0.0
        for view in candidates:
            eye = target + view.distance * _find_way(view)
            share = float(np.mean([np.isinf(self._find_free_way(point, eye)) for point in seen]))
            if share >= _SEEN_SHARE:
                return view
            if share > most:
                best, most = view, share
        return best if most > 0.0 else self._come_near(target, candidates)

    def _come_near(self, target: Float[np.ndarray, " 3"], views: list[View]) -> View:
        """Return the view with the longest free way to the target, from within that way."""
        ways = [self._find_free_way(target, target + view.distance * _find_way(view)) for view in views]
        longest = int(np.argmax(ways))
        distance = views[longest].distance
        near = max(_CLEARANCE * ways[longest], min(_LEAST_DISTANCE, distance))
        return views[longest]._replace(distance=min(near, distance))

    def _find_free_way(self, target: Float[np.ndarray, " 3"], eye: Float[np.ndarray, " 3"]) -> float:
        """Return how far from a target the first surface is that hides it from the camera [m]; inf without one."""
        distance = float(np.linalg.norm(eye - target))
        way = (eye - target) / distance
        passed, geom, normal = 0.0, np.full(1, -1, dtype=np.int32), np.zeros(3)
        for _ in range(_MOST_SHEETS):
            gap = mujoco.mj_ray(
                self._model, self._data, target + passed * way, way, self._groups, 1, -1, geom, normal
            )
            if gap < 0 or passed + gap >= distance:
                return np.inf
            passed += gap + _STEP
            if normal @ way > 0:  # its front is towards the camera: it is drawn, and hides the target
                return passed
        return passed


def _find_way(view: View) -> Float[np.ndarray, " 3"]:
    """Return the direction from what a camera looks at to the camera."""
    azimuth, elevation = np.radians(view.azimuth), np.radians(view.elevation)
    return -np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
