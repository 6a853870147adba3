"""Rays among robots in an arena: against its exact surface, and against the chassis of robots."""

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.rows import dot_all, dot_rows
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.quality import RayMesh
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.world import SwarmState

_CELL = 0.05  # Edge of the cells of the highest surface [m]: half of a robot
_MOST_CELLS = 4_000_000  # Cells are wider where there would be more of them
_LEAST = 1e-12  # Components of directions are not smaller than this: no division by zero


class Sight(RayMesh):
    """Casts rays on the surface of an arena and on the chassis of robots, boxes of the size of a Scout."""

    def __init__(self, arena: Arena, scout: ScoutConfig) -> None:
        super().__init__([arena.surface])
        self._half = np.array(scout.size) / 2
        self.robot_radius = float(np.linalg.norm(self._half))  # Of a ball about the chassis [m]
        self._low, self._cell, self._top = _find_tops(np.asarray(arena.surface.triangles))

    def cast_on_robots(
        self,
        origins: Float[np.ndarray, "R 3"],
        directions: Float[np.ndarray, "R 3"],
        state: SwarmState,
        rays: Int[np.ndarray, " P"],
        robots: Int[np.ndarray, " P"],
    ) -> Float[np.ndarray, " R"]:
        """Return the distance of the nearest chassis along each ray [m]; inf for none. A ray within one is at 0."""
        distances = np.full(len(origins), np.inf)
        rotation = state.rotation[robots]
        place, direction = origins[rays] - state.position[robots], directions[rays]
        enter, leave = np.zeros(len(rays)), np.full(len(rays), np.inf)
        for axis, half in enumerate(self._half):
            normal = rotation[:, :, axis]
            start, ahead = dot_rows(place, normal), dot_rows(direction, normal)
            ahead = np.where(np.abs(ahead) < _LEAST, _LEAST, ahead)
            one, other = (-half - start) / ahead, (half - start) / ahead
            enter = np.maximum(enter, np.minimum(one, other))
            leave = np.minimum(leave, np.maximum(one, other))
        hit = np.where(enter <= leave, enter, np.inf)
        np.minimum.at(distances, rays, hit)
        return distances

    def find_clear(
        self,
        places: Float[np.ndarray, "F 3"],
        ends: Float[np.ndarray, "R 3"],
        fan: Int[np.ndarray, " R"],
        state: SwarmState,
        first: Int[np.ndarray, " R"],
        second: Int[np.ndarray, " R"],
    ) -> Bool[np.ndarray, " R"]:
        """Return whether neither surface nor a third robot is between two places."""
        starts = places[fan]
        way = ends - starts
        length = np.sqrt(dot_rows(way, way))
        directions = way / np.maximum(length, _LEAST)[:, None]
        place = state.position
        ahead = dot_all(directions, place) - dot_rows(directions, starts)[:, None]
        squared = dot_rows(place, place) + dot_rows(starts, starts)[:, None] - 2.0 * dot_all(starts, place)
        along = np.clip(ahead, 0.0, length[:, None])
        beside = squared + along * (along - 2.0 * ahead)
        beside[np.arange(len(first)), first] = np.inf
        beside[np.arange(len(second)), second] = np.inf
        rays, robots = np.nonzero(beside < self.robot_radius**2)
        is_free = ~(self.cast_on_robots(starts, directions, state, rays, robots) < length)
        left = np.flatnonzero(is_free)
        counts = np.bincount(fan[left], minlength=len(places))
        is_free[left] = ~(self.cast_fans(places, directions[left], counts) < length[left])
        return is_free

    def may_hit(
        self, origins: Float[np.ndarray, "R 3"], directions: Float[np.ndarray, "R 3"], reach: float
    ) -> Bool[np.ndarray, " R"]:
        """Return which rays come below the highest surface of a cell that they pass within reach [m]."""
        along = np.linspace(0.0, 1.0, int(np.ceil(reach / self._cell)) + 1)[:, None] * reach
        x, y, z = (origins[:, k] + along * directions[:, k] for k in range(3))
        i, j = (
            np.clip(((value - low) / self._cell).astype(np.int64), 0, count - 1)
            for value, low, count in zip((x, y), self._low, self._top.shape, strict=True)
        )
        lowest = z - self._cell * np.abs(directions[:, 2])
        return np.any(lowest <= self._top[i, j], axis=0)


def _find_tops(
    triangles: Float[np.ndarray, "T 3 3"],
) -> tuple[Float[np.ndarray, " 2"], float, Float[np.ndarray, "X Y"]]:
    """Return corner, edge and heights of a grid: the highest surface in and next to each cell [m]; -inf for none."""
    from scipy.ndimage import grey_dilation

    low, high = triangles[..., :2].min(axis=(0, 1)), triangles[..., :2].max(axis=(0, 1))
    cell = max(_CELL, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    low = low - 2 * cell
    top = np.full(tuple(np.ceil((high + 2 * cell - low) / cell).astype(np.int64)), -np.inf)
    first, last = (
        np.floor((ends - low) / cell).astype(np.int64)
        for ends in (triangles[..., :2].min(axis=1), triangles[..., :2].max(axis=1))
    )
    for (i, j), (k, m), z in zip(first, last, triangles[..., 2].max(axis=1), strict=True):
        part = top[i : k + 1, j : m + 1]
        np.maximum(part, z, out=part)
    return low, cell, grey_dilation(top, size=(3, 3), mode="nearest")
