"""The film of a swarm's story: slower where the organism crosses."""

from __future__ import annotations

import logging

import numpy as np
from jaxtyping import UInt8

from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.swarm.behavior.swarm import Track
from symbrion_gym._src.swarm.film import SwarmCamera
from symbrion_gym._src.swarm.starts import Field

logger = logging.getLogger(__name__)
FPS = 20
"""Frames a second."""
SPEEDS = (20.0, 5.0)
"""How many times faster than the robots the film runs, while they gather, and from then on."""


def film_story(
    track: Track,
    arena: Arena,
    field: Field,
    crossing: tuple[float, float] | None,
    progress: Progress = silent,
) -> list[UInt8[np.ndarray, "H W 3"]]:
    """Return the frames of a story."""
    camera = SwarmCamera(arena, track.position.shape[1], field.route.heading)
    moments = choose_moments(track, crossing)
    frames = []
    for number, index in enumerate(moments):
        # The camera follows in the time of the film.
        time = number / FPS
        frames.append(camera.draw(track.position[index], track.rotation[index], track.hinge[index], time))
        if number % FPS == 0:
            progress("film", number / len(moments))
    camera.close()
    return frames


def encode_film(
    track: Track,
    arena: Arena,
    field: Field,
    crossing: tuple[float, float] | None,
    progress: Progress = silent,
) -> bytes | None:
    """Return the film of a story as MP4; None, and a warning, where OpenGL cannot be used."""
    from evolution._src.report.video import encode_video

    try:
        frames = film_story(track, arena, field, crossing, progress)
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
