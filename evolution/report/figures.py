"""Figures of clouds, surfaces, arenas and runs; drawn without a display or OpenGL."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from evolution.report.pictures import CHART_DPI, CHART_WIDTH, DPI

VIEW = (28.0, -62.0)  # elevation, azimuth [degree]
LIGHT = np.array([0.35, -0.5, 0.79])
PALETTE = ("#24588f", "#c8553d", "#3f8f5b", "#8b5fa8", "#b8892b", "#4a9aa8")
MARK = "#d1242f"
EDGE = "#3a4a5c"
COARSE = 300
"""Faces of a mesh that is drawn in parts: large triangles cannot be sorted by depth."""


def draw_cloud(
    points: np.ndarray,
    limit: int = 25_000,
    marked: np.ndarray | None = None,
    bounds: np.ndarray | None = None,
) -> Figure:
    """Draw a point cloud, coloured by height.

    Args:
        points: `[N, 3]` [m]; thinned evenly to `limit` for the picture.
        limit: points drawn at most.
        marked: `[M, 3]` points drawn in red over the others.
        bounds: `[2, 3]` the region that is shown [m], for the same camera in several pictures.
    """
    if bounds is not None:
        points = _crop(points, bounds)
    shown = points[:: max(1, len(points) // limit)]
    figure = Figure(figsize=(12, 8), dpi=DPI)
    axes = _make_scene(figure, points if bounds is None else bounds)
    low, high = np.percentile(shown[:, 2], (1, 99))
    axes.scatter(
        *shown.T, c=shown[:, 2], s=0.9, cmap="viridis", vmin=low, vmax=high, depthshade=False, linewidths=0,
        rasterized=True,
    )  # fmt: skip
    if marked is not None:
        seen = marked if bounds is None else _crop(marked, bounds)
        seen = seen[:: max(1, len(seen) // limit)]
        axes.scatter(*seen.T, c=MARK, s=2.2, depthshade=False, linewidths=0, rasterized=True)
    return figure


def draw_surface(
    mesh: trimesh.Trimesh, points: np.ndarray | None = None, bounds: np.ndarray | None = None
) -> Figure:
    """Draw a shaded mesh with its edges, and some points of the cloud over it.

    Args:
        mesh: the surface.
        points: `[N, 3]` of the cloud [m].
        bounds: `[2, 3]` the region that is shown [m], for the same camera in several pictures.
    """
    figure = Figure(figsize=(12, 8), dpi=DPI)
    axes = _make_scene(figure, mesh.vertices if bounds is None else bounds)
    colour = np.array(to_rgb("#c9d6e4"))
    if len(mesh.faces) > COARSE:
        _add_triangles(axes, mesh, colour, edge=EDGE)
    else:
        _add_large_triangles(axes, mesh, colour)
    if points is not None:
        shown = points[:: max(1, len(points) // 3000)]
        axes.scatter(*shown.T, s=0.4, c=PALETTE[1], depthshade=False, linewidths=0, rasterized=True)
    return figure


def draw_pieces(pieces: Sequence[trimesh.Trimesh]) -> Figure:
    """Draw the convex pieces of an arena, each in a colour of its own."""
    figure = Figure(figsize=(12, 8), dpi=DPI)
    axes = _make_scene(figure, np.vstack([piece.vertices for piece in pieces]))
    colours = mpl.colormaps["tab20"].colors  # pyright: ignore[reportAttributeAccessIssue]
    extent = max(np.ptp(np.vstack([piece.bounds for piece in pieces]), axis=0))
    fine, colour = [], []
    for index, piece in enumerate(pieces):
        part = _subdivide(piece, extent / 60)  # small triangles sort well by depth
        part.update_faces(~_is_hidden(part.triangles_center, index, pieces))
        fine.append(part)
        colour.append(np.tile(colours[index % len(colours)], (len(part.faces), 1)))
    together = trimesh.util.concatenate(fine)
    assert isinstance(together, trimesh.Trimesh)
    _add_triangles(axes, together, np.vstack(colour), edge="none")
    return figure


def draw_section(
    meshes: Mapping[str, trimesh.Trimesh | Sequence[trimesh.Trimesh]],
    points: np.ndarray | None = None,
    y: float = 0.1,
    x_limits: tuple[float, float] = (-1.0, 1.0),
    marked: np.ndarray | None = None,
) -> Figure:
    """Draw the cut along the course: every surface as a line, the points near the cut as dots.

    Args:
        meshes: label -> surface, or pieces that are cut one by one.
        points: `[N, 3]` the cloud [m].
        y: where the vertical cut is made [m].
        x_limits: the part of the course that is shown [m].
        marked: `[M, 3]` points drawn in red where they are near the cut.
    """
    figure = Figure(figsize=(CHART_WIDTH, 2.7), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    if points is not None:
        near = points[np.abs(points[:, 1] - y) < 0.03]
        axes.scatter(
            near[:, 0], near[:, 2], s=4, c="#6b7683", linewidths=0, label="cloud", rasterized=True, zorder=3
        )
    if marked is not None:
        near = marked[np.abs(marked[:, 1] - y) < 0.03]
        axes.scatter(
            near[:, 0], near[:, 2], s=7, c=MARK, linewidths=0, label="mixed pixels", rasterized=True, zorder=4
        )
    for index, (label, group) in enumerate(meshes.items()):
        parts = [group] if isinstance(group, trimesh.Trimesh) else list(group)
        cuts = [_cut(part, y) for part in parts]
        lines = np.concatenate(cuts) if cuts else np.zeros((0, 2, 2))
        colour = PALETTE[index % len(PALETTE)]
        width = max(0.9, 2.4 - 0.75 * index)  # what is drawn later leaves something of the others to be seen
        axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=width, label=label))
    axes.set(xlim=x_limits, xlabel="x [m]", ylabel="z [m]", aspect="equal")
    ground = [group for group in meshes.values() if isinstance(group, trimesh.Trimesh)]
    heights = np.concatenate([mesh.vertices[:, 2] for mesh in ground]) if ground else np.zeros(0)
    if len(heights):
        axes.set_ylim(heights.min() - 0.1, heights.max() + 0.15)
    else:
        axes.autoscale(axis="y")
    axes.legend(frameon=False, fontsize=9, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    soften(axes)
    return figure


def draw_learning_curve(evaluations: np.ndarray, best: np.ndarray, median: np.ndarray) -> Figure:
    """Draw fitness over evaluations.

    Args:
        evaluations: `[G]` genotypes tried by the end of each generation.
        best: `[G]` best fitness of the generation.
        median: `[G]` median fitness of the generation.
    """
    figure = Figure(figsize=(CHART_WIDTH, 2.7), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    axes.plot(evaluations, best, color=PALETTE[0], marker="o", ms=3, label="best of the generation")
    axes.plot(evaluations, median, color=PALETTE[1], marker="o", ms=3, label="median")
    axes.set(xlabel="genotypes evaluated", ylabel="fitness")
    axes.legend(frameon=False)
    soften(axes)
    return figure


def draw_tracks(positions: np.ndarray, surface: trimesh.Trimesh, snapshots: int = 7) -> Figure:
    """Draw the body from the side at several moments, over the ground it drives on.

    Args:
        positions: `[T, M, 3]` centres of the modules over time [m].
        surface: the arena's surface.
        snapshots: moments drawn, from violet (early) to yellow (late).
    """
    figure = Figure(figsize=(CHART_WIDTH, 2.2), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    axes.add_collection(LineCollection(list(_cut(surface, 0.013)), colors="#1d2530", linewidths=1.6))
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.92, snapshots))
    for colour, body in zip(
        colours, positions[np.linspace(0, len(positions) - 1, snapshots).astype(int)], strict=True
    ):
        axes.plot(body[:, 0], body[:, 2], "-o", color=colour, ms=4, lw=1.2)
    low, high = positions[..., 0].min(), positions[..., 0].max()
    axes.set(xlim=(low - 0.2, high + 0.2), ylim=(-0.06, 0.75), aspect="equal", xlabel="x [m]", ylabel="z [m]")
    soften(axes)
    return figure


def _make_scene(figure: Figure, points: np.ndarray) -> Axes:
    axes = figure.add_axes((0, 0, 1, 1), projection="3d")
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1e-9)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(size / size.max(), zoom=1.4)  # pyright: ignore[reportArgumentType, reportCallIssue]
    axes.view_init(*VIEW)  # pyright: ignore[reportAttributeAccessIssue]
    axes.set_axis_off()
    return axes


def _crop(points: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    return points[((points >= bounds[0]) & (points <= bounds[1])).all(axis=1)]


def _cut(mesh: trimesh.Trimesh, y: float) -> np.ndarray:
    """Return the segments `[S, 2, 2]` (x, z) in which a vertical plane along the course cuts a mesh."""
    return np.asarray(trimesh.intersections.mesh_plane(mesh, (0, 1, 0), (0, y, 0)))[:, :, [0, 2]]


def _subdivide(mesh: trimesh.Trimesh, size: float) -> trimesh.Trimesh:
    parts = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, size)
    return trimesh.Trimesh(parts[0], parts[1], process=False)


def _is_hidden(centres: np.ndarray, index: int, pieces: Sequence[trimesh.Trimesh]) -> np.ndarray:
    """Tell which faces of piece `index` lie in another one; of two that coincide the later is hidden."""
    hidden = np.zeros(len(centres), dtype=bool)
    for other, piece in enumerate(pieces):
        if other != index:
            depth = (
                centres @ piece.face_normals.T - np.sum(piece.face_normals * piece.triangles_center, axis=1)
            ).max(axis=1)
            hidden |= depth < (1e-4 if other < index else -1e-4)
    return hidden


def shade(mesh: trimesh.Trimesh, colour: np.ndarray) -> np.ndarray:
    """Return the colours `[F, 3]` of faces in the light; `colour` is one RGB triple, or `[F, 3]` one a face."""
    light = LIGHT / np.linalg.norm(LIGHT)
    brightness = 0.45 + 0.55 * np.clip(mesh.face_normals @ light, 0, 1)
    return brightness[:, None] * colour


def _add_triangles(axes: Axes, mesh: trimesh.Trimesh, colour: np.ndarray, edge: str) -> None:
    """Add shaded triangles; `colour` is one RGB triple, or `[F, 3]` one a face."""
    shaded = shade(mesh, colour)
    axes.add_collection3d(  # pyright: ignore[reportAttributeAccessIssue]
        Poly3DCollection(
            mesh.triangles,
            facecolors=shaded,
            edgecolors=shaded if edge == "none" else edge,
            linewidths=0.25 if len(mesh.faces) < 8000 else 0.08,
            rasterized=True,
        )
    )


def _add_large_triangles(axes: Axes, mesh: trimesh.Trimesh, colour: np.ndarray) -> None:
    """Add triangles in small parts, and their edges in short ones that are sorted by depth among them."""
    size = float(mesh.extents.max()) / 80
    fine = _subdivide(mesh, size)
    elevation, azimuth = np.deg2rad(VIEW)
    towards_eye = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    ends = np.asarray(mesh.vertices)[mesh.edges_unique]
    parts = []
    for start, end in ends:
        cuts = np.linspace(start, end, max(2, int(np.linalg.norm(end - start) / size) + 2))
        parts.append(np.stack([cuts[:-1], cuts[1:], cuts[1:]], axis=1))
    lines = np.concatenate(parts) + size * towards_eye
    shaded = shade(fine, colour)
    dark = np.tile(to_rgb(EDGE), (len(lines), 1))
    axes.add_collection3d(  # pyright: ignore[reportAttributeAccessIssue]
        Poly3DCollection(
            np.concatenate([fine.triangles, lines]),
            facecolors=np.concatenate([shaded, dark]),
            edgecolors=np.concatenate([shaded, dark]),
            linewidths=0.5,
            rasterized=True,
        )
    )


def soften(axes: Axes) -> None:
    """Take away two sides of the frame, and add a faint grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
