"""Pictures of the map of drivable ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.routes import DrivingRoute

_SIZE = (12.0, 5.5)
"""Of the picture [inches]."""
_DPI = 120


def draw_traversability(
    ground: TraversabilityMap, path: str | Path, route: DrivingRoute | None = None
) -> None:
    """Draw a map from above as a PNG: regions at the left, the height of their ground at the right.

    Where there are several storeys, the largest region is drawn, and above it nothing.

    Args:
        ground: the map.
        path: the file.
        route: drawn on it, with start and goal; None for none.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    require_extras("a picture of the map", "report")
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    low, high = (
        ground.grid.low,
        np.asarray(ground.grid.low) + np.multiply(ground.grid.shape, ground.grid.cell),
    )
    extent = (low[0], float(high[0]), low[1], float(high[1]))
    axes[0].imshow(ground.picture(), extent=extent, interpolation="nearest")
    areas = ground.region_areas
    largest = f", the largest {areas[0]:.1f} m² (green)" if len(areas) else ""
    axes[0].set_title(f"{format_count(ground.num_regions, 'drivable region')}, {areas.sum():.1f} m²{largest}")
    image = axes[1].imshow(_find_heights(ground), extent=extent, interpolation="nearest", cmap="viridis")
    figure.colorbar(image, ax=axes[1], label="height of the ground [m]")
    axes[1].set_title(f"{ground.level.max(initial=-1) + 1} levels of ground")
    for axis in axes:
        axis.set_xlabel("x [m]")
        if route is not None:
            axis.plot(route.path[:, 0], route.path[:, 1], color="crimson", linewidth=1.5)
            axis.plot(*route.goal[:2], "*", color="crimson", markersize=12, label="goal")
            axis.plot(*route.start[:2], "o", color="white", markeredgecolor="crimson", label="start")
    if route is not None:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    axes[0].set_ylabel("y [m]")
    with write_atomically(path) as temporary:
        figure.savefig(temporary, format="png", dpi=_DPI)


def _find_heights(ground: TraversabilityMap) -> np.ndarray:
    """Return an image of heights [m]: of the largest region, else of the other regions, else of other ground."""
    heights = np.full(ground.grid.num_cells, np.nan)
    rank = np.where(ground.region < 0, ground.num_regions, ground.region)
    order = np.argsort(-rank, kind="stable")  # the last one written stays
    heights[ground.cell[order]] = ground.height[order]
    return heights.reshape(ground.grid.shape).T[::-1]
