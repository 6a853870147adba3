"""The error map of an arena: surface and contact geometry, colored by how far they lie from each other."""

from collections.abc import Callable, Sequence

import matplotlib as mpl
import numpy as np
import trimesh
from jaxtyping import Float, Int
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import symbrion_gym as sg
from evolution._src.report.figures import DPI
from evolution._src.report.raster import (
    OVERSAMPLING,
    Picture,
    Pixels,
    Triangles,
    View,
    blend,
    draw_outlines,
    find_frame,
    make_view,
    rasterize,
    reduce_samples,
    shade_pixels,
)
from reconstruction._src.base.range_checks import format_count, format_distance
from symbrion_gym._src.contact.distances import compute_depths, compute_offsets, find_signed_nearest
from symbrion_gym._src.contact.quality import ArenaQuality, join_meshes

DIRECTIONS = ((35.0, -60.0), (35.0, 120.0))
"""Elevation and azimuth of the two cameras [degree]: opposite each other, so that every wall is seen."""
WIDTH = 620  # Width of each of the four pictures [pixel]
COLORS = "coolwarm"
"""Red: contact stands in front of the surface, a bump. Blue: it lies behind or is missing, a hole."""
LEAST_LIMIT = 0.001
"""The end of the color scale is never below 1 mm: smaller errors are of no interest to a robot."""


def draw_error_map(arena: sg.Arena, limit: float | None = None) -> Figure:
    """Draw where the contact geometry of an arena differs from its surface, from two sides.

    Faces seen from behind are left out, so that one looks into a room through its ceiling.
    """
    surface = np.asarray(arena.surface.triangles)
    front, labels = find_touchable(arena)
    contact = arena.pieces if arena.height_field is None else arena.height_field
    drawn, frame = [], find_frame(arena)
    for direction in DIRECTIONS:
        view = make_view(frame, *direction, OVERSAMPLING * WIDTH)
        drawn.append(
            _measure(surface, view, lambda points, normals: compute_offsets(points, normals, contact))
        )
        drawn.append(
            _measure(front, view, lambda points, _: find_signed_nearest(points, arena.surface).heights)
        )
    limit = limit or _find_limit([values for _, values in drawn])
    unit, factor = ("mm", 1000.0) if limit < 1.0 else ("m", 1.0)
    limit *= factor
    scale = ScalarMappable(Normalize(-limit, limit), mpl.colormaps[COLORS])
    images = []
    for index, (pixels, values) in enumerate(drawn):
        colors = scale.to_rgba(np.clip(factor * values, -limit, limit))[..., :3]
        image = shade_pixels(pixels, front if index % 2 else surface, colors)
        if index % 2:
            image = draw_outlines(image, np.append(labels, -1)[pixels.face])
        images.append(reduce_samples(image))
    return _compose(images, scale, unit, describe_quality(arena.quality))


def _measure(
    triangles: Triangles,
    view: View,
    measure: Callable[[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]], Float[np.ndarray, " N"]],
) -> tuple[Pixels, Float[np.ndarray, "H W"]]:
    """Return the pixels of a view, and a measure of point and normal in each; 0 where there is nothing."""
    pixels = rasterize(triangles, view)
    rows, columns = np.nonzero(pixels.face >= 0)
    values = np.zeros(pixels.face.shape)
    if len(rows):
        points = view.find_points(columns, rows, pixels.height[rows, columns])
        cells = np.round((points - points.min(axis=0)) * view.scale / OVERSAMPLING).astype(np.int64)
        keys = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
        _, first, group = np.unique(keys, return_index=True, return_inverse=True)
        corners = triangles[pixels.face[rows, columns][first]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        values[rows, columns] = measure(points[first], normals)[group]
    return pixels, values


def _find_limit(values: Sequence[np.ndarray]) -> float:
    """Return the 95th percentile of the distances, rounded up to 1, 2 or 5 times a power of ten [m]."""
    sizes = np.concatenate([np.abs(each[each != 0]) for each in values])
    sizes = sizes[np.isfinite(sizes)]
    if not len(sizes):
        return LEAST_LIMIT
    wanted = max(float(np.percentile(sizes, 95)), LEAST_LIMIT)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= wanted * (1 - 1e-9)))


def describe_quality(quality: ArenaQuality) -> str:
    """Return the figures that go with an error map, in one or two lines."""
    count = format_count(quality.num_pieces, "piece")
    pieces = f"{count}; " if quality.num_pieces else ""  # none with a height field
    lines = [
        f"{pieces}surface within reach to contact: mean {format_distance(quality.mean)}, "
        f"95 % {format_distance(quality.p95)}, max {format_distance(quality.max)}; "
        f"{quality.uncovered:.1%} without contact"
    ]
    if quality.beams_contact is not None and quality.beams_surface is not None:
        lines.append(
            f"beams that end at their reading: {quality.beams_contact:.1%} on contact, "
            f"{quality.beams_surface:.1%} on the surface; free space that is solid: {quality.free_space or 0:.1%}"
        )
    return "\n".join(lines)


def _compose(
    images: Sequence[Float[np.ndarray, "_ _ 3"]], scale: ScalarMappable, unit: str, text: str
) -> Figure:
    heights = [image.shape[0] for image in images[::2]]
    figure = Figure(figsize=(2 * WIDTH / DPI, sum(heights) / DPI + 1.7), dpi=DPI, layout="constrained")
    figure.suptitle(text, fontsize=10)
    grid = figure.subplots(2, 2, gridspec_kw={"height_ratios": heights})
    titles = ("surface: where its contact geometry lies", "contact geometry: where it lies from the surface")
    for index, (axes, image) in enumerate(zip(grid.ravel(), images, strict=True)):
        axes.imshow(image)
        axes.set_axis_off()
        if index < 2:
            axes.set_title(titles[index], fontsize=11)
    bar = figure.colorbar(scale, ax=grid, location="bottom", extend="both", shrink=0.6, aspect=45, pad=0.01)
    bar.set_label(
        f"contact behind or missing  ←  distance [{unit}]  →  contact in front, a bump", fontsize=10
    )
    return figure


SLIPPERY, ROUGH = (0.20, 0.50, 0.95), (0.75, 0.40, 0.15)
"""Colors of patches with less and with more friction than the rest of the ground."""
_FULL = 0.5  # Difference of the friction that is drawn in the full color
_OPACITY = (0.25, 0.8)  # Of the smallest and of the largest difference


def add_friction(picture: Picture, surface: Pixels, view: View, arena: sg.Arena) -> Picture:
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


_PARTS = 80
"""Contact is cut into parts this small, relative to the arena, before those behind the surface are left out."""
_ALIKE = 0.5  # Cosine from which contact faces the same way as the surface
_IN_FRONT = 0.001
"""Contact farther in front of the surface is drawn whichever way it faces [m]. The rest is the outside of a wall."""
_HIDDEN = 1e-4  # Contact deeper inside another piece is left out [m]


def find_touchable(arena: sg.Arena) -> tuple[Triangles, Int[np.ndarray, " F"]]:
    """Return the triangles of contact that a robot may meet, in small parts, and the piece of each."""
    meshes = [arena.height_field.as_mesh()] if arena.height_field is not None else arena.pieces
    vertices, faces = join_meshes(meshes)
    labels = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    if not len(faces):
        return np.zeros((0, 3, 3)), labels
    size = float(arena.surface.extents.max()) / _PARTS
    parts = trimesh.remesh.subdivide_to_size(vertices, faces, size, max_iter=30, return_index=True)
    faces, origin = (np.asarray(part, dtype=np.int64) for part in parts[1:])
    triangles, labels = np.asarray(parts[0])[faces], labels[origin]
    nearest = find_signed_nearest(triangles.mean(axis=1), arena.surface)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(nearest.normals, axis=1)
    cosines = (normals * nearest.normals).sum(axis=1) / np.maximum(lengths, np.finfo(float).tiny)
    is_front = (nearest.heights > _IN_FRONT) | (cosines > _ALIKE)
    is_front &= compute_depths(triangles.mean(axis=1), arena.pieces) < _HIDDEN
    return triangles[is_front], labels[is_front]
