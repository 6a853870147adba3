"""Where each triangle of a surface lies in a picture: two to a square cell, near ones beside each other.

Cells are powers of two and lie along a Z curve, largest first, so that they fill the picture without gaps. Triangles of
one size are sorted along such a curve in space: the coarse versions of a texture that a renderer makes for far views
mix texels of different cells, and these have like colors then.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.range_checks import check_all_positive
from symbrion_gym._src.errors import ArenaError

_BLOCK = 8
"""Edge of the smallest cell, of which all others are made [texel]."""
_RIM = 4
"""Texels of a cell's edge that are no part of a triangle's leg: filters read across its sides."""
_GROWTH = 1.19
"""Texels grow by this until all cells fit: their number halves in two steps."""
_MOST_TEXELS = 200_000
"""Texels that are worked on at once: bounds the memory to some 100 MB."""
_BITS = 10
"""Of each coordinate in the order of triangles in space."""


@dataclass(frozen=True)
class AtlasConfig:
    """How fine the texture of a surface is.

    Attributes:
        texel: edge of a texel on the surface [m]; 0: the distance between colored points.
        max_size: edge of the picture [texel], a power of two; texels grow until all triangles fit.
        max_cell: edge of the cell of the largest triangles [texel], a power of two.
    """

    texel: float = 0.0
    max_size: int = 2048
    max_cell: int = 512

    def __post_init__(self) -> None:
        check_all_positive(self, may_be_zero=("texel",))
        for name in ("max_size", "max_cell"):
            value = getattr(self, name)
            if value < _BLOCK or value & (value - 1):
                raise ArenaError(f"AtlasConfig: {name} must be a power of two from {_BLOCK} on, got {value}")


class Cells(NamedTuple):
    """Cells of one size, each with two triangles.

    Attributes:
        size: edge [texel].
        corner: column and row of the upper left texel.
        faces: triangle in the upper left and in the lower right half; -1 for none.
    """

    size: int
    corner: Int[np.ndarray, "C 2"]
    faces: Int[np.ndarray, "C 2"]


class Atlas(NamedTuple):
    """A layout of triangles.

    Attributes:
        width: of the picture [texel].
        height: of the picture [texel].
        order: for each face its corners, that of the right angle in the cell first.
        cells: by size, largest first.
    """

    width: int
    height: int
    order: Int[np.ndarray, "F 3"]
    cells: list[Cells]

    def find_uv(self) -> Float[np.ndarray, "F 3 2"]:
        """Return column and row of the corners of every face, from 0 at the left and at the bottom to 1."""
        uv = np.zeros((len(self.order), 3, 2))
        for cells in self.cells:
            for half, places in enumerate(_find_corners(cells.size)):
                chosen = cells.faces[:, half]
                rows = np.flatnonzero(chosen >= 0)
                at = cells.corner[rows, None] + places
                at = np.stack([at[..., 0] / self.width, 1.0 - at[..., 1] / self.height], axis=-1)
                uv[chosen[rows, None], self.order[chosen[rows]]] = at
        return uv


def make_atlas(triangles: Float[np.ndarray, "F 3 3"], texel: float, config: AtlasConfig) -> Atlas:
    """Lay out triangles, in cells so large that texels are no larger than wanted, where the picture has room for it."""
    lengths = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)  # edge k: from corner k on
    first = (lengths.argmax(axis=1) + 2) % 3  # opposite to the longest edge
    order = (first[:, None] + np.arange(3)) % 3
    legs = np.sort(lengths, axis=1)[:, 1]
    rank = np.argsort(_find_codes(triangles.mean(axis=1)), kind="stable")
    sizes = _choose_sizes(legs, texel, config)
    while _count_blocks(sizes) * _BLOCK**2 > config.max_size**2 and (sizes > _BLOCK).any():
        texel *= _GROWTH
        sizes = _choose_sizes(legs, texel, config)
    side = _BLOCK
    while side**2 < _count_blocks(sizes) * _BLOCK**2:
        side *= 2
    is_half = 2 * _count_blocks(sizes) * _BLOCK**2 <= side**2
    cells, used = [], 0
    for size in sorted(set(sizes.tolist()), reverse=True):
        faces = rank[sizes[rank] == size]
        pairs = np.append(faces, np.full(len(faces) % 2, -1)).reshape(-1, 2)
        step = (size // _BLOCK) ** 2
        cells.append(Cells(size, _BLOCK * _decode(used + step * np.arange(len(pairs))), pairs))
        used += step * len(pairs)
    return Atlas(side, side // 2 if is_half and side > _BLOCK else side, order, cells)


def iterate_texels(
    atlas: Atlas, triangles: Float[np.ndarray, "F 3 3"]
) -> Iterator[tuple[Int[np.ndarray, "T 2"], Int[np.ndarray, " T"], Float[np.ndarray, "T 3"]]]:
    """Yield columns and rows of texels, their faces, and the places that they show [m].

    Texels beside a triangle show its plane, so that filters find the color of what goes on there.
    """
    for cells in atlas.cells:
        grid = np.stack(np.meshgrid(np.arange(cells.size), np.arange(cells.size)), axis=-1).reshape(-1, 2)
        is_lower = grid.sum(axis=1) >= cells.size
        weights = _find_weights(cells.size, grid[:, 0] + 0.5, grid[:, 1] + 0.5, is_lower)
        most = max(1, _MOST_TEXELS // len(grid))
        for start in range(0, len(cells.faces), most):
            pairs = cells.faces[start : start + most]
            second = np.where(pairs[:, 1] < 0, pairs[:, 0], pairs[:, 1])  # an empty half is never shown
            faces = np.where(is_lower, second[:, None], pairs[:, :1])
            corners = np.take_along_axis(triangles, atlas.order[..., None], axis=1)[faces]
            places = np.einsum("tk,ctki->cti", weights, corners)
            at = cells.corner[start : start + most, None] + grid
            yield at.reshape(-1, 2), faces.ravel(), places.reshape(-1, 3)


def _choose_sizes(legs: Float[np.ndarray, " F"], texel: float, config: AtlasConfig) -> Int[np.ndarray, " F"]:
    wanted = np.maximum(legs / texel + _RIM, _BLOCK)
    return np.minimum(2 ** np.ceil(np.log2(wanted)).astype(np.int64), min(config.max_cell, config.max_size))


def _count_blocks(sizes: Int[np.ndarray, " F"]) -> int:
    different, counts = np.unique(sizes, return_counts=True)
    return int((((different // _BLOCK) ** 2) * -(-counts // 2)).sum())


def _find_corners(size: int) -> Int[np.ndarray, "2 3 2"]:
    """Return column and row of the corners of both triangles in a cell; the right angle first."""
    far, near = size - _RIM + 1, _RIM - 1
    return np.array(
        [[(1, 1), (far, 1), (1, far)], [(size - 1, size - 1), (near, size - 1), (size - 1, near)]]
    )


def _find_weights(size: int, x: np.ndarray, y: np.ndarray, is_lower: np.ndarray) -> np.ndarray:
    """Return the barycentric coordinates of places in a cell, in the upper left or the lower right triangle."""
    legs = size - _RIM
    second = np.where(is_lower, size - 1 - x, x - 1) / legs
    third = np.where(is_lower, size - 1 - y, y - 1) / legs
    return np.stack([1.0 - second - third, second, third], axis=-1)


def _decode(codes: Int[np.ndarray, " C"]) -> Int[np.ndarray, "C 2"]:
    """Return column and row on the Z curve."""
    place = np.zeros((len(codes), 2), dtype=np.int64)
    for bit in range(16):
        place[:, 0] |= ((codes >> (2 * bit)) & 1) << bit
        place[:, 1] |= ((codes >> (2 * bit + 1)) & 1) << bit
    return place


def _find_codes(places: Float[np.ndarray, "F 3"]) -> Int[np.ndarray, " F"]:
    """Return the place of points along a Z curve in space."""
    low, extent = places.min(axis=0), float(np.ptp(places, axis=0).max())
    steps = ((places - low) / max(extent, np.finfo(float).tiny) * (2**_BITS - 1)).astype(np.int64)
    codes = np.zeros(len(places), dtype=np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            codes |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    return codes
