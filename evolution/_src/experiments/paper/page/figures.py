"""Figures of the measured times: by kind of arena, and by number of triangles."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from evolution._src.experiments.paper.page.numbers import SCANS
from evolution._src.report.figures import INK_COLOR, PALETTE, style_axes
from evolution._src.report.pictures import CHART_DPI, CHART_WIDTH

STYLES = {
    "tree": ("MuJoCo, bounding-volume tree", "o-", PALETTE[0]),
    "embree": ("Embree", "s-", PALETTE[2]),
    "brute force": ("brute force (every triangle)", "^-", PALETTE[1]),
}


def draw_costs(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the time of a physics step in each arena and of its collision detection, with standard deviations.

    Args:
        rows: rows of Table II.
    """
    figure = Figure(figsize=(CHART_WIDTH, 0.34 * len(rows) + 0.9), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    places = range(len(rows))
    parts = (
        ("physics_us", "whole step", 0.8, "#c9d6e4"),
        ("collision_us", "collision detection within it", 0.45, PALETTE[0]),
    )
    for cost, label, height, color in parts:
        means = [row[cost]["mean"] for row in rows]
        deviations = [row[cost]["deviation"] for row in rows]
        axes.barh(
            places, means, height, color=color, label=label, xerr=deviations, ecolor=INK_COLOR, capsize=2
        )
    axes.set_yticks(places, [row["text"] for row in rows])
    axes.invert_yaxis()
    axes.set(xlabel="time of a physics step [µs]", xlim=(0, None))
    axes.legend(frameon=False)
    style_axes(axes)
    return figure


def draw_scan_growth(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the time of a laser scan over the number of triangles, for each method and for the paper.

    Args:
        rows: rows of Table III.
    """
    figure = Figure(figsize=(CHART_WIDTH, 3.4), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    for method, (label, style, color) in STYLES.items():
        shown = sorted(
            (row["triangles"], row["scan_us"]["median"]) for row in rows if row["method"] == method
        )
        if shown:
            axes.plot(*zip(*shown, strict=True), style, color=color, label=label, ms=5)
    axes.plot(
        *zip(*sorted(SCANS.values()), strict=True), "D--", color="#5b6675", label="the paper (2011)", ms=5
    )
    axes.set(xscale="log", yscale="log", xlabel="triangles", ylabel="time of one scan of 361 beams [µs]")
    axes.legend(frameon=False)
    style_axes(axes)
    return figure
