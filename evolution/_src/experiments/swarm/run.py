"""The whole experiment: a champion, the story and its film, further trials, and a swarm that may not dock."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import evolution as ev
import symbrion_gym as sg
from evolution._src.experiments.demo import Track as Steps
from evolution._src.experiments.demo import find_run_champion, refuse_foreign_files
from evolution._src.experiments.swarm.story import (
    BASELINE_TIME,
    Story,
    StoryConfig,
    SwarmRunConfig,
    tell_story,
)
from evolution._src.search.run import load_champion
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.progress import Progress
from reconstruction._src.base.typed_json import JsonError, read_json
from symbrion_gym._src.swarm.behavior.machine import Track

MARKER = "swarm.json"  # The file that the command writes first; it holds what the other files were made with
OUTPUTS = ("run", "stories.json", "track.npz", "timeline.png", "film.mp4", "results.json")


@dataclass
class SwarmResult:
    """What the stories came to."""

    track: Track  # of the first story
    rows: list[dict[str, Any]]  # figures of all stories, docking ones first

    def count(self, docks: bool) -> tuple[int, int]:
        """Return successes and number of the stories with or without docking."""
        chosen = [row for row in self.rows if row["docks"] == docks]
        return sum(row["success"] for row in chosen), len(chosen)


def run_swarm(config: SwarmRunConfig, track: Steps) -> SwarmResult:
    """Run all stories; those that an earlier run has told are read from the folder."""
    claim_folder(config)
    arena = sg.load_arena(config.story.arena)
    rows = _read_rows(config)
    wanted = list_stories(config)
    with track("1/3 champion") as step:
        champion = find_champion(config, step.progress)
    for title, docks in (("2/3 stories", True), ("3/3 a swarm that may not dock", False)):
        chosen = [story for story in wanted if story.docks == docks]
        with track(title) as step:
            for index, story in enumerate(chosen):
                key = _name(story)
                if key in rows and (config.folder / "track.npz").exists():
                    continue
                told = tell_story(story, arena, champion, _share(step.progress, index, len(chosen)))
                if docks and index == 0:
                    save_track(config, told)
                rows[key] = told.as_dict()
                _write(config, "stories.json", rows)
    result = SwarmResult(_load_track(config), [rows[_name(story)] for story in wanted])
    _write(config, "results.json", _summarize(result))
    return result


def list_stories(config: SwarmRunConfig) -> list[StoryConfig]:
    """Return the story, its trials with other seeds, and as many where robots may not dock."""
    seeds = [config.story.seed + index for index in range(config.trials + 1)]
    docking = [replace(config.story, seed=seed) for seed in seeds]
    return docking + [replace(each, docks=False, gather_time=BASELINE_TIME) for each in docking]


def claim_folder(config: SwarmRunConfig) -> None:
    """Write the marker, or refuse a folder that holds something else."""
    refuse_foreign_files(config.folder, MARKER, OUTPUTS)
    marker = config.folder / MARKER
    about = {**config.story.describe(), "champion": None if config.champion is None else str(config.champion)}
    try:
        known = read_json(marker) if marker.is_file() else None
    except JsonError as error:
        raise ev.RunError(f"{marker} is damaged ({error}); name another folder, or remove it") from error
    if known is not None and known != about:
        raise ev.RunError(
            f"{config.folder} holds results of other options; name another folder, or remove it to begin again"
        )
    config.folder.mkdir(parents=True, exist_ok=True)
    _write(config, MARKER, about)


def find_champion(config: SwarmRunConfig, progress: Progress) -> ev.Champion:
    """Return the champion that crosses: a given one, or one that evolves in the arena; its run can be resumed."""
    count = config.story.num_robots
    if config.champion is not None:
        champion = load_champion(config.champion).restore(config.allow)
        if champion.find_organism() != sg.snake(count):
            raise ev.RunError(
                f"the champion {config.champion} is no snake of {count} modules; give --robots as its body has, or "
                "another champion"
            )
        return champion
    story = config.story
    return find_run_champion(
        config.folder / "run", story.arena, count, story.seed, config.generations, config.workers, progress
    )


def save_track(config: SwarmRunConfig, story: Story) -> None:
    """Write where the robots were, and what they did, as arrays."""
    with write_atomically(config.folder / "track.npz") as beside, beside.open("wb") as file:
        np.savez_compressed(file, **story.track._asdict())


def _load_track(config: SwarmRunConfig) -> Track:
    path = config.folder / "track.npz"
    arrays = read_npz(path)
    try:
        return Track(*(arrays[name] for name in Track._fields))
    except KeyError as error:
        raise ev.RunError(
            f"{path} is no track of a swarm ({error}); remove it to tell the story again"
        ) from error


def _share(progress: Progress, index: int, count: int) -> Progress:
    return lambda what, share: progress(f"{what}, story {index + 1} of {count}", (index + share) / count)


def _name(story: StoryConfig) -> str:
    return f"{story.seed}{'' if story.docks else ' without docking'}"


def _read_rows(config: SwarmRunConfig) -> dict[str, dict[str, Any]]:
    path = config.folder / "stories.json"
    try:
        found = read_json(path) if path.is_file() else {}
    except JsonError as error:
        raise ev.RunError(f"{path} is damaged ({error}); remove it to tell the stories again") from error
    if not isinstance(found, dict):
        raise ev.RunError(f"{path} holds no stories; remove it to tell them again")
    return found


def _summarize(result: SwarmResult) -> dict[str, Any]:
    docking, alone = result.count(True), result.count(False)
    return {
        "successes": docking[0],
        "trials": docking[1],
        "successes_without_docking": alone[0],
        "trials_without_docking": alone[1],
        "stories": result.rows,
    }


def _write(config: SwarmRunConfig, name: str, content: object) -> None:
    with write_atomically(config.folder / name) as beside:
        beside.write_text(json.dumps(content, indent=2) + "\n")
