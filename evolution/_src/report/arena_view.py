"""Pictures of an arena in layers: surface, contact geometry, drivable ground, route."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from scipy.spatial import cKDTree

import symbrion_gym as sg
from evolution._src.report.figures import DPI
from evolution._src.report.layers import add_friction, find_touchable, make_friction_legend
from evolution._src.report.raster import (
    OVERSAMPLING,
    Picture,
    Pixels,
    View,
    blend,
    draw_outlines,
    find_frame,
    make_view,
    rasterize,
    reduce_samples,
    shade_pixels,
)
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.arenas.spec import make_piece_colors
from symbrion_gym._src.arenas.viewing import LAYERS, place_modules
from symbrion_gym._src.contact.quality import RayMesh
from symbrion_gym._src.robot.scout_constants import ScoutConfig

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.tasks.paths import Pair
    from symbrion_gym._src.traversability.drivable import TraversabilityMap
    from symbrion_gym._src.traversability.routes import DrivingRoute

ROBOT_COLOR = (0.98, 0.78, 0.16)
WAY_LOOK: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.4}
_MOST_TICKS = 14  # Along the longer side of a picture
BEHIND = 0.05
"""Contact, route and robot this far behind the surface are still drawn [m]: within what a robot feels."""


def add_robot(picture: Picture, surface: Pixels, view: View, boxes: list[trimesh.Trimesh]) -> Picture:
    """Return the picture with the modules of a robot, but for what the surface hides of them."""
    triangles = np.concatenate([np.asarray(box.triangles) for box in boxes])
    pixels = rasterize(triangles, view)
    is_seen = (pixels.face >= 0) & (pixels.height > surface.height - BEHIND)
    above = shade_pixels(pixels, triangles, np.array(ROBOT_COLOR))
    module = np.where(is_seen, pixels.face // len(boxes[0].faces), -1)
    return draw_outlines(blend(picture, above, is_seen, 1.0), module, is_seen)


def add_scale(axes: Axes, view: View) -> None:
    """Draw coordinates in meters at the sides of a picture from above, and a grid."""
    middle, scale = view.center @ view.axes.T, view.scale / OVERSAMPLING
    halves = np.array([view.width, view.height]) / OVERSAMPLING / 2
    longest = float(halves.max()) / scale
    step = float(np.diff(MaxNLocator(_MOST_TICKS, steps=[1, 2, 5, 10]).tick_values(-longest, longest))[0])
    for axis, sign, place, half in zip((axes.xaxis, axes.yaxis), (1.0, -1.0), middle, halves, strict=False):
        low, high = (int(end) for end in np.trunc((place + np.array([-1.0, 1.0]) * half / scale) / step))
        values = step * np.arange(low, high + 1)
        values = values[np.abs(values - place) <= half / scale]
        axis.set_ticks(half + sign * scale * (values - place), [f"{value:g}" for value in values])
    axes.set_xlabel("x [m]", fontsize=FONT)
    axes.set_ylabel("y [m]", fontsize=FONT)
    axes.tick_params(labelsize=FONT)
    axes.grid(color="black", alpha=0.18, linewidth=0.6)


DIRECTIONS = ((35.0, -60.0), (35.0, 120.0))
"""Elevation and azimuth of the two cameras [degree]: opposite each other, so that every wall is seen."""
FROM_ABOVE = (90.0, -90.0)  # Of the camera of the plan: x to the right, y up
_MARGIN = 100  # Beside a plan, for its coordinates [pixel]
PLAN_SHARE = 0.7  # Width of the plan, relative to that of both pictures side by side
FONT = 13  # Size of text [point]: pages show the picture at about two thirds of its size
WIDTH = 760  # Width of each picture [pixel]
SURFACE_COLOR = np.array([0.80, 0.78, 0.74])
LUMA = np.array([0.2126, 0.7152, 0.0722])  # Weights of red, green and blue in a gray (ITU-R BT.709)
LIGHTEST, MUTED_CONTRAST = 0.92, 0.35
"""Of the grays in place of a scan's colors, below contact or drivable ground: white, and what of the contrast stays."""
CONTACT_OPACITY = 0.40
CONTACT_COLOR, PLAIN_OPACITY = (0.36, 0.44, 0.90), 0.25
"""Of contact over colored ground; else each piece has its own color."""
GROUND_COLORS = {
    "largest drivable region": (0.22, 0.62, 0.34),
    "other drivable regions": (0.35, 0.50, 0.80),
    "ground, not drivable": (0.86, 0.45, 0.38),
}
GROUND_OPACITY = 0.55
HEIGHT_WEIGHT = 4.0
"""Surface is colored as ground within two cells in plan, and in height within two divided by this."""
ROUTE_COLOR = "#b00050"
ENDS = (("*", 12, ROUTE_COLOR, "goal"), ("o", 7, "white", "start"))
"""Marker, size [point], color and name, in the order in which they are drawn: a goal never hides the start."""
LIFT = 0.02  # A route is drawn this far above the ground [m]


def draw_arena(
    arena: sg.Arena,
    layers: Sequence[str] = LAYERS,
    ground: TraversabilityMap | None = None,
    route: DrivingRoute | None = None,
    robot: Organism | None = None,
    views: Sequence[str] = ("sides",),
    way: Pair | None = None,
) -> Figure:
    """Draw an arena from two "sides", and as a "plan"; what is seen from behind, or lies above the route, is left out.

    What trails far off the scene is outside the picture (`find_frame`).
    """
    front, labels = find_touchable(arena) if "contact" in layers else (np.zeros((0, 3, 3)), np.zeros(0, int))
    route = route if "route" in layers else None
    boxes = []
    if robot is not None and route is not None:
        boxes = [trimesh.creation.box(robot.scout.size, pose) for pose in place_modules(robot, route)]
    has_plan = "plan" in views
    frame = find_frame(arena, route, way if has_plan else None)
    sides = [make_view(frame, *each, OVERSAMPLING * WIDTH) for each in DIRECTIONS if "sides" in views]
    plans = [make_view(frame, *FROM_ABOVE, OVERSAMPLING * round(PLAN_SHARE * 2 * WIDTH))] if has_plan else []
    figure, places = _make_figure(sides, plans)
    pieces = format_count(arena.quality.num_pieces, "contact piece")
    shape = pieces if arena.height_field is None else "a height field"
    figure.suptitle(f"{arena.name}: {shape}", fontsize=FONT)
    cover = np.inf if route is None else find_cover(arena, route.path)
    triangles, front = (_leave_out_above(each, cover) for each in (arena.surface.triangles, front))
    for axes, view in zip(places, sides + plans, strict=True):
        pixels = rasterize(triangles, view)
        picture = _draw_surface(arena, layers, pixels, view)
        contact = rasterize(front, view)
        shown_ground = ground if "drivable" in layers else None
        if "contact" in layers:
            picture = _add_contact(picture, pixels, contact, front, labels, shown_ground is not None)
        if shown_ground is not None:
            picture = _add_ground(picture, np.maximum(pixels.height, contact.height), view, shown_ground)
        if boxes:
            picture = add_robot(picture, pixels, view, boxes)
        axes.imshow(reduce_samples(picture))
        if route is not None:
            _add_route(axes, view, pixels, route)
    if has_plan and way is not None:
        begin, end = plans[0].project(np.column_stack([np.array(way), np.zeros(2)]))[:, :2] / OVERSAMPLING
        look = {**WAY_LOOK, "arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0}
        places[-1].annotate("", end, begin, arrowprops=look)
    handles = _make_legend(layers, ground, route)
    if robot is not None and boxes:
        label = f"robot, {format_count(robot.num_modules, 'module')}"
        handles.append(Patch(facecolor=ROBOT_COLOR, edgecolor="black", label=label))
    if has_plan and way is not None:
        handles.append(Line2D([], [], label="straight way for it", **WAY_LOOK))
    handles += make_friction_legend(arena) if "surface" in layers else []
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=FONT)
    return figure


def find_cover(arena: sg.Arena, path: Float[np.ndarray, "W 3"]) -> float:
    """Return the height of the lowest surface above a way, as of a roof or a table [m]; inf under the open sky."""
    starts = np.add(path, [0.0, 0.0, ScoutConfig.size[2]])
    distance = RayMesh([arena.surface]).cast(starts, np.tile([0.0, 0.0, 1.0], (len(path), 1)))
    return float((starts[:, 2] + distance).min())


def _leave_out_above(triangles: Float[np.ndarray, "F 3 3"], height: float) -> Float[np.ndarray, "F 3 3"]:
    """Return the triangles in their order, of those above a height one corner alone, which hides nothing."""
    is_above = triangles[:, :, 2].min(axis=1) > height - BEHIND
    return np.where(is_above[:, None, None], triangles[:, :1], triangles)


def _make_figure(sides: Sequence[View], plans: Sequence[View]) -> tuple[Figure, list[Axes]]:
    """Return a figure with a place for each view: two sides beside each other, and plans below them."""
    rows = [max(view.height for view in row) / OVERSAMPLING / DPI for row in (sides, plans) if row]
    width = 2 * WIDTH if sides else PLAN_SHARE * 2 * WIDTH + _MARGIN
    figure = Figure(figsize=(width / DPI, sum(rows) + 0.8 * len(rows)), dpi=DPI, layout="constrained")
    grid = figure.add_gridspec(len(rows), 2, height_ratios=rows)
    places = [figure.add_subplot(grid[0, column]) for column in range(len(sides))]
    for axes in places:
        axes.set_axis_off()
    for view in plans:
        places.append(figure.add_subplot(grid[-1, :]))
        add_scale(places[-1], view)
    return figure, places


def _draw_surface(arena: sg.Arena, layers: Sequence[str], pixels: Pixels, view: View) -> Picture:
    """Return the picture of the surface with its friction; white where it is not wanted."""
    if "surface" not in layers:
        return np.ones((*pixels.face.shape, 3))
    colors = _color_pixels(arena, pixels, view)
    if arena.texture is not None and {"contact", "drivable"} & set(layers):
        colors = mute(colors)
    picture = shade_pixels(pixels, np.asarray(arena.surface.triangles), colors)
    return add_friction(picture, pixels, view, arena)


def _color_pixels(arena: sg.Arena, pixels: Pixels, view: View) -> Picture | Float[np.ndarray, " 3"]:
    """Return the color of the surface in each pixel; one for all where the arena has none."""
    if arena.texture is None:
        return SURFACE_COLOR
    rows, columns = np.nonzero(pixels.face >= 0)
    face = pixels.face[rows, columns]
    places = view.find_points(columns, rows, pixels.height[rows, columns])
    colors = np.ones((*pixels.face.shape, 3))
    colors[rows, columns] = arena.texture.find_colors(arena.surface, face, places)
    return colors


def mute(colors: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
    """Return light grays in place of colors: a scan's colors through translucent layers would be none of either."""
    gray = colors @ LUMA
    return np.repeat((LIGHTEST - MUTED_CONTRAST * (1.0 - gray))[..., None], 3, axis=-1)


def _add_contact(
    picture: Picture,
    surface: Pixels,
    contact: Pixels,
    triangles: Float[np.ndarray, "F 3 3"],
    labels: Int[np.ndarray, " F"],
    is_plain: bool,
) -> Picture:
    """Return the picture with translucent pieces that the surface does not hide; `is_plain`: all of one color."""
    if not len(triangles):
        return picture
    is_seen = (contact.face >= 0) & (contact.height > surface.height - BEHIND)
    piece = np.where(is_seen, labels[contact.face], -1)
    colors = make_piece_colors(int(labels.max()) + 1)[piece, :3]
    above = shade_pixels(contact, triangles, np.array(CONTACT_COLOR) if is_plain else colors)
    opacity = PLAIN_OPACITY if is_plain else CONTACT_OPACITY
    return draw_outlines(blend(picture, above, is_seen, opacity), piece, is_seen)


def _add_ground(
    picture: Picture, heights: Float[np.ndarray, "H W"], view: View, ground: TraversabilityMap
) -> Picture:
    """Return the picture with ground colored by whether the body can drive there, on surface or contact."""
    rows, columns = np.nonzero(np.isfinite(heights))
    if not len(rows) or not len(ground.cell):
        return picture
    points = view.find_points(columns, rows, heights[rows, columns])
    flat = [1.0, 1.0, HEIGHT_WEIGHT]
    distance, place = cKDTree(ground.positions * flat).query(
        points * flat, distance_upper_bound=2 * ground.grid.cell
    )
    is_ground = np.isfinite(distance)
    region = ground.region[np.where(is_ground, place, 0)]
    kind = np.where(region == 0, 0, np.where(region > 0, 1, 2))
    tint = picture.copy()
    tint[rows, columns] = np.array(list(GROUND_COLORS.values()))[kind]
    is_shown = np.zeros(heights.shape, dtype=bool)
    is_shown[rows, columns] = is_ground
    return blend(picture, tint, is_shown, GROUND_OPACITY)


def _add_route(axes: Axes, view: View, pixels: Pixels, route: DrivingRoute) -> None:
    """Draw path, start and goal; dotted where the surface hides them."""
    path = np.add(route.path, [0.0, 0.0, LIFT])
    seen = view.project(path) / [OVERSAMPLING, OVERSAMPLING, 1.0]
    columns, rows = (OVERSAMPLING * seen[:, :2].T).astype(np.int64)
    last_row, last_column = np.array(pixels.height.shape) - 1
    heights = pixels.height[np.clip(rows, 0, last_row), np.clip(columns, 0, last_column)]
    is_seen = seen[:, 2] > heights - BEHIND
    axes.plot(seen[:, 0], seen[:, 1], ":", color=ROUTE_COLOR, linewidth=1.2)
    for part in np.split(np.arange(len(path)), np.flatnonzero(np.diff(is_seen)) + 1):
        if is_seen[part[0]]:
            axes.plot(seen[part, 0], seen[part, 1], color=ROUTE_COLOR, linewidth=2.0)
    ends = view.project(np.add([route.goal, route.start], [0.0, 0.0, LIFT]))[:, :2] / OVERSAMPLING
    for place, (marker, size, color, _) in zip(ends, ENDS, strict=True):
        axes.plot(*place, marker, color=color, markersize=size, markeredgecolor=ROUTE_COLOR)


def _make_legend(
    layers: Sequence[str], ground: TraversabilityMap | None, route: DrivingRoute | None
) -> list[Patch | Line2D]:
    handles: list[Patch | Line2D] = []
    if "contact" in layers:
        handles.append(Patch(color=CONTACT_COLOR, alpha=CONTACT_OPACITY, label="contact pieces"))
    if "drivable" in layers and ground is not None:
        handles += [Patch(color=color, label=name) for name, color in GROUND_COLORS.items()]
    if "route" in layers and route is not None:
        for marker, size, color, name in reversed(ENDS):
            line = Line2D([], [], marker=marker, markersize=size, label=name, color=color, linestyle="none")
            line.set_markeredgecolor(ROUTE_COLOR)
            handles.append(line)
    return handles
