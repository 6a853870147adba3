"""The room in which a survey takes place, and rays in it."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8

from symbrion_gym._src.arenas.primitives import add_mesh
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.survey_robot import Cast

Corner = Float[np.ndarray, " 2"]  # x and y [m]

_SURFACE, _FLOOR, _SKIRT, _WALLS = 2, 1, 3, 4
"""Geom groups: the arena, the ground around it, black skirting, and the room's walls."""
_THICKNESS = 0.2  # Of the walls [m]; rays see their insides alone
_SKIRT_DEPTH = 0.02
"""How far below the arena's lowest point the skirting hangs [m], so that no ray passes under it."""
_FLOOR_DEPTH = 0.002  # Thickness of the ground [m]
_WALL_DEPTH = 0.5  # How far the walls reach below the ground [m]
Rectangle = tuple[Corner, Corner]  # Lowest and highest x and y [m]


_GAP = 0.10  # Between the arena's bounding box and the ground around it [m]
_MARGIN = 1.5  # Between the path and the walls [m]
_HEIGHT = 3.0  # Of the walls [m]; above the horizontal scanner
_PILASTER_WIDTH, _PILASTER_DEPTH = (0.25, 0.6), (0.25, 0.5)
"""Smallest and largest, along the wall and off it [m]."""
_PILASTER_SPACING = (0.6, 1.6)
"""Smallest and largest distance from one to the next [m]; uneven, so that no two views are alike."""
_FIRST_PILASTER = (0.4, 1.0)  # Smallest and largest distance of the first from the corner [m]
_LAST_PILASTER = 0.6  # Distance of the last from the other corner, at least [m]
_ROOM = 1  # Seed of the pilasters
_ALL_BUT_WALLS = np.array([1, 1, 1, 1, 0, 0], np.uint8)
_WALLS_ONLY = np.array([0, 0, 0, 0, 1, 0], np.uint8)


class SurveyWorld:
    """Casts rays on an arena in its room: what either scanner of the survey's robot sees.

    The ground begins 0.1 m off the arena's bounding box; between them, and where the arena's open sides end,
    hangs black skirting that returns nothing: a survey shows the arena's own surface alone. The room's
    walls, with uneven pilasters, stand 1.5 m beyond the path; only the horizontal scanner sees them.
    """

    def __init__(self, surface: trimesh.Trimesh, waypoints: Float[np.ndarray, "W 2"]) -> None:
        """Build the room around an arena."""
        spec = mujoco.MjSpec()
        bounds = np.asarray(surface.bounds, float)
        ground = bounds[0, 2]
        look: dict[str, Any] = {"contype": 0, "conaffinity": 0, "mass": 0}
        add_mesh(spec, spec.worldbody, "surface", surface, group=_SURFACE, **look)
        skirt = _make_skirt(surface, ground - _SKIRT_DEPTH)
        if skirt is not None:
            add_mesh(spec, spec.worldbody, "skirt", skirt, group=_SKIRT, **look)
        low = np.minimum(waypoints.min(0), bounds[0, :2]) - _MARGIN
        high = np.maximum(waypoints.max(0), bounds[1, :2]) + _MARGIN
        for a, b in _frame(low, high, bounds[0, :2] - _GAP, bounds[1, :2] + _GAP):
            _add_box(spec, a, b, ground - _FLOOR_DEPTH, ground, _FLOOR)
        walls = _frame(low - _THICKNESS, high + _THICKNESS, low, high)
        for a, b in (*walls, *_make_pilasters(low, high)):
            _add_box(spec, a, b, ground - _WALL_DEPTH, ground + _HEIGHT, _WALLS)
        try:
            self._model = spec.compile()
        except ValueError as error:
            raise SurveyError(f"survey: MuJoCo refuses the mesh: {' '.join(str(error).split())}") from error
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._is_black = self._model.geom_group == _SKIRT
        self.cast_on_arena: Cast = partial(self._cast, _ALL_BUT_WALLS)  # to the arena and the ground
        self.cast_on_walls: Cast = partial(self._cast, _WALLS_ONLY)

    def _cast(
        self, groups: np.ndarray, origin: Float[np.ndarray, " 3"], directions: Float[np.ndarray, "R 3"]
    ) -> Float[np.ndarray, " R"]:
        distances, geoms = cast_rays(self._model, self._data, groups, origin, directions)
        distances[self._is_black[geoms]] = np.inf
        return distances


def cast_rays(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    groups: UInt8[np.ndarray, " G"],
    origin: Float[np.ndarray, " 3"],
    directions: Float[np.ndarray, "R 3"],
) -> tuple[Float[np.ndarray, " R"], Int[np.ndarray, " R"]]:
    """Return the distances of the first geoms along unit vectors [m], and the geoms; inf and -1 for none."""
    count = len(directions)
    distances, geoms = np.empty(count), np.empty(count, np.int32)
    mujoco.mj_multiRay(
        model, data, np.ascontiguousarray(origin), np.ascontiguousarray(directions).ravel(), groups, True, -1,
        geoms, distances, None, count, mujoco.mjMAXVAL,
    )  # fmt: skip
    distances[geoms < 0] = np.inf
    return distances, geoms


def _add_box(
    spec: mujoco.MjSpec, low: np.ndarray, high: np.ndarray, bottom: float, top: float, group: int
) -> None:
    corners = np.array([[*low, bottom], [*high, top]])
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, pos=corners.mean(0), size=np.diff(corners, axis=0)[0] / 2,
        group=group, contype=0, conaffinity=0,
    )  # fmt: skip


def _frame(low: Corner, high: Corner, inner_low: Corner, inner_high: Corner) -> list[Rectangle]:
    """Cut the ground around the arena into four rectangles."""
    (x0, y0), (x1, y1), (a0, b0), (a1, b1) = low, high, inner_low, inner_high
    corners = [((x0, y0), (a0, y1)), ((a1, y0), (x1, y1)), ((a0, y0), (a1, b0)), ((a0, b1), (a1, y1))]
    return [(np.array(first), np.array(last)) for first, last in corners]


def _make_pilasters(low: Corner, high: Corner) -> Iterator[Rectangle]:
    """Make unevenly spaced pilasters along the walls, so that every view has corners."""
    rng = np.random.default_rng(_ROOM)
    for axis in (0, 1):
        for side in (0, 1):
            at = low[axis] + rng.uniform(*_FIRST_PILASTER)
            while at < high[axis] - _LAST_PILASTER:
                width, depth = rng.uniform(*_PILASTER_WIDTH), rng.uniform(*_PILASTER_DEPTH)
                wall = (low, high)[side][1 - axis]
                span = sorted((wall, wall + (depth if side == 0 else -depth)))
                a, b = np.zeros(2), np.zeros(2)
                a[axis], b[axis], a[1 - axis], b[1 - axis] = at, at + width, *span
                yield a, b
                at += width + rng.uniform(*_PILASTER_SPACING)


def _make_skirt(surface: trimesh.Trimesh, bottom: float) -> trimesh.Trimesh | None:
    """Hang the boundary edges down to the ground; None for a closed surface."""
    surface = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    surface.merge_vertices()
    edges, counts = np.unique(surface.edges_sorted, axis=0, return_counts=True)
    rim = edges[counts == 1]
    if not len(rim):
        return None
    upper = surface.vertices[rim].reshape(-1, 3)
    lower = upper.copy()
    lower[:, 2] = bottom
    count = len(upper)
    i = np.arange(0, count, 2)
    faces = np.concatenate(
        [np.stack([i, i + 1, count + i], 1), np.stack([i + 1, count + i + 1, count + i], 1)]
    )
    return trimesh.Trimesh(np.concatenate([upper, lower]), faces, process=False)
