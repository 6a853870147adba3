"""Figures of point clouds, surfaces, arenas and runs; drawn without a display or OpenGL."""

import io
from collections.abc import Mapping, Sequence
from math import ceil, cos, sin

import matplotlib as mpl
import numpy as np
import trimesh
from jaxtyping import Float, Real, UInt8
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from evolution._src.report.raster import (
    OVERSAMPLING,
    draw_outlines,
    make_view,
    rasterize,
    reduce_samples,
    shade_pixels,
)
from evolution._src.search.bodies.genome import BodyGenome
from reconstruction._src.geometry.rows import find_inside
from reconstruction._src.surfaces.color import WHITE, find_vertex_colors

DPI = 110  # Resolution of figures without text; a page shows them pixel by pixel
CHART_DPI = 150  # Resolution of charts; higher, so that their text is sharp on screens of high density
CHART_WIDTH = 5.6  # Width of a chart [inch]; its text can be read on a phone, too
MARGIN = 12  # White border around a figure [pixel]


def to_png(figure: Figure, is_reduced: bool = True) -> bytes:
    """Return the figure as PNG, cropped to the drawing; `is_reduced`: to 256 colors, too few for color scales."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    rows, columns = (np.flatnonzero((pixels < 250).any(axis=(axis, 2))) for axis in (1, 0))
    cut = pixels[
        max(rows[0] - MARGIN, 0) : rows[-1] + MARGIN, max(columns[0] - MARGIN, 0) : columns[-1] + MARGIN
    ]
    return encode_png(cut, figure.dpi, is_reduced)


def encode_png(pixels: UInt8[np.ndarray, "H W 3"], dpi: float = DPI, is_reduced: bool = True) -> bytes:
    """Return an image as PNG with its resolution; `is_reduced`: to 256 colors, which figures hardly exceed."""
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(pixels))
    image = image.quantize(256, dither=Image.Dither.NONE) if is_reduced else image
    image.save(buffer, format="png", optimize=True, dpi=(dpi, dpi))
    return buffer.getvalue()


def compute_width(png: bytes) -> int:
    """Return the width at which a page shows an image [pixel]; a chart has more pixels, for sharp text."""
    image = Image.open(io.BytesIO(png))
    return round(image.width * DPI / image.info.get("dpi", (DPI, DPI))[0])


VIEW = (28.0, -62.0)
"""Elevation and azimuth of the camera [degree]: both ramps and the bottom of the pit can be seen."""
PALETTE = ("#24588f", "#c8553d", "#3f8f5b", "#8b5fa8", "#b8892b", "#4a9aa8")
MARK_COLOR = "#d1242f"
EDGE_COLOR = "#3a4a5c"
INK_COLOR = "#1d2530"
SURFACE_COLOR = "#c9d6e4"
SECTION_Y = 0.1  # Where a section lies, beside the middle of the course [m]
SECTION_HALF_WIDTH = 0.03  # Points up to this distance from a section are drawn on it [m]
WIDTH = 1000  # Of pictures of meshes [pixel]


def draw_cloud(
    points: Float[np.ndarray, "N 3"],
    limit: int = 25_000,
    marked: Float[np.ndarray, "M 3"] | None = None,
    bounds: Float[np.ndarray, "2 3"] | None = None,
) -> Figure:
    """Draw a point cloud, colored by height."""
    if bounds is not None:
        points = points[find_inside(points, *bounds)]
    step = max(1, len(points) // limit)
    shown = points[::step]
    figure = Figure(figsize=(12, 8), dpi=DPI)
    axes = _make_3d_axes(figure, points if bounds is None else bounds)
    low, high = np.percentile(shown[:, 2], (1, 99))
    look = {"c": shown[:, 2], "cmap": "viridis", "vmin": low, "vmax": high}
    axes.scatter(*shown.T, **look, s=0.9, depthshade=False, linewidths=0, rasterized=True)
    if marked is not None:
        seen = marked if bounds is None else marked[find_inside(marked, *bounds)]
        seen = seen[:: max(1, len(seen) // limit)]
        axes.scatter(*seen.T, c=MARK_COLOR, s=2.2, depthshade=False, linewidths=0, rasterized=True)
    return figure


def draw_surface(mesh: trimesh.Trimesh, bounds: Float[np.ndarray, "2 3"] | None = None) -> Figure:
    """Draw a shaded mesh with its edges, or in its own colors without them."""
    triangles, own = np.asarray(mesh.triangles), find_vertex_colors(mesh)
    corners = np.stack(np.meshgrid(*(mesh.bounds if bounds is None else bounds).T), axis=-1).reshape(-1, 3)
    view = make_view(corners, *VIEW, OVERSAMPLING * WIDTH)
    pixels = rasterize(triangles, view, is_culled=False)
    if own is None:
        picture = shade_pixels(pixels, triangles, np.array(to_rgb(SURFACE_COLOR)))
        picture = draw_outlines(picture, pixels.face, pixels.face >= 0)
    else:
        picture = shade_pixels(
            pixels, triangles, own[np.asarray(mesh.faces)].mean(axis=1)[pixels.face] / WHITE
        )
    return _show(reduce_samples(picture))


def draw_pieces(pieces: Sequence[trimesh.Trimesh]) -> Figure:
    """Draw the convex pieces of an arena, each in its own color."""
    triangles = np.concatenate([np.asarray(piece.triangles) for piece in pieces])
    labels = np.repeat(np.arange(len(pieces)), [len(piece.faces) for piece in pieces])
    view = make_view(triangles.reshape(-1, 3), *VIEW, OVERSAMPLING * WIDTH)
    pixels = rasterize(triangles, view)
    colors = np.array(mpl.colormaps["tab20"].colors)  # pyright: ignore[reportAttributeAccessIssue]
    picture = shade_pixels(pixels, triangles, colors[labels[pixels.face] % len(colors)])
    return _show(reduce_samples(draw_outlines(picture, np.append(labels, -1)[pixels.face])))


def _show(picture: Float[np.ndarray, "H W 3"]) -> Figure:
    """Return a figure of a picture, pixel by pixel."""
    figure = Figure(figsize=(picture.shape[1] / DPI, picture.shape[0] / DPI), dpi=DPI)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(np.clip(picture, 0.0, 1.0))
    axes.set_axis_off()
    return figure


def draw_section(
    meshes: Mapping[str, trimesh.Trimesh | Sequence[trimesh.Trimesh]],
    points: Float[np.ndarray, "N 3"] | None = None,
    marked: Float[np.ndarray, "M 3"] | None = None,
) -> Figure:
    """Draw a vertical section along the course: every surface as a line, the points near it as dots."""
    figure, axes = make_chart(2.7)
    for cloud, size, color, label in (
        (points, 4, "#6b7683", "points"),
        (marked, 7, MARK_COLOR, "mixed pixels"),
    ):
        if cloud is not None:
            near = cloud[np.abs(cloud[:, 1] - SECTION_Y) < SECTION_HALF_WIDTH]
            look = {"s": size, "c": color, "linewidths": 0, "rasterized": True, "zorder": 3}
            axes.scatter(near[:, 0], near[:, 2], label=label, **look)
    for index, (label, group) in enumerate(meshes.items()):
        parts = [group] if isinstance(group, trimesh.Trimesh) else list(group)
        cuts = [trimesh.intersections.mesh_plane(part, (0, 1, 0), (0, SECTION_Y, 0)) for part in parts]
        lines = np.concatenate(cuts)[:, :, [0, 2]] if cuts else []
        color = PALETTE[index % len(PALETTE)]
        width = max(0.9, 2.4 - 0.75 * index)  # lines drawn later do not hide the earlier ones
        axes.add_collection(LineCollection(list(lines), colors=color, linewidths=width, label=label))
    axes.set(xlim=(-1.0, 1.0), xlabel="x [m]", ylabel="z [m]", aspect="equal")
    ground = [group.vertices[:, 2] for group in meshes.values() if isinstance(group, trimesh.Trimesh)]
    if ground:
        heights = np.concatenate(ground)
        axes.set_ylim(heights.min() - 0.1, heights.max() + 0.15)
    axes.legend(frameon=False, fontsize=9, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def draw_learning_curve(
    evaluations: Real[np.ndarray, " G"], best: Real[np.ndarray, " G"], median: Real[np.ndarray, " G"]
) -> Figure:
    """Draw fitness over the number of evaluated genotypes."""
    figure, axes = make_chart(2.7)
    axes.plot(evaluations, best, color=PALETTE[0], marker="o", ms=3, label="best of the generation")
    axes.plot(evaluations, median, color=PALETTE[1], marker="o", ms=3, label="median")
    axes.set(xlabel="genotypes evaluated", ylabel="fitness")
    axes.legend(frameon=False)
    return figure


def draw_tracks(
    positions: Float[np.ndarray, "T M 3"], surface: trimesh.Trimesh, snapshots: int = 7
) -> Figure:
    """Draw the body from the side at several times, over the ground below the line from its start to its end."""
    start, end = positions[0].mean(axis=0), positions[-1].mean(axis=0)
    length = float(np.linalg.norm((end - start)[:2]))
    ahead = (end - start)[:2] / length if length > 0 else np.array([1.0, 0.0])
    cut = trimesh.intersections.mesh_plane(surface, (-ahead[1], ahead[0], 0.0), start)
    ground, bodies = (
        np.stack([(places[..., :2] - start[:2]) @ ahead, places[..., 2]], axis=-1)
        for places in (np.asarray(cut).reshape(-1, 2, 3), positions)
    )
    figure, axes = make_chart(2.2)
    axes.add_collection(LineCollection(list(ground), colors=INK_COLOR, linewidths=1.6))
    colors = mpl.colormaps["viridis"](np.linspace(0.0, 0.92, snapshots))
    chosen = bodies[np.linspace(0, len(bodies) - 1, snapshots).astype(int)]
    for color, body in zip(colors, chosen, strict=True):
        axes.plot(body[:, 0], body[:, 1], "-o", color=color, ms=4, lw=1.2)
    (left, low), (right, high) = bodies.min(axis=(0, 1)), bodies.max(axis=(0, 1))
    axes.set(xlim=(left - 0.2, right + 0.2), ylim=(low - 0.2, high + 0.3), aspect="equal")
    axes.set(xlabel="along the way [m]", ylabel="z [m]")
    return figure


def _make_3d_axes(figure: Figure, points: Float[np.ndarray, "N 3"]) -> Axes:
    axes = figure.add_axes((0, 0, 1, 1), projection="3d")
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1e-9)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(size / size.max(), zoom=1.4)  # pyright: ignore[reportArgumentType, reportCallIssue]
    axes.view_init(*VIEW)  # pyright: ignore[reportAttributeAccessIssue]
    axes.set_axis_off()
    return axes


def make_chart(height: float) -> tuple[Figure, Axes]:
    """Return a chart of a height [inch] with a light grid and two sides of a frame."""
    figure = Figure(figsize=(CHART_WIDTH, height), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    return figure, axes


COLUMNS = 6  # Bodies side by side
_CELL = (1.9, 1.8)  # Width and height of a body with its label [inch]
_LEAST_SPAN = 0.45  # Edge of the smallest region that is drawn [m], so that small bodies do not look large


def draw_bodies(bodies: Sequence[BodyGenome], labels: Sequence[str], columns: int = COLUMNS) -> Figure:
    """Draw bodies in a grid, all to the same scale; the module with the free arm, which looks ahead, looks up."""
    columns = min(columns, max(len(bodies), 1))
    rows = ceil(max(len(bodies), 1) / columns)
    figure = Figure(figsize=(_CELL[0] * columns, _CELL[1] * rows), dpi=DPI, layout="constrained")
    span = max([_LEAST_SPAN, *(_compute_span(body) for body in bodies)])
    for index, (body, label) in enumerate(zip(bodies, labels, strict=True)):
        axes = figure.add_subplot(rows, columns, index + 1)
        _draw_body(axes, body, span)
        axes.set_title(label, fontsize=7, color=INK_COLOR, y=-0.02, va="top")
    return figure


def _compute_span(body: BodyGenome) -> float:
    """Return the longer edge of a body [m], with a margin."""
    organism = body.to_organism()
    poses = organism.compute_poses()
    sides = [[getattr(pose, axis) for pose in poses] for axis in ("x", "y")]
    return max(max(side) - min(side) for side in sides) + 1.6 * organism.scout.size[0]


def _draw_body(axes: Axes, body: BodyGenome, span: float) -> None:
    """Draw modules as squares, each with a line to the dock of its arm."""
    organism = body.to_organism()
    half, reach = organism.scout.size[0] / 2, organism.scout.arm_reach
    poses = organism.compute_poses()
    for module, pose in enumerate(poses):
        c, s = cos(pose.heading), sin(pose.heading)

        def place(x: float, y: float, pose=pose, c: float = c, s: float = s) -> tuple[float, float]:
            """Return a place in the frame of the module as one of the picture: x up, y to the left."""
            return -(pose.y + s * x + c * y), pose.x + c * x - s * y

        corners = [place(x, y) for x, y in ((half, half), (half, -half), (-half, -half), (-half, half))]
        axes.add_patch(Polygon(corners, facecolor=SURFACE_COLOR, edgecolor=EDGE_COLOR, linewidth=1.0))
        (x, y), (end_x, end_y) = place(0.0, 0.0), place(reach, 0.0)
        color = MARK_COLOR if module == 0 else EDGE_COLOR
        axes.plot([x, end_x], [y, end_y], color=color, linewidth=2.2, solid_capstyle="round")
    middle_x = -(min(pose.y for pose in poses) + max(pose.y for pose in poses)) / 2
    middle_y = (min(pose.x for pose in poses) + max(pose.x for pose in poses)) / 2
    axes.set(
        xlim=(middle_x - span / 2, middle_x + span / 2),
        ylim=(middle_y - span / 2, middle_y + span / 2),
        aspect="equal",
    )
    axes.axis("off")
