"""The film of a swarm's story: slower where the organism crosses."""

from __future__ import annotations

import logging
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from evolution._src.report.video import encode_video
from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.swarm.behavior.machine import Track
from symbrion_gym._src.swarm.behavior.memory import Mode
from symbrion_gym._src.swarm.film import SwarmCamera
from symbrion_gym._src.swarm.placing import Field

logger = logging.getLogger(__name__)
FPS = 20  # Frames a second
SPEEDS = (20.0, 5.0)
"""How many times faster than the robots the film runs, while they gather, and from then on."""


def encode_film(
    track: Track,
    arena: Arena,
    field: Field,
    crossing: tuple[float, float] | None,
    progress: Progress = silent,
) -> bytes | None:
    """Return the film of a story as MP4; None, and a warning, where OpenGL cannot be used."""
    moments, frames = choose_moments(track, crossing), []
    try:
        camera = SwarmCamera(arena, track.position.shape[1], field.route.heading)
        for number, index in enumerate(moments):
            # The camera follows in the time of the film.
            where = track.position[index], track.rotation[index], track.hinge[index]
            frames.append(camera.draw(*where, number / FPS))
            if number % FPS == 0:
                progress("film", number / len(moments))
        camera.close()
    except Exception as error:  # whatever a graphics driver raises
        logger.warning("no video: OpenGL cannot be used here (%s: %s)", type(error).__name__, error)
        return None
    return encode_video(frames, FPS)


def choose_moments(track: Track, crossing: tuple[float, float] | None) -> list[int]:
    """Return the rows of a track that are shown."""
    begin = track.time[-1] if crossing is None else crossing[0]
    fast = np.arange(track.time[0], begin, SPEEDS[0] / FPS)
    slow = np.arange(begin, track.time[-1], SPEEDS[1] / FPS)
    return np.searchsorted(track.time, np.concatenate([fast, slow])).clip(0, len(track.time) - 1).tolist()


COLORS = (
    "#9ecae1", "#e377c2", "#d62728", "#d9d9d9", "#fdae6b", "#fd8d3c", "#a63603", "#000000", "#ffdd33", "#31a354",
    "#756bb1", "#3182bd", "#636363",
)  # fmt: skip
"""One color a behavior, in the order of `Mode`."""


def draw_timeline(track: Track, field: Field, crossing: tuple[float, float] | None = None) -> Figure:
    """Draw the behavior of every robot over time, and below where all are along the way."""
    figure = Figure(figsize=(10, 6.5), layout="constrained")
    bars, ways = figure.subplots(2, 1, sharex=True, height_ratios=(2, 3))
    num_robots = track.mode.shape[1]
    for robot, mode in enumerate(track.mode.T):
        starts = np.concatenate([[0], np.flatnonzero(np.diff(mode)) + 1, [len(mode) - 1]])
        spans = [(track.time[one], track.time[other] - track.time[one]) for one, other in pairwise(starts)]
        bars.broken_barh(spans, (robot - 0.4, 0.8), facecolors=[COLORS[mode[one]] for one in starts[:-1]])
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
