"""Heights of the ground on a device: the exact surface of an arena along vertical lines, many at once."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.tasks.scene import Scene

_EDGE_TOLERANCE = 1e-5
"""How far outside a triangle (barycentric) a point still counts as inside, in single precision."""


class DeviceGround:
    """The surface of a scene as tables on a device: what `Scene.find_ground` finds, in single precision.

    Args:
        scene: arena and way.
    """

    def __init__(self, scene: Scene) -> None:
        grid = scene.arena.elevation.export_grid()
        self._has_storeys = scene.route.start_height is not None
        self._origin, self._cell = np.asarray(grid.origin, dtype=np.float32), float(grid.cell)
        self._shape = grid.shape
        self._most = int(np.diff(grid.starts).max(initial=0))
        self._starts = np.asarray(grid.starts, dtype=np.int32)
        # One triangle more, so that a cell without one has something to look up.
        self._triangles = np.append(grid.triangles, 0).astype(np.int32)
        self._table = np.asarray(grid.table if len(grid.table) else np.ones((1, 10)), dtype=np.float32)

    def find_ground(
        self, x: Float[jax.Array, " P"], y: Float[jax.Array, " P"], z: Float[jax.Array, " P"]
    ) -> Float[jax.Array, " P"]:
        """Return the height of the ground, NaN where there is none [m]; see `Scene.find_ground`."""
        starts, triangles, table = map(jnp.asarray, (self._starts, self._triangles, self._table))
        row = self._find_cell(x - self._origin[0], self._shape[0])
        column = self._find_cell(y - self._origin[1], self._shape[1])
        cell = row * self._shape[1] + column
        first, last = starts[cell], starts[cell + 1]

        def look(slot: jax.Array, highest: jax.Array) -> jax.Array:
            number = first + slot
            entry = table[triangles[jnp.minimum(number, len(self._triangles) - 1)]]
            height = _find_height_in(entry, x, y)
            is_seen = (number < last) & (height <= z) if self._has_storeys else number < last
            return jnp.maximum(highest, jnp.where(is_seen, height, -jnp.inf))

        height = jax.lax.fori_loop(0, self._most, look, jnp.full(x.shape, -jnp.inf, dtype=x.dtype))
        return jnp.where(jnp.isneginf(height), jnp.nan, height)

    def _find_cell(self, offset: Float[jax.Array, " P"], count: int) -> jax.Array:
        """Return the cells along an axis; those of places that are not finite are the first."""
        number = jnp.where(jnp.isfinite(offset), jnp.floor(offset / self._cell), 0.0)
        return jnp.clip(number, 0, count - 1).astype(jnp.int32)


def _find_height_in(
    entry: Float[jax.Array, "P 10"], x: Float[jax.Array, " P"], y: Float[jax.Array, " P"]
) -> Float[jax.Array, " P"]:
    """Return the height of each triangle at its point, -inf outside of it (barycentric coordinates)."""
    corner_x, corner_y, z, b_x, b_y, c_x, c_y, b_z, c_z, area = entry.T
    to_x, to_y = x - corner_x, y - corner_y
    weight_b = (to_x * c_y - to_y * c_x) / area
    weight_c = (b_x * to_y - b_y * to_x) / area
    weight_a = 1.0 - weight_b - weight_c
    is_inside = jnp.minimum(jnp.minimum(weight_a, weight_b), weight_c) >= -_EDGE_TOLERANCE
    return jnp.where(is_inside, weight_a * z + weight_b * b_z + weight_c * c_z, -jnp.inf)
