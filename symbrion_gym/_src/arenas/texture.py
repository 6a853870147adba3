"""The colors of an arena's surface, and a picture of them: MuJoCo draws no colors of vertices."""

import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int, UInt8
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces.color import WHITE, ColorSource, Paint, add_alpha
from symbrion_gym._src.arenas.course import PATTERNS, Course, StairsCourse
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.errors import ArenaError

_BLOCK = 8  # Edge of the smallest cell, of which all others are made [texel]
_RIM = 4  # Texels of a cell's edge that are no part of a triangle's leg: filters read across its sides
_GROWTH = 1.19  # Texels grow by this until all cells fit: their number halves in two steps
_MOST_TEXELS = 200_000  # Texels that are worked on at once: bounds the memory to some 100 MB
_BITS = 10  # Of each coordinate in the order of triangles in space
_MAX_SIZE = 2048  # Edge of the picture [texel], a power of two; texels grow until all triangles fit
_MAX_CELL = 512  # Edge of the cell of the largest triangles [texel], a power of two


class Atlas(NamedTuple):
    """A layout of triangles, two of a size in each square cell."""

    width: int  # of the picture [texel]
    height: int  # of the picture [texel]
    order: Int[np.ndarray, "F 3"]  # for each face its corners, that of the right angle in the cell first
    size: Int[np.ndarray, " F"]  # edge of its cell [texel]
    corner: Int[np.ndarray, "F 2"]  # column and row of the upper left texel of its cell
    is_lower: Bool[np.ndarray, " F"]  # whether it fills the lower right half, turned by 180 degrees

    def compute_uv(self) -> Float[np.ndarray, "F 3 2"]:
        """Return column and row of the corners of every face, from 0 at the left and at the bottom to 1."""
        size = self.size[:, None, None]
        place = 1 + (size - _RIM) * np.array([[0, 0], [1, 0], [0, 1]])
        at = self.corner[:, None] + np.where(self.is_lower[:, None, None], size - place, place)
        at = np.stack([at[..., 0] / self.width, 1.0 - at[..., 1] / self.height], axis=-1)
        uv = np.zeros_like(at)
        np.put_along_axis(uv, self.order[..., None], at, axis=1)
        return uv


def make_atlas(triangles: Float[np.ndarray, "F 3 3"], texel: float) -> Atlas:
    """Lay out triangles, in cells so large that texels are no larger than wanted, where the picture has room for it.

    Cells lie along a Z curve in the order of their triangles along one in space, so that neighbors stay together.
    """
    lengths = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)  # edge k: from corner k on
    first = (lengths.argmax(axis=1) + 2) % 3  # opposite to the longest edge
    order = (first[:, None] + np.arange(3)) % 3
    legs = np.sort(lengths, axis=1)[:, 1]
    rank = np.argsort(_compute_codes(triangles.mean(axis=1)), kind="stable")
    sizes = _choose_sizes(legs, texel)
    while _count_blocks(sizes) * _BLOCK**2 > _MAX_SIZE**2 and (sizes > _BLOCK).any():
        texel *= _GROWTH
        sizes = _choose_sizes(legs, texel)
    corner, is_lower, used = np.zeros((len(sizes), 2), int), np.zeros(len(sizes), bool), 0
    for size in np.unique(sizes)[::-1]:
        faces, step = rank[sizes[rank] == size], (size // _BLOCK) ** 2
        cell, is_lower[faces] = np.divmod(np.arange(len(faces)), 2)
        corner[faces] = _BLOCK * _decode(used + step * cell)
        used += step * (cell[-1] + 1)
    side = _BLOCK
    while side**2 < used * _BLOCK**2:
        side *= 2
    is_half = 2 * used * _BLOCK**2 <= side**2 and side > _BLOCK
    return Atlas(side, side // 2 if is_half else side, order, sizes, corner, is_lower)


def iterate_texels(
    atlas: Atlas, triangles: Float[np.ndarray, "F 3 3"]
) -> Iterator[tuple[Int[np.ndarray, "T 2"], Int[np.ndarray, " T"], Float[np.ndarray, "T 3"]]]:
    """Yield columns and rows of texels, their faces, and the places that they show [m].

    Texels beside a triangle show its plane, so that filters find the color of what goes on there.
    """
    for size in np.unique(atlas.size):
        grid = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1).reshape(-1, 2)
        second, third = (grid.T - 0.5) / (size - _RIM)
        weights = np.stack([1.0 - second - third, second, third], axis=-1)
        every, most = np.flatnonzero(atlas.size == size), max(1, _MOST_TEXELS // len(grid))
        for faces in np.split(every, np.arange(most, len(every), most)):
            turned = atlas.is_lower[faces, None]
            is_own = grid.sum(axis=1) < size - turned  # the upper half has the diagonal
            corners = np.take_along_axis(triangles[faces], atlas.order[faces, :, None], axis=1)
            places = np.einsum("tk,fki->fti", weights, corners)
            at = atlas.corner[faces, None] + np.where(turned[..., None], size - 1 - grid, grid)
            yield at[is_own], np.repeat(faces, is_own.sum(axis=1)), places[is_own]


def _choose_sizes(legs: Float[np.ndarray, " F"], texel: float) -> Int[np.ndarray, " F"]:
    wanted = np.maximum(legs / texel + _RIM, _BLOCK)
    return np.minimum(2 ** np.ceil(np.log2(wanted)).astype(np.int64), min(_MAX_CELL, _MAX_SIZE))


def _count_blocks(sizes: Int[np.ndarray, " F"]) -> int:
    different, counts = np.unique(sizes, return_counts=True)
    return int((((different // _BLOCK) ** 2) * -(-counts // 2)).sum())


def _decode(codes: Int[np.ndarray, " C"]) -> Int[np.ndarray, "C 2"]:
    """Return column and row on the Z curve."""
    places = [sum(((codes >> (2 * bit + axis)) & 1) << bit for bit in range(16)) for axis in range(2)]
    return np.stack(places, axis=1)


def _compute_codes(places: Float[np.ndarray, "F 3"]) -> Int[np.ndarray, " F"]:
    """Return the place of points along a Z curve in space."""
    low, extent = places.min(axis=0), float(np.ptp(places, axis=0).max())
    steps = ((places - low) / max(extent, np.finfo(float).tiny) * (2**_BITS - 1)).astype(np.int64)
    bits = [((steps[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(_BITS) for axis in range(3)]
    return np.sum(bits, axis=0)


TEXTURE_FILE = "surface.png"
_PROBES = 500  # Colored points whose distances from the next ones give the distance of all: their median
_SPACING_NEIGHBOR = 4  # That neighbor is a spacing away: nearer ones may be of the same scan line


class SurfaceTexture(NamedTuple):
    """A picture of a surface's colors, and where each triangle lies in it."""

    image: UInt8[np.ndarray, "H W 3"]  # red, green and blue; the first row is the upper one
    # column and row of the corners of every face, from 0 at the left and at the bottom to 1
    uv: Float[np.ndarray, "F 3 2"]

    def find_colors(
        self, mesh: trimesh.Trimesh, face: Int[np.ndarray, " N"], places: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, "N 3"]:
        """Return the colors (0 to 1) of places on faces of its mesh [m], between texels as a renderer takes them."""
        weights = trimesh.triangles.points_to_barycentric(np.asarray(mesh.triangles)[face], places)
        weights = np.clip(np.nan_to_num(weights, nan=1 / 3), 0.0, 1.0)
        weights /= weights.sum(axis=1, keepdims=True)
        height, width = self.image.shape[:2]
        u, v = np.einsum("nk,nki->in", weights, self.uv[face])
        at = np.stack([(1.0 - v) * height - 0.5, u * width - 0.5])
        channels = [map_coordinates(self.image[..., k], at, float, order=1, mode="nearest") for k in range(3)]
        return np.stack(channels, axis=1) / WHITE


def make_texture(mesh: trimesh.Trimesh, cloud: Cloud) -> SurfaceTexture:
    """Return a texture of a mesh in which each texel has the color of the points around it."""
    source, normals = ColorSource(cloud), np.asarray(mesh.face_normals)

    def find_colors(places: Float[np.ndarray, "N 3"], face: Int[np.ndarray, " N"]) -> np.ndarray:
        return source.find_colors(places, normals[face])

    return _fill(mesh, _compute_spacing(cloud), np.asarray(cloud.colors).mean(axis=0), find_colors)


def paint_texture(mesh: trimesh.Trimesh, paint: Paint, texel: float = 0.01) -> SurfaceTexture:
    """Return a texture of a mesh whose colors are known everywhere."""

    def find_colors(places: Float[np.ndarray, "N 3"], face: Int[np.ndarray, " N"]) -> np.ndarray:
        return np.round(WHITE * np.clip(np.asarray(paint(places), dtype=np.float64), 0.0, 1.0))

    return _fill(mesh, texel, WHITE * np.asarray(paint(np.asarray(mesh.vertices))).mean(axis=0), find_colors)


def _fill(
    mesh: trimesh.Trimesh,
    texel: float,
    background: Float[np.ndarray, " 3"],
    find_colors: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> SurfaceTexture:
    """Return a texture with the colors of places on faces; coarse versions of it mix in the background."""
    triangles = np.asarray(mesh.triangles, dtype=np.float64)
    atlas = make_atlas(triangles, texel)
    image = np.tile(np.round(background).astype(np.uint8), (atlas.height, atlas.width, 1))
    for at, face, places in iterate_texels(atlas, triangles):
        image[at[:, 1], at[:, 0]] = find_colors(places, face)
    return SurfaceTexture(image, atlas.compute_uv())


def check_texture(texture: SurfaceTexture, mesh: trimesh.Trimesh, what: object) -> None:
    """Refuse a texture that does not belong to a surface."""
    image, uv = texture
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        raise ArenaError(f"{what}: the texture must be bytes [H, W, 3], not {image.dtype} of {image.shape}")
    if uv.shape != (len(mesh.faces), 3, 2) or not ((uv >= 0) & (uv <= 1)).all():
        raise ArenaError(f"{what}: {len(mesh.faces)} faces need places [F, 3, 2] in the texture, each 0 to 1")


def _compute_spacing(cloud: Cloud) -> float:
    """Return the distance between neighboring colored points [m]."""
    tree = cKDTree(cloud.points, balanced_tree=False, compact_nodes=False)
    probes = cloud.points[:: max(1, cloud.num_points // _PROBES)]
    count = min(_SPACING_NEIGHBOR + 1, cloud.num_points)
    return max(float(np.median(tree.query(probes, k=[count])[0])), 1e-4)


def paint_course(surface: trimesh.Trimesh, pattern: str) -> SurfaceTexture:
    """Give the vertices of an exact surface the colors of a pattern, and return its texture."""
    paint = PATTERNS[pattern]
    colors = np.round(WHITE * paint(np.asarray(surface.vertices))).astype(np.uint8)
    surface.visual = trimesh.visual.ColorVisuals(surface, vertex_colors=add_alpha(colors))
    return paint_texture(surface, paint)


def find_surface_colors(
    surface: trimesh.Trimesh,
    texture: SurfaceTexture | None,
    course: Course | StairsCourse | None,
    positions: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 3"]:
    """Return the colors (0 to 1) of the places of a surface that are nearest to positions."""
    if course is not None and course.color_pattern:
        return PATTERNS[course.color_pattern](positions)
    if texture is None:
        raise ArenaError(
            "the arena has no colors; make it of a colored scan or mesh, or of a Course with a color_pattern"
        )
    _, face, nearest = find_nearest(positions, np.asarray(surface.vertices), np.asarray(surface.faces))
    return texture.find_colors(surface, face, nearest)


LIT_COLOR = (0.8, 0.8, 0.8, 1.0)
"""Factor on the texture: level ground gets 1.2 times its light from an arena's lamps and the viewer's headlight."""


def add_texture(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, texture: SurfaceTexture, use_files: bool = False
) -> None:
    """Give a mesh geom a texture by a material of the name of the geom; without gloss, as a scan shows none."""
    name, image = geom.name, texture.image
    picture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3)
    if use_files:
        picture.file = TEXTURE_FILE
    else:
        picture.height, picture.width = image.shape[:2]
        picture.data = image.tobytes()
        mesh = spec.mesh(geom.meshname)
        mesh.usertexcoord = (np.array([0.0, 1.0]) + np.array([1.0, -1.0]) * texture.uv).ravel()
        mesh.userfacetexcoord = np.arange(texture.uv.size // 2, dtype=np.int32)
    material = spec.add_material(name=name, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    geom.material, geom.rgba = name, LIT_COLOR


_MOST = 8192  # Largest edge of a picture that is read [pixel]
_HEADER = struct.Struct(">II5B")
"""Of a PNG: width, height, bits, kind of color, compression, filter, interlacing."""
_HEADER_AT = 16  # Where it stands
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_LEVEL = 6  # Of the compression


def to_png(image: UInt8[np.ndarray, "H W 3"]) -> bytes:
    """Return a picture as the bytes of a PNG."""
    height, width = image.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)
    parts = [
        (b"IHDR", _HEADER.pack(width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows.tobytes(), _LEVEL)),
    ]
    return _SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in [*parts, (b"IEND", b"")]
    )


def load_png(path: Path) -> UInt8[np.ndarray, "H W 3"]:
    """Read a picture, by MuJoCo's reader."""
    try:
        content = path.read_bytes()
        width, height, *_ = _HEADER.unpack_from(content, _HEADER_AT)
        if not content.startswith(_SIGNATURE) or not (0 < width <= _MOST and 0 < height <= _MOST):
            raise ValueError(f"no PNG of up to {_MOST} x {_MOST} pixels")
        spec = mujoco.MjSpec()
        spec.add_texture(name="t", type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3, file="t.png")
        spec.assets = {"t.png": content}
        model = spec.compile()
        return np.array(model.tex_data, dtype=np.uint8).reshape(height, width, 3)
    except (OSError, ValueError, struct.error) as error:
        raise ArenaError(f"{path}: not a picture ({error}); build the arena again with make_arena") from error
