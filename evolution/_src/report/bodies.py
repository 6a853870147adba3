"""Pictures of bodies from above, hinges straight."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, cos, sin

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from evolution._src.bodies.genome import BodyGenome
from evolution._src.report.figures import DPI, EDGE_COLOR, INK_COLOR, MARK_COLOR, SURFACE_COLOR

COLUMNS = 6
"""Bodies side by side."""
_CELL = (1.9, 1.8)
"""Width and height of a body with its label [inch]."""
_LEAST_SPAN = 0.45
"""Edge of the smallest region that is drawn [m], so that small bodies do not look large."""


def draw_bodies(bodies: Sequence[BodyGenome], labels: Sequence[str], columns: int = COLUMNS) -> Figure:
    """Draw bodies in a grid, all to the same scale; the module with the free arm, which looks ahead, looks up."""
    columns = min(columns, max(len(bodies), 1))
    rows = ceil(max(len(bodies), 1) / columns)
    figure = Figure(figsize=(_CELL[0] * columns, _CELL[1] * rows), dpi=DPI, layout="constrained")
    span = max([_LEAST_SPAN, *(_find_span(body) for body in bodies)])
    for index, (body, label) in enumerate(zip(bodies, labels, strict=True)):
        axes = figure.add_subplot(rows, columns, index + 1)
        _draw_body(axes, body, span)
        axes.set_title(label, fontsize=7, color=INK_COLOR, y=-0.02, va="top")
    return figure


def _find_span(body: BodyGenome) -> float:
    """Return the longer edge of a body [m], with a margin."""
    organism = body.to_organism()
    poses = organism.find_poses()
    sides = [[getattr(pose, axis) for pose in poses] for axis in ("x", "y")]
    return max(max(side) - min(side) for side in sides) + 1.6 * organism.scout.size[0]


def _draw_body(axes: Axes, body: BodyGenome, span: float) -> None:
    """Draw modules as squares, each with a line to the dock of its arm."""
    organism = body.to_organism()
    half, reach = organism.scout.size[0] / 2, organism.scout.arm_reach
    poses = organism.find_poses()
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
