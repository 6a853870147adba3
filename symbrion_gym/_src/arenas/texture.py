"""The colors of an arena's surface as a picture: MuJoCo draws no colors of vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8

from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces.color import ColorSource
from reconstruction._src.surfaces.color_error import Paint
from symbrion_gym._src.arenas.texture_atlas import Atlas, AtlasConfig, iterate_texels, make_atlas
from symbrion_gym._src.errors import ArenaError

TEXTURE_FILE = "surface.png"
_WHITE = 255
_PROBES = 500
"""Colored points whose distances from the next ones give the distance of all: their median."""
_SPACING_NEIGHBOR = 4
"""That neighbor is a spacing away: nearer ones may be of the same scan line."""


class SurfaceTexture(NamedTuple):
    """A picture of a surface's colors, and where each triangle lies in it.

    Attributes:
        image: red, green and blue; the first row is the upper one.
        uv: column and row of the corners of every face, from 0 at the left and at the bottom to 1.
    """

    image: UInt8[np.ndarray, "H W 3"]
    uv: Float[np.ndarray, "F 3 2"]

    def find_colors(
        self, face: Int[np.ndarray, " N"], weights: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, "N 3"]:
        """Return the colors (0 to 1) of places on faces, between texels as a renderer takes them."""
        height, width = self.image.shape[:2]
        uv = np.einsum("nk,nki->ni", weights, self.uv[face])
        column, row = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
        left, top = np.floor(column).astype(int), np.floor(row).astype(int)
        total = np.zeros((len(uv), 3))
        for down in (0, 1):
            for right in (0, 1):
                share = np.abs(1 - right - (column - left)) * np.abs(1 - down - (row - top))
                rows, columns = np.clip(top + down, 0, height - 1), np.clip(left + right, 0, width - 1)
                total += share[:, None] * self.image[rows, columns]
        return total / _WHITE


def make_texture(mesh: trimesh.Trimesh, cloud: Cloud, config: AtlasConfig | None = None) -> SurfaceTexture:
    """Return a texture of a mesh in which each texel has the color of the points around it."""
    config = config or AtlasConfig()
    texel = config.texel or _find_spacing(cloud)
    triangles = np.asarray(mesh.triangles, dtype=np.float64)
    atlas, source = make_atlas(triangles, texel, config), ColorSource(cloud)
    image = _make_blank(atlas, np.asarray(cloud.colors).mean(axis=0))
    normals = np.asarray(mesh.face_normals)
    for at, face, places in iterate_texels(atlas, triangles):
        image[at[:, 1], at[:, 0]] = source.find_colors(places, normals[face])
    return SurfaceTexture(image, atlas.find_uv())


def paint_texture(mesh: trimesh.Trimesh, paint: Paint, texel: float = 0.01) -> SurfaceTexture:
    """Return a texture of a mesh whose colors are known everywhere."""
    triangles = np.asarray(mesh.triangles, dtype=np.float64)
    atlas = make_atlas(triangles, texel, AtlasConfig())
    image = _make_blank(atlas, _WHITE * np.asarray(paint(np.asarray(mesh.vertices))).mean(axis=0))
    for at, _, places in iterate_texels(atlas, triangles):
        colors = np.clip(np.asarray(paint(places), dtype=np.float64), 0.0, 1.0)
        image[at[:, 1], at[:, 0]] = np.round(_WHITE * colors).astype(np.uint8)
    return SurfaceTexture(image, atlas.find_uv())


def _make_blank(atlas: Atlas, color: Float[np.ndarray, " 3"]) -> UInt8[np.ndarray, "H W 3"]:
    """Return a picture of one color: coarse versions of a texture mix in what no triangle covers."""
    return np.tile(np.round(color).astype(np.uint8), (atlas.height, atlas.width, 1))


def check_texture(texture: SurfaceTexture, mesh: trimesh.Trimesh, what: object) -> None:
    """Refuse a texture that does not belong to a surface."""
    image, uv = texture
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        raise ArenaError(f"{what}: the texture must be bytes [H, W, 3], not {image.dtype} of {image.shape}")
    if uv.shape != (len(mesh.faces), 3, 2):
        raise ArenaError(
            f"{what}: the texture has places of shape {uv.shape} for {len(mesh.faces)} faces, not [F, 3, 2]"
        )
    if not (np.isfinite(uv).all() and (uv >= 0).all() and (uv <= 1).all()):
        raise ArenaError(f"{what}: places in the texture must lie in 0 to 1; build the arena again")


def _find_spacing(cloud: Cloud) -> float:
    """Return the distance between neighboring colored points [m]."""
    from scipy.spatial import cKDTree

    tree = cKDTree(cloud.points, balanced_tree=False, compact_nodes=False)
    probes = cloud.points[:: max(1, cloud.num_points // _PROBES)]
    count = min(_SPACING_NEIGHBOR + 1, cloud.num_points)
    return max(float(np.median(tree.query(probes, k=[count])[0])), 1e-4)
