"""Where a camera sees an organism: not from inside a hill, and not through a wall."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym.arenas.spec import SURFACE_GROUP

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

    def find_view(self, target: Float[np.ndarray, " 3"], wanted: View, current: View | None = None) -> View:
        """Return the wanted view where it is free, else the current one, else the nearest that is free.

        Where none is, the camera comes as near as it must.

        Args:
            target: what the camera looks at [m].
            wanted: the view to have.
            current: the view before, kept while it is free, so that a film does not jump; None for none.
        """
        views = [
            View(wanted.azimuth + turn, max(wanted.elevation + lift, _STEEPEST), wanted.distance)
            for lift in _LIFTS
            for turn in _TURNS
        ]
        best, most = wanted, -np.inf
        for view in [wanted, *([] if current is None else [current]), *views]:
            free = self._find_free_way(target, view)
            if free >= view.distance:
                return view
            if free > most:
                best, most = view, free
        return best._replace(distance=max(_CLEARANCE * most, min(_LEAST_DISTANCE, wanted.distance)))

    def _find_free_way(self, target: Float[np.ndarray, " 3"], view: View) -> float:
        """Return how far from the target the first surface is that faces away from it [m]; inf without one."""
        azimuth, elevation = np.radians(view.azimuth), np.radians(view.elevation)
        way = -np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        passed, geom, normal = 0.0, np.full(1, -1, dtype=np.int32), np.zeros(3)
        for _ in range(_MOST_SHEETS):
            gap = mujoco.mj_ray(
                self._model, self._data, target + passed * way, way, self._groups, 1, -1, geom, normal
            )
            if gap < 0 or passed + gap >= view.distance:
                return np.inf
            passed += gap + _STEP
            if normal @ way > 0:  # its front is towards the camera: it is drawn, and hides the target
                return passed
        return passed
