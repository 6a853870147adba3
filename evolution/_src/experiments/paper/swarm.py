"""Beyond the paper: single robots gather before the pit, cross it as one body, and part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import evolution as ev
import reconstruction as rc
from evolution._src.experiments.paper.arenas import load_arena
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.swarm.config import BASELINE_TIME, StoryConfig
from evolution._src.experiments.swarm.film import encode_film
from evolution._src.experiments.swarm.pictures import draw_timeline
from evolution._src.experiments.swarm.story import tell_story
from evolution._src.report.pictures import to_png
from reconstruction._src.base.atomic_write import write_atomically
from symbrion_gym._src.swarm.starts import find_field

FILM, TIMELINE = "swarm.mp4", "swarm_timeline.png"
"""Files of the first story, in the folder of the films."""


def tell_stories(
    folder: Path, champion: ev.Champion, config: PaperConfig, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Tell the story of a swarm in the GSRM arena, with as many seeds as `swarm_stories`, and without docking.

    Args:
        folder: contains the arena; film and timeline of the first story are written to it.
        champion: that crosses.
        config: number of robots and stories, and seed.
        progress: called with a message and the share that is done.

    Returns:
        `stories` and `without_docking`: rows as of `Story.as_dict`; `film`: whether there is one, which needs OpenGL.
    """
    arena, count = load_arena(folder, "gsrm"), config.swarm_stories
    field = find_field(arena, config.modules)
    rows, alone, has_film = [], [], False
    for index in range(count):
        story = StoryConfig("gsrm", config.seed + index, config.modules)
        told = tell_story(story, arena, champion, _share(progress, index, count))
        rows.append(told.as_dict())
        without = replace(story, docks=False, gather_time=BASELINE_TIME)
        alone.append(tell_story(without, arena, champion).as_dict())
        if index == 0:
            crossing = (told.gathered, told.crossed) if told.success else None
            (folder / "films").mkdir(exist_ok=True)
            with write_atomically(folder / "films" / TIMELINE) as beside:
                beside.write_bytes(to_png(draw_timeline(told.track, field, crossing)))
            film = encode_film(told.track, arena, field, crossing, progress)
            has_film = film is not None
            if film is not None:
                with write_atomically(folder / "films" / FILM) as beside:
                    beside.write_bytes(film)
    return {"stories": rows, "without_docking": alone, "film": has_film}


def _share(progress: rc.Progress, index: int, count: int) -> rc.Progress:
    return lambda what, share: progress(f"story {index + 1} of {count}: {what}", (index + share) / count)
