"""The whole experiment: a champion, the story of a swarm, and a swarm that may not dock beside."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import symbrion_gym as sg
from evolution._src.errors import RunError
from evolution._src.experiments.folders import Track as Steps
from evolution._src.experiments.folders import claim_folder, evolve_or_resume
from evolution._src.experiments.swarm.story import Figures, StoryConfig, tell_story
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.run import load_champion
from evolution._src.search.validation import Champion
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.progress import Progress
from reconstruction._src.base.typed_json import JsonError, as_type, read_json, write_json
from symbrion_gym._src.swarm.behavior.machine import Track
from symbrion_gym._src.swarm.behavior.memory import Mode

MARKER = "swarm.json"  # The file that the command writes first; it holds what the other files were made with
RESULTS = "results.json"
OUTPUTS = ("run", "track.npz", "timeline.png", "film.mp4", RESULTS)
BASELINE_TIME = 300.0  # A swarm that may not dock explores for so long [s]
GENERATIONS = 30  # Limit of the evolution of a champion


@dataclass(frozen=True)
class SwarmRunConfig:
    """Configuration of `run_swarm`."""

    folder: Path  # output folder
    story: StoryConfig  # what is told
    # of a run or file of a champion that crosses; None to evolve one in the arena
    champion: Path | None = None
    workers: int = 1  # threads of its evolution; the results do not depend on their number
    allow: tuple[str, ...] = ()  # modules of yours that the champion names and that may be imported


def run_swarm(config: SwarmRunConfig, steps: Steps) -> tuple[Track, list[dict[str, Any]]]:
    """Tell the story, and that of a swarm that may not dock; what an earlier run has told is read from the folder."""
    about = {**asdict(config.story), "champion": None if config.champion is None else str(config.champion)}
    claim_folder(config.folder, MARKER, about, OUTPUTS)
    arena, path = sg.load_arena(config.story.arena), config.folder / "track.npz"
    results = _read_stories(config.folder / RESULTS)
    with steps("1/3 champion") as step:
        champion = find_champion(config, step.progress)
    baseline = replace(config.story, docks=False, gather_time=BASELINE_TIME)
    for index, story in enumerate((config.story, baseline)):
        with steps(("2/3 story", "3/3 a swarm that may not dock")[index]) as step:
            if index < len(results) and path.exists():
                continue
            figures, track = tell_story(story, arena, champion, step.progress)
            if story.docks:
                with write_atomically(path) as beside, beside.open("wb") as file:
                    np.savez_compressed(file, **track._asdict())
            results = [*results[:index], figures]
            write_json(config.folder / RESULTS, results)
    arrays = read_npz(path)
    if set(arrays) != set(Track._fields) or not _is_track(Track(**arrays), config.story.num_robots):
        raise RunError(f"{path} is no track of a swarm; remove it to tell the story again")
    return Track(**arrays), results


def _is_track(track: Track, num_robots: int) -> bool:
    """Return whether arrays of a file have the shapes and values of a track."""
    shape = (track.time.size, num_robots)
    wanted = Track(shape[:1], (*shape, 3), (*shape, 3, 3), shape, shape)  # pyright: ignore[reportArgumentType]
    return (
        track.time.size > 0
        and all(array.shape == each for array, each in zip(track, wanted, strict=True))
        and all(array.dtype.kind in "fiu" and np.isfinite(array).all() for array in track)
        and bool(np.isin(track.mode, list(Mode)).all())
    )


def find_champion(config: SwarmRunConfig, progress: Progress) -> Champion:
    """Return the champion that crosses: a given one, or one that evolves in the arena; its run can be resumed."""
    story, folder = config.story, config.folder / "run"
    if config.champion is not None:
        champion = load_champion(config.champion).restore(config.allow)
        if champion.find_organism() != sg.snake(story.num_robots):
            raise RunError(
                f"the champion {config.champion} is no snake of {story.num_robots} modules; give --robots as its body "
                "has, or another champion"
            )
        return champion
    search = EvolutionConfig(
        arena=story.arena,
        modules=story.num_robots,
        seed=story.seed,
        generations=GENERATIONS,
        workers=config.workers,
        folder=str(folder),
    )
    run = evolve_or_resume(search, progress)
    if run.champion is None:
        raise RunError(f"no champion after {GENERATIONS} generations; give one with --champion")
    return run.champion


def _read_stories(path: Path) -> list[dict[str, Any]]:
    try:
        stories = read_json(path) if path.is_file() else []
        as_type(stories, list[Figures])
    except JsonError as error:
        raise RunError(f"{path} holds no stories ({error}); remove it to tell them again") from error
    return stories
