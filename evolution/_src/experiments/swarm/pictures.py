"""The timeline of a swarm: who was where, in which state."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym._src.swarm.behavior.memory import Mode
from symbrion_gym._src.swarm.behavior.swarm import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from symbrion_gym._src.swarm.starts import Field

COLORS = {
    Mode.EXPLORE: "#9ecae1",
    Mode.RETREAT: "#e377c2",
    Mode.RECRUIT: "#d62728",
    Mode.WAIT: "#d9d9d9",
    Mode.LOCATE_BEACON: "#fdae6b",
    Mode.ALIGN: "#fd8d3c",
    Mode.DOCK: "#a63603",
    Mode.LOCK: "#000000",
    Mode.RECOVER: "#ffdd33",
    Mode.IN_ORGANISM: "#31a354",
    Mode.UNDOCK: "#756bb1",
    Mode.LEAVE: "#3182bd",
    Mode.REST: "#636363",
}
"""One color a behavior."""


def draw_timeline(track: Track, field: Field, crossing: tuple[float, float] | None = None) -> Figure:
    """Draw the behavior of every robot over time, and below where all are along the way."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(10, 6.5), layout="constrained")
    bars, ways = figure.subplots(2, 1, sharex=True, height_ratios=(2, 3))
    num_robots = track.mode.shape[1]
    for robot in range(num_robots):
        _draw_bar(bars, track, robot)
    bars.set_yticks(range(num_robots), [f"robot {robot}" for robot in range(num_robots)])
    bars.invert_yaxis()
    shown = [mode for mode in Mode if (track.mode == mode).any()]
    labels = [Patch(color=COLORS[mode], label=mode.name.lower().replace("_", " ")) for mode in shown]
    bars.legend(handles=labels, loc="upper center", bbox_to_anchor=(0.5, 1.35), ncols=7, fontsize="small")
    along = track.position[..., :2] @ np.array(field.route.direction)
    ways.plot(track.time, along, linewidth=1)
    if field.route.pit is not None:
        ways.axhspan(*field.route.pit[:2], color="0.6", label="pit")
    if crossing is not None:
        ways.axvspan(*crossing, color="#31a354", alpha=0.2, label="crossing, full contact")
    ways.legend(loc="upper left", fontsize="small")
    ways.set_xlabel("time [s]")
    ways.set_ylabel("place along the way [m]")
    return figure


def _draw_bar(axes: object, track: Track, robot: int) -> None:
    mode = track.mode[:, robot]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(mode)) + 1, [len(mode) - 1]])
    spans = [(track.time[one], track.time[other] - track.time[one]) for one, other in pairwise(starts)]
    colors = [COLORS[Mode(mode[one])] for one in starts[:-1]]
    axes.broken_barh(spans, (robot - 0.4, 0.8), facecolors=colors)  # pyright: ignore[reportAttributeAccessIssue]
