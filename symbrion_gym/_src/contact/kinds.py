"""The kinds of contact geometry, one option: convex pieces, a height field, exact prisms, boxes and pieces.

| kind | what it is | for |
|---|---|---|
| `auto` | `convex`, or a height field where rough open ground needs many pieces | everything; the default |
| `convex` | slabs under the planes of a terrain, convex patches of any surface, coacd of solids | pieces always |
| `mixed` | the paper's mixed model: boxes, spheres, cylinders, rectangles, for rays too; the rest is `convex` | rays |
| `hfield` | MuJoCo's height field | rough, unbroken ground |
| `prisms` | one prism a triangle: exact, slow, with all the noise | reference |
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

CONTACT_KINDS = ("convex", "hfield", "prisms", "mixed")  # What an arena can be made of
CONTACT_CHOICES = ("auto", *CONTACT_KINDS)  # What can be asked for

_INSIDE = 1e-6  # The grid of a height field begins this far inside the rim [m], so that the rim itself is hit


LEAST_DENSITY = 50.0  # Pieces over the area in plan, from which on a height field is looked for [1/m²]
KNOWN = 0.98
"""Share of the grid within its rim that lies on the ground, at least: elsewhere a height field invents
ground."""
SHARE = 0.3
"""The mean distance is at most this share of the accuracy, the 95th percentile this share of what is good
enough: a beam that grazes the ground feels a few millimeters."""
COARSEST = 0.06  # Spacing of the grid that is tried first [m]: half a Scout
FINEST = 0.02  # Finer grids are not tried [m]
SHRINK = 0.8  # Factor between the spacings that are tried


class HeightField(NamedTuple):
    """Heights on a grid."""

    heights: Float[np.ndarray, "R C"]  # rows along y, columns along x; no NaN: beyond the rim, the lowest [m]
    low: Float[np.ndarray, " 2"]  # (x, y) of the first row and column [m]
    high: Float[np.ndarray, " 2"]  # (x, y) of the last [m]

    def as_mesh(self) -> trimesh.Trimesh:
        """Return the surface as MuJoCo splits it: two triangles a cell."""
        rows, columns = self.heights.shape
        x, y = (np.linspace(self.low[i], self.high[i], n) for i, n in ((0, columns), (1, rows)))
        vertices = np.stack([*np.meshgrid(x, y), self.heights], axis=-1).reshape(-1, 3)
        corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
        first = np.stack([corner, corner + 1, corner + columns], axis=1)
        second = np.stack([corner + 1, corner + columns + 1, corner + columns], axis=1)
        return trimesh.Trimesh(vertices, np.concatenate([first, second]), process=False)


def make_height_field(
    mesh: trimesh.Trimesh, ground: Elevation, spacing: float = 0.02, max_cells: int = 400_000
) -> HeightField:
    """Sample a terrain on a grid."""
    low, high = mesh.bounds[:, :2]
    spacing = max(spacing, float(np.sqrt(np.prod(high - low) / max_cells)))
    columns, rows = (max(int(np.ceil(extent / spacing)) + 1, 2) for extent in high - low)
    low, high = low + _INSIDE, high - _INSIDE
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    heights = ground.height(x, y)
    if np.isnan(heights).all():
        raise ArenaError("a height field needs ground that is seen from above")
    return HeightField(np.where(np.isnan(heights), np.nanmin(heights), heights), low, high)


@dataclass(frozen=True)
class Contact:
    """Contact geometry of a surface."""

    pieces: list[trimesh.Trimesh]  # convex solids
    quality: ArenaQuality  # distances from the surface
    height_field: HeightField | None = None  # in place of pieces, for the kind "hfield"
    notes: dict[str, Any] = field(default_factory=dict)  # how it came about, for JSON
