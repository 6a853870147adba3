"""Friction patches in the picture of an arena: the more slippery, the bluer."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.patches import Patch

import symbrion_gym as sg
from evolution._src.report.raster import Pixels, View
from evolution._src.report.shading import blend

SLIPPERY, ROUGH = (0.20, 0.50, 0.95), (0.75, 0.40, 0.15)
"""Colors of patches with less and with more friction than the rest of the ground."""
_FULL = 0.5
"""Difference of the friction that is drawn in the full color."""
_OPACITY = (0.25, 0.8)
"""Of the smallest and of the largest difference."""


def add_friction(
    picture: Float[np.ndarray, "H W 3"], surface: Pixels, view: View, arena: sg.Arena
) -> Float[np.ndarray, "H W 3"]:
    """Return the picture with friction patches tinted."""
    found = arena.friction_map
    if found is None or not found.patches:
        return picture
    rows, columns = np.nonzero(np.isfinite(surface.height) & (surface.face >= 0))
    numbers = found.find_patches(view.find_points(columns, rows, surface.height[rows, columns]))
    for number, patch in enumerate(found.patches):
        is_own = np.zeros(surface.face.shape, dtype=bool)
        is_own[rows[numbers == number], columns[numbers == number]] = True
        color, opacity = _find_look(patch.friction, arena.friction)
        picture = blend(picture, np.broadcast_to(np.array(color), picture.shape), is_own, opacity)
    return picture


def make_friction_legend(arena: sg.Arena) -> list[Patch]:
    """Return an entry for each patch."""
    if arena.friction_map is None:
        return []
    entries = []
    for patch in arena.friction_map.patches:
        color, opacity = _find_look(patch.friction, arena.friction)
        interval = f" ± {patch.half_width:.2f}" if patch.half_width else ""
        entries.append(Patch(color=color, alpha=opacity, label=f"friction {patch.friction:.2f}{interval}"))
    return entries


def _find_look(friction: float, usual: float) -> tuple[tuple[float, float, float], float]:
    share = min(abs(friction - usual) / _FULL, 1.0)
    return (SLIPPERY if friction < usual else ROUGH), _OPACITY[0] + share * (_OPACITY[1] - _OPACITY[0])
