"""Rays among robots in an arena: against its exact surface, and against the chassis of robots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym.contact.ray_mesh import RayMesh

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym.arenas.arena import Arena
    from symbrion_gym.robot.scout_constants import ScoutConfig
    from symbrion_gym.swarm.world import SwarmState

_CELL = 0.05
"""Edge of the cells of the highest surface [m]: half of a robot."""
_MOST_CELLS = 4_000_000
"""Cells are wider where there would be more of them."""
_PROBES = 0.05
"""Spacing of the places at which a ray is compared with the highest surface [m]: cells about them are included."""
_LEAST = 1e-12
"""Components of directions are not smaller than this: no division by zero."""


class Sight:
    """Casts rays; those that stay above everything in the cells that they pass are not cast on the surface.

    Args:
        arena: whose surface is hit.
        scout: whose chassis, boxes of its size, are hit.
    """

    def __init__(self, arena: Arena, scout: ScoutConfig) -> None:
        self._mesh = RayMesh([arena.surface])
        self._half = np.array(scout.size) / 2
        self._low, self._cell, self._top = _find_tops(np.asarray(arena.surface.triangles))

    @property
    def robot_radius(self) -> float:
        """Radius of a ball about the chassis [m]."""
        return float(np.linalg.norm(self._half))

    def cast_on_surface(
        self,
        origins: Float[np.ndarray, "R 3"],
        directions: Float[np.ndarray, "R 3"],
        max_ranges: Float[np.ndarray, " R"],
    ) -> Float[np.ndarray, " R"]:
        """Return the distance of the exact surface along each ray [m]; inf beyond its range.

        Args:
            origins: where rays begin [m]; those that share one are cheaper.
            directions: unit vectors.
            max_ranges: [m].
        """
        distances = np.full(len(origins), np.inf)
        rays = np.flatnonzero(self._is_near(origins, directions, max_ranges))
        distances[rays] = self._mesh.cast(origins[rays], directions[rays])
        distances[distances > max_ranges] = np.inf
        return distances

    def cast_on_robots(
        self,
        origins: Float[np.ndarray, "R 3"],
        directions: Float[np.ndarray, "R 3"],
        state: SwarmState,
        rays: Int[np.ndarray, " P"],
        robots: Int[np.ndarray, " P"],
    ) -> Float[np.ndarray, " R"]:
        """Return the distance of the nearest chassis along each ray [m]; inf for none. A ray within one is at 0.

        Args:
            origins: where rays begin [m].
            directions: unit vectors.
            state: of the robots.
            rays: which ray of each pair that is tried.
            robots: which robot.
        """
        distances = np.full(len(origins), np.inf)
        rotation = state.rotation[robots]
        start = np.einsum("pji,pj->pi", rotation, origins[rays] - state.position[robots])
        ahead = np.einsum("pji,pj->pi", rotation, directions[rays])
        ahead = np.where(np.abs(ahead) < _LEAST, _LEAST, ahead)
        one, other = (-self._half - start) / ahead, (self._half - start) / ahead
        enter = np.minimum(one, other).max(axis=1)
        leave = np.maximum(one, other).min(axis=1)
        hit = np.where((enter <= leave) & (leave >= 0.0), np.maximum(enter, 0.0), np.inf)
        np.minimum.at(distances, rays, hit)
        return distances

    def is_clear(
        self,
        starts: Float[np.ndarray, "R 3"],
        ends: Float[np.ndarray, "R 3"],
        state: SwarmState,
        first: Int[np.ndarray, " R"],
        second: Int[np.ndarray, " R"],
    ) -> Bool[np.ndarray, " R"]:
        """Return whether neither surface nor a third robot is between two places.

        Args:
            starts: [m].
            ends: [m].
            state: of the robots.
            first: robot at each start, which is in nobody's way.
            second: robot at each end, likewise.
        """
        way = ends - starts
        length = np.linalg.norm(way, axis=1)
        directions = way / np.maximum(length, _LEAST)[:, None]
        is_hit = self.cast_on_surface(starts, directions, length) < np.inf
        to_robot = state.position[None] - starts[:, None]
        along = np.clip(np.einsum("rnj,rj->rn", to_robot, directions), 0.0, length[:, None])
        squared = np.einsum("rnj,rnj->rn", to_robot, to_robot)
        beside = squared - 2 * along * np.einsum("rnj,rj->rn", to_robot, directions) + along**2
        beside[np.arange(len(first)), first] = np.inf
        beside[np.arange(len(second)), second] = np.inf
        rays, robots = np.nonzero(beside < self.robot_radius**2)
        return ~is_hit & ~(self.cast_on_robots(starts, directions, state, rays, robots) < length)

    def _is_near(
        self,
        origins: Float[np.ndarray, "R 3"],
        directions: Float[np.ndarray, "R 3"],
        max_ranges: Float[np.ndarray, " R"],
    ) -> Bool[np.ndarray, " R"]:
        """Return whether a ray may hit something: it comes below the highest surface of a cell that it passes."""
        is_near = np.zeros(len(origins), bool)
        longest = float(max_ranges.max(initial=0.0))
        for along in np.arange(0.0, longest + self._cell, self._cell):
            reach = np.minimum(along, max_ranges)
            place = origins + reach[:, None] * directions
            lowest = place[:, 2] - self._cell * np.abs(directions[:, 2])
            cell = np.floor((place[:, :2] - self._low) / self._cell).astype(np.int64)
            cell = np.clip(cell, 0, np.array(self._top.shape) - 1)
            is_near |= lowest <= self._top[cell[:, 0], cell[:, 1]]
        return is_near


def _find_tops(
    triangles: Float[np.ndarray, "T 3 3"],
) -> tuple[Float[np.ndarray, " 2"], float, Float[np.ndarray, "X Y"]]:
    """Return corner, edge and heights of a grid: the highest surface in and next to each cell [m]; -inf for none."""
    from scipy.ndimage import grey_dilation

    low, high = triangles[..., :2].min(axis=(0, 1)), triangles[..., :2].max(axis=(0, 1))
    cell = max(_CELL, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    low = low - 2 * cell
    shape = np.ceil((high + 2 * cell - low) / cell).astype(np.int64)
    top = np.full(tuple(shape), -np.inf)
    first = np.floor((triangles[..., :2].min(axis=1) - low) / cell).astype(np.int64)
    last = np.floor((triangles[..., :2].max(axis=1) - low) / cell).astype(np.int64)
    for (i, j), (k, m), z in zip(first, last, triangles[..., 2].max(axis=1), strict=True):
        part = top[i : k + 1, j : m + 1]
        np.maximum(part, z, out=part)
    return low, cell, grey_dilation(top, size=(3, 3), mode="nearest")
