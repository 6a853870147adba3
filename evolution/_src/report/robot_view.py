"""A robot in the picture of an arena; from above, coordinates and a straight way for it."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from evolution._src.report.raster import Pixels, View, rasterize
from evolution._src.report.shading import OVERSAMPLING, blend, draw_outlines, shade_pixels
from reconstruction._src.base.quantities import format_count
from symbrion_gym._src.arenas.standing_robot import place_modules
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.traversability.routes import DrivingRoute

ROBOT_COLOR = (0.98, 0.78, 0.16)
WAY_LOOK: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.4}
_MOST_TICKS = 14
"""Along the longer side of a picture."""
_BEHIND = 0.05
"""A robot this far behind the surface is still drawn [m]: it stands on contact, which may be lower."""


def make_boxes(robot: Organism, route: DrivingRoute) -> list[trimesh.Trimesh]:
    """Return a box for each module, at the start of a route."""
    return [trimesh.creation.box(robot.scout.size, pose) for pose in place_modules(robot, route)]


def add_robot(
    picture: Float[np.ndarray, "H W 3"], surface: Pixels, view: View, boxes: list[trimesh.Trimesh]
) -> Float[np.ndarray, "H W 3"]:
    """Return the picture with the modules of a robot, but for what the surface hides of them."""
    triangles = np.concatenate([np.asarray(box.triangles) for box in boxes])
    pixels = rasterize(triangles, view)
    is_seen = (pixels.face >= 0) & (pixels.height > surface.height - _BEHIND)
    above = shade_pixels(pixels, triangles, np.array(ROBOT_COLOR))
    module = np.where(is_seen, pixels.face // len(boxes[0].faces), -1)
    return draw_outlines(blend(picture, above, is_seen, 1.0), module, is_seen)


def make_robot_legend(robot: Organism) -> Patch:
    """Return the entry of a robot."""
    return Patch(
        facecolor=ROBOT_COLOR, edgecolor="black", label=f"robot, {format_count(robot.num_modules, 'module')}"
    )


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
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(color="black", alpha=0.18, linewidth=0.6)


def add_way(axes: Axes, view: View, way: Float[np.ndarray, "2 2"]) -> None:
    """Draw a straight way from a start to a goal into a picture from above."""
    begin, end = view.project(np.column_stack([way, np.zeros(2)]))[:, :2] / OVERSAMPLING
    axes.annotate("", end, begin, arrowprops={**WAY_LOOK, "arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0})


def make_way_legend() -> Line2D:
    """Return the entry of a straight way."""
    return Line2D([], [], label="straight way for it", **WAY_LOOK)
