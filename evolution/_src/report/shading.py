"""Pictures of triangles as pixels: light, outlines, translucent layers over each other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from evolution._src.report.figures import LIGHT
from evolution._src.report.raster import Pixels, find_outlines

OVERSAMPLING = 2
"""Rows and columns of samples per pixel: edges become smooth."""
_AMBIENT = 0.68
"""Brightness of what faces away from the light; the rest depends on the angle."""
_OUTLINE = 0.55
"""Brightness of outlines."""


def shade_pixels(
    pixels: Pixels,
    triangles: Float[np.ndarray, "F 3 3"],
    colors: Float[np.ndarray, "H W 3"] | Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "H W 3"]:
    """Return the picture of triangles in the light, on white."""
    if not len(triangles):
        return np.ones((*pixels.face.shape, 3))
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), np.finfo(float).tiny)
    light = np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    brightness = (_AMBIENT + (1.0 - _AMBIENT) * light)[pixels.face]
    return np.where((pixels.face >= 0)[..., None], brightness[..., None] * colors, 1.0)


def draw_outlines(
    picture: Float[np.ndarray, "H W 3"], labels: np.ndarray, is_shown: Bool[np.ndarray, "H W"] | None = None
) -> Float[np.ndarray, "H W 3"]:
    """Return a picture with darker pixels where the label changes."""
    is_edge = find_outlines(labels)
    if is_shown is not None:
        is_edge &= is_shown
    return np.where(is_edge[..., None], _OUTLINE * picture, picture)


def blend(
    below: Float[np.ndarray, "H W 3"],
    above: Float[np.ndarray, "H W 3"],
    is_shown: Bool[np.ndarray, "H W"],
    opacity: float,
) -> Float[np.ndarray, "H W 3"]:
    """Return a picture with another one over it, where that is shown; `opacity` from 0 to 1."""
    mixed = (1.0 - opacity) * below + opacity * above
    return np.where(is_shown[..., None], mixed, below)


def reduce_samples(picture: Float[np.ndarray, "H W 3"]) -> Float[np.ndarray, "h w 3"]:
    """Return the mean of the samples of each pixel."""
    rows, columns = (size // OVERSAMPLING for size in picture.shape[:2])
    return picture.reshape(rows, OVERSAMPLING, columns, OVERSAMPLING, 3).mean(axis=(1, 3))
