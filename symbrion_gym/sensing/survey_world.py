"""The room in which a survey takes place, and rays in it."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from symbrion_gym.errors import ArenaError

_SURFACE, _FLOOR, _SKIRT, _WALLS = 2, 1, 3, 4
"""Geom groups: the arena, the ground beside it, black skirting, and the room's walls."""
_GAP = 0.10
"""Between the arena's bounding box and the ground around it [m]."""
_MARGIN = 1.5
"""Between the path and the room's walls [m]."""
_ALL_BUT_WALLS = np.array([1, 1, 1, 1, 0, 0], np.uint8)
_WALLS_ONLY = np.array([0, 0, 0, 0, 1, 0], np.uint8)


class SurveyWorld:
    """Casts rays on an arena in its room: what either scanner of the survey's robot sees.

    The ground begins 0.1 m off the arena's bounding box; between them, and where the arena's open sides end,
    hangs black skirting that returns nothing: a survey shows the arena's own surface alone. The room's
    walls, with uneven pilasters, stand 1.5 m beyond the path; only the horizontal scanner sees them.
    """

    def __init__(self, surface: trimesh.Trimesh, waypoints: np.ndarray) -> None:
        spec = mujoco.MjSpec()
        bounds = np.asarray(surface.bounds, float)
        ground = bounds[0, 2]
        _add_mesh(spec, "surface", surface.vertices, surface.faces, _SURFACE)
        skirt = _make_skirt(surface, ground - 0.02)
        if skirt is not None:
            _add_mesh(spec, "skirt", *skirt, _SKIRT)
        low = np.minimum(waypoints.min(0), bounds[0, :2]) - _MARGIN
        high = np.maximum(waypoints.max(0), bounds[1, :2]) + _MARGIN
        for a, b in _frame(low, high, bounds[0, :2] - _GAP, bounds[1, :2] + _GAP):
            _add_box(spec, a, b, ground - 0.002, ground, _FLOOR)
        for a, b in _make_walls(low, high):
            _add_box(spec, a, b, ground - 0.5, ground + 3.0, _WALLS)
        try:
            self._model = spec.compile()
        except ValueError as error:
            raise ArenaError(f"survey: MuJoCo refuses the mesh: {' '.join(str(error).split())}") from error
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._is_black = self._model.geom_group == _SKIRT

    def see_arena(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        return self._cast(origin, directions, _ALL_BUT_WALLS)

    def see_walls(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        return self._cast(origin, directions, _WALLS_ONLY)

    def _cast(self, origin: np.ndarray, directions: np.ndarray, groups: np.ndarray) -> np.ndarray:
        count = len(directions)
        geoms, distances = np.empty(count, np.int32), np.empty(count)
        mujoco.mj_multiRay(
            self._model, self._data, origin, np.ascontiguousarray(directions).ravel(), groups, True, -1,
            geoms, distances, None, count, mujoco.mjMAXVAL,
        )  # fmt: skip
        distances[(geoms < 0) | self._is_black[geoms]] = np.inf
        return distances


def _add_mesh(spec: mujoco.MjSpec, name: str, vertices: np.ndarray, faces: np.ndarray, group: int) -> None:
    mesh = spec.add_mesh(name=name)
    mesh.uservert = np.asarray(vertices, np.float32).ravel()
    mesh.userface = np.asarray(faces, np.int32).ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, group=group, contype=0, conaffinity=0, mass=0
    )


def _add_box(
    spec: mujoco.MjSpec, low: np.ndarray, high: np.ndarray, bottom: float, top: float, group: int
) -> None:
    corners = np.array([[*low, bottom], [*high, top]])
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, pos=corners.mean(0), size=np.diff(corners, axis=0)[0] / 2,
        group=group, contype=0, conaffinity=0,
    )  # fmt: skip


def _frame(low: np.ndarray, high: np.ndarray, inner_low: np.ndarray, inner_high: np.ndarray) -> list[tuple]:
    """Cut the ground around the arena into four rectangles."""
    (x0, y0), (x1, y1), (a0, b0), (a1, b1) = low, high, inner_low, inner_high
    return [
        (np.array(a), np.array(b))
        for a, b in (((x0, y0), (a0, y1)), ((a1, y0), (x1, y1)), ((a0, y0), (a1, b0)), ((a0, b1), (a1, y1)))
    ]


def _make_walls(low: np.ndarray, high: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Make the room: four walls and unevenly spaced pilasters, so that every view has corners."""
    (x0, y0), (x1, y1) = low, high
    t = 0.2
    boxes: list[tuple] = [
        ((x0 - t, y0 - t), (x1 + t, y0)),
        ((x0 - t, y1), (x1 + t, y1 + t)),
        ((x0 - t, y0), (x0, y1)),
        ((x1, y0), (x1 + t, y1)),
    ]
    rng = np.random.default_rng(1)
    for axis in (0, 1):
        for side in (0, 1):
            at = low[axis] + rng.uniform(0.4, 1.0)
            while at < high[axis] - 0.6:
                width, depth = rng.uniform(0.25, 0.6), rng.uniform(0.25, 0.5)
                wall = (low, high)[side][1 - axis]
                span = sorted((wall, wall + (depth if side == 0 else -depth)))
                a, b = [0.0, 0.0], [0.0, 0.0]
                a[axis], b[axis], a[1 - axis], b[1 - axis] = at, at + width, *span
                boxes.append((tuple(a), tuple(b)))
                at += width + rng.uniform(0.6, 1.6)
    return [(np.array(a), np.array(b)) for a, b in boxes]


def _make_skirt(surface: trimesh.Trimesh, bottom: float) -> tuple[np.ndarray, np.ndarray] | None:
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
    return np.concatenate([upper, lower]), faces
