"""Pictures of a place that has changed: the model before and after, and the truth, seen from above and in a section."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evolution._src.experiments.live.scene import SceneConfig, find_regions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    import symbrion_gym as sg
    from evolution._src.experiments.live.live import LiveResult

_SPACING = 0.01
"""Of the heights that are drawn [m]."""
_TITLES = {"before": "model before", "after": "model after the drive", "truth": "truth now"}


def draw_models(result: LiveResult, scene: SceneConfig) -> Figure:
    """Draw the heights of the model before, of the model after, and of the truth; changes are framed, ice is hatched.

    Args:
        result: of the command.
        scene: what has changed.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    shown = {**result.arenas, "truth": result.truths["after"]}
    course = scene.course
    x = np.arange(-course.length / 2, course.length / 2, _SPACING)
    y = np.arange(-course.width / 2, course.width / 2, _SPACING)
    figure = Figure(figsize=(11, 11), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True, sharey=True)
    image = None
    for ax, (name, arena) in zip(axes, shown.items(), strict=True):
        heights = arena.height(*np.meshgrid(x, y))
        image = ax.imshow(
            heights,
            extent=(x[0], x[-1], y[0], y[-1]),
            origin="lower",
            vmin=0.0,
            vmax=course.height,
            cmap="viridis",
        )
        for region in find_regions(scene):
            (x0, y0, _), (x1, y1, _) = region.low, region.high
            ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor="red"))
            ax.text(x0, y1, region.name, color="red", va="bottom")
        _draw_friction(ax, arena)
        ax.set_title(_TITLES[name], loc="left")
        ax.set_ylabel("y [m]")
    axes[-1].set_xlabel("x [m]")
    if image is not None:
        figure.colorbar(image, ax=axes, label="height [m]", shrink=0.6)
    return figure


def _draw_friction(ax: Axes, arena: sg.Arena) -> None:
    """Hatch the friction patches of an arena, and write their friction."""
    from matplotlib.patches import Polygon

    for patch in () if arena.friction_map is None else arena.friction_map.patches:
        for outline in patch.outlines:
            ax.add_patch(
                Polygon(outline, closed=True, fill=False, edgecolor="white", hatch="//", linewidth=0.5)
            )
        middle = np.mean(max(patch.outlines, key=lambda outline: np.ptp(outline, axis=0).prod()), axis=0)
        width = f" ± {patch.half_width:.2f}" if patch.half_width else ""
        label = f"friction {patch.friction:.2f}{width}"
        ax.text(
            float(middle[0]),
            float(middle[1]),
            label,
            color="white",
            ha="center",
            va="center",
            fontweight="bold",
        )
