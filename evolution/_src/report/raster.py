"""Draw triangles into pixels with a depth buffer, without a display or OpenGL; equal input gives equal pixels."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

import symbrion_gym as sg
from reconstruction._src.geometry.rows import find_inside

if TYPE_CHECKING:
    from symbrion_gym._src.tasks.paths import Pair
    from symbrion_gym._src.traversability.routes import DrivingRoute

Picture = Float[np.ndarray, "H W 3"]  # Red, green and blue, 0 to 1
Triangles = Float[np.ndarray, "F 3 3"]  # Corners [m]
Mask = Bool[np.ndarray, "H W"]  # Of each pixel, whether something holds


LIGHT = np.array([0.35, -0.5, 0.79])
"""Direction to the light: from above, beside the camera, so that ramps and walls differ in brightness."""
_MOST_CELLS = 1_000_000  # Pixels that are tested at once: bounds the memory to some 100 MB
_FILLED, _MOST_HEIGHT = 0.97, 0.75
"""Share of the picture that is filled; largest height of a picture, relative to its width."""
_EDGE = 1e-9
"""Pixels this far outside of a triangle, relative to its size, belong to it: no gap between neighbors."""
_LEAST_AREA = 1e-9  # Triangles that cover less are seen from the side and not drawn [pixel²]


class View(NamedTuple):
    """A camera without perspective."""

    axes: Float[np.ndarray, "3 3"]  # rows: right, up, and towards the camera, as unit vectors
    center: Float[np.ndarray, " 3"]  # the point in the middle of the picture [m]
    scale: float  # pixels per meter
    width: int  # pixels
    height: int  # pixels

    def project(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
        """Return column, row [pixel] and height towards the camera [m] of points."""
        seen = (points - self.center) @ self.axes.T
        return seen * [self.scale, -self.scale, 1.0] + [self.width / 2, self.height / 2, 0.0]

    def find_points(
        self, columns: Int[np.ndarray, " P"], rows: Int[np.ndarray, " P"], heights: Float[np.ndarray, " P"]
    ) -> Float[np.ndarray, "P 3"]:
        """Return the points that the middles of pixels show, given their heights towards the camera [m]."""
        right = (columns + 0.5 - self.width / 2) / self.scale
        up = (self.height / 2 - rows - 0.5) / self.scale
        return self.center + np.stack([right, up, heights], axis=1) @ self.axes


class Pixels(NamedTuple):
    """What a picture shows."""

    face: Int[np.ndarray, "H W"]  # triangle in each pixel; -1 where there is none
    height: Float[np.ndarray, "H W"]  # its height towards the camera [m]; -inf where there is none


def make_view(points: Float[np.ndarray, "N 3"], elevation: float, azimuth: float, width: int) -> View:
    """Return a view in which points fill the picture, which is at most 3/4 as high as it is wide."""
    up, around = np.radians(elevation), np.radians(azimuth)
    right = np.array([-np.sin(around), np.cos(around), 0.0])
    towards = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    axes = np.stack([right, np.cross(towards, right), towards])
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = np.maximum(high - low, np.finfo(np.float32).tiny)
    scale = _FILLED * min(width / extent[0], _MOST_HEIGHT * width / extent[1])
    height = 2 * int(np.ceil(scale * extent[1] / _FILLED / 2))
    return View(axes, (low + high) / 2 @ axes, float(scale), width, max(height, 2))


def rasterize(triangles: Triangles, view: View, is_culled: bool = True) -> Pixels:
    """Return the nearest triangle in every pixel."""
    face = np.full(view.height * view.width, -1, dtype=np.int64)
    height = np.full(view.height * view.width, -np.inf)
    corners = view.project(triangles)
    ahead, behind = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    area = -(ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0])  # rows count downwards
    is_drawn = (area if is_culled else np.abs(area)) > _LEAST_AREA
    low = np.clip(np.ceil(corners[..., :2].min(axis=1) - 0.5), 0, [view.width, view.height])
    high = np.clip(np.floor(corners[..., :2].max(axis=1) - 0.5), -1, [view.width - 1, view.height - 1])
    size = (high - low).max(axis=1) + 1
    is_drawn &= (high >= low).all(axis=1)
    level = np.ceil(np.log2(np.maximum(size, 1))).astype(np.int64)
    for power in np.unique(level[is_drawn]):
        chosen = np.flatnonzero(is_drawn & (level == power))
        step = max(_MOST_CELLS // 4**power, 1)
        for start in range(0, len(chosen), step):
            part = chosen[start : start + step]
            _draw(corners[part], part, low[part].astype(np.int64), 2**power, view.width, face, height)
    shape = (view.height, view.width)
    return Pixels(face.reshape(shape), height.reshape(shape))


def find_outlines(labels: Int[np.ndarray, "H W"]) -> Mask:
    """Return the pixels whose right or lower neighbor has another label."""
    is_edge = np.zeros(labels.shape, dtype=bool)
    is_edge[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    is_edge[:-1] |= labels[:-1] != labels[1:]
    return is_edge


def _draw(
    corners: Float[np.ndarray, "T 3 3"],
    names: Int[np.ndarray, " T"],
    low: Int[np.ndarray, "T 2"],
    size: int,
    width: int,
    face: Int[np.ndarray, " P"],
    height: Float[np.ndarray, " P"],
) -> None:
    """Draw triangles of about one size into the buffers `face` and `height`."""
    steps = np.arange(size)
    columns, rows = low[:, 0, None, None] + steps, low[:, 1, None, None] + steps[:, None]
    x, y = columns + 0.5, rows + 0.5
    shares = _compute_shares(corners, x, y)
    is_inside = (shares >= -_EDGE).all(axis=0) & (columns < width) & (rows < len(face) // width)
    triangle, row, column = np.nonzero(is_inside)
    at = shares[:, triangle, row, column]
    level = (at * corners[triangle, :, 2].T).sum(axis=0)
    pixel = rows[triangle, row, 0] * width + columns[triangle, 0, column]
    order = np.lexsort((names[triangle], -level, pixel))
    pixel, level, triangle = pixel[order], level[order], triangle[order]
    is_first = np.concatenate([[True], pixel[1:] != pixel[:-1]]) if len(pixel) else np.zeros(0, dtype=bool)
    pixel, level, triangle = pixel[is_first], level[is_first], triangle[is_first]
    is_nearer = level > height[pixel]
    face[pixel[is_nearer]] = names[triangle[is_nearer]]
    height[pixel[is_nearer]] = level[is_nearer]


def _compute_shares(
    corners: Float[np.ndarray, "T 3 3"], x: Float[np.ndarray, "T _ _"], y: Float[np.ndarray, "T _ _"]
) -> Float[np.ndarray, "3 T S S"]:
    """Return barycentric coordinates of pixels."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, i, :2].T[:, :, None, None] for i in range(3))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    first = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
    second = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
    return np.stack([first, second, 1.0 - first - second])


OVERSAMPLING = 2  # Rows and columns of samples per pixel: edges become smooth
_AMBIENT = 0.68  # Brightness of what faces away from the light; the rest depends on the angle
_OUTLINE = 0.55  # Brightness of outlines


def shade_pixels(pixels: Pixels, triangles: Triangles, colors: Picture | Float[np.ndarray, " 3"]) -> Picture:
    """Return the picture of triangles in the light, on white."""
    if not len(triangles):
        return np.ones((*pixels.face.shape, 3))
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), np.finfo(float).tiny)
    light = np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    brightness = (_AMBIENT + (1.0 - _AMBIENT) * light)[pixels.face]
    return np.where((pixels.face >= 0)[..., None], brightness[..., None] * colors, 1.0)


def draw_outlines(picture: Picture, labels: np.ndarray, is_shown: Mask | None = None) -> Picture:
    """Return a picture with darker pixels where the label changes."""
    is_edge = find_outlines(labels)
    if is_shown is not None:
        is_edge &= is_shown
    return np.where(is_edge[..., None], _OUTLINE * picture, picture)


def blend(below: Picture, above: Picture, is_shown: Mask, opacity: float) -> Picture:
    """Return a picture with another one over it, where that is shown; `opacity` from 0 to 1."""
    mixed = (1.0 - opacity) * below + opacity * above
    return np.where(is_shown[..., None], mixed, below)


def reduce_samples(picture: Picture) -> Float[np.ndarray, "h w 3"]:
    """Return the mean of the samples of each pixel."""
    rows, columns = (size // OVERSAMPLING for size in picture.shape[:2])
    return picture.reshape(rows, OVERSAMPLING, columns, OVERSAMPLING, 3).mean(axis=(1, 3))


_TAIL = 2.5  # The scene is what lies between this percentile and its opposite along each axis [%] ..
_BEYOND = 0.5
"""... and this share of it beyond: even ground keeps its rims, and flaps of a few far points are cut off."""
_SMALL = 0.3  # A route that extends over less than this share of the scene is framed itself ..
_AROUND = 1.0
"""... with as much ground around it, relative to its extent, on each side, and at least `_LEAST_AROUND`."""
_LEAST_AROUND = 1.0  # [m]


def find_frame(
    arena: sg.Arena, route: "DrivingRoute | None" = None, way: "Pair | None" = None
) -> Float[np.ndarray, "N 3"]:
    """Return the points that a picture of an arena shows: vertices of its surface, and the route."""
    vertices = np.asarray(arena.surface.vertices, dtype=np.float64)
    low, high = np.percentile(vertices, [_TAIL, 100.0 - _TAIL], axis=0)
    reach = _BEYOND * np.maximum(high - low, 0.2 * (high - low).max())
    low, high = low - reach, high + reach
    if route is None and way is None:
        return _crop(vertices, low, high)
    shown = np.empty((0, 3)) if route is None else np.concatenate([route.path, [route.goal]])
    if way is not None:
        height = np.median(vertices if route is None else shown, axis=0)[2]
        shown = np.concatenate([shown, np.column_stack([np.array(way), np.full(2, height)])])
    begin, end = shown.min(axis=0), shown.max(axis=0)
    extent = float((end - begin)[:2].max())
    if extent < _SMALL * float((high - low)[:2].max()):
        around = max(_AROUND * extent, _LEAST_AROUND)
        low, high = np.maximum(low, begin - around), np.minimum(high, end + around)
        (x0, x1), (y0, y1) = np.clip([low, high], vertices.min(axis=0), vertices.max(axis=0))[:, :2].T
        corners = [
            (x, y, begin[2]) for x in (x0, x1) for y in (y0, y1)
        ]  # of large triangles no vertex is near
        return np.concatenate([vertices[find_inside(vertices, low, high)], shown, corners])
    return np.concatenate([_crop(vertices, low, high), shown])


def _crop(
    points: Float[np.ndarray, "N 3"], low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "M 3"]:
    """Return the points in a box; all where there are too few in it to show."""
    inside = find_inside(points, low, high)
    return points[inside] if len(inside) >= 3 else points
