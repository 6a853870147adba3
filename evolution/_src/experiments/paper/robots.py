"""Fig. 7: the evolution, its champion judged in the true arena, and videos of it and of robots that fail."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from PIL import Image

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.demo.demo import find_insufficient
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.report.video import encode_video
from evolution._src.search.run import RunFolder
from reconstruction._src.base.atomic_write import write_atomically

SHORT_MODULES = 4
"""Modules of a body that is too short to cross the pit with any controller: 0.5 m, and the pit is 0.45 m wide."""
FILM_SPEED = 5.0
"""Playback speed of the videos, relative to real time."""
NEAR_PIT = -0.35
"""Position of the head shortly before the pit, whose edge is at -0.225 m [m]."""


def evolve_champion(
    folder: Path, arena: str, name: str, config: PaperConfig, generations: int, workers: int,
    progress: rc.Progress = rc.silent,
) -> ev.Run:  # fmt: skip
    """Evolve in an arena of the folder, or resume an interrupted run.

    Args:
        folder: contains the arenas; the run is written to it.
        arena: name of the folder in `arenas`.
        name: name of the run's folder.
        config: body and seed.
        generations: limit.
        workers: threads; the results do not depend on their number.
        progress: called with a message and the share that is done.

    Raises:
        RunError: the run cannot be written or resumed.
    """
    run_folder = folder / name
    wanted = ev.EvolutionConfig(
        arena=str((folder / "arenas" / arena).resolve()),
        modules=config.modules,
        seed=config.seed,
        generations=generations,
        workers=workers,
        folder=str(run_folder),
    )
    if _can_resume(wanted, run_folder):
        return ev.resume(run_folder, workers=workers, progress=progress)
    earlier = RunFolder(run_folder)
    with earlier.lock():
        earlier.remove()
    return ev.evolve(wanted, progress=progress)


def _can_resume(wanted: ev.EvolutionConfig, run_folder: Path) -> bool:
    """Return whether an undamaged run of the wanted configuration exists; the path of the arena belongs to that."""
    try:
        return not ev.load_run(run_folder).config.differences(wanted)
    except ev.RunError:
        return False


def scale_progress(progress: rc.Progress, title: str, start: float, share: float) -> rc.Progress:
    """Return a progress callback for a part of the work that starts at `start` and is a `share` of the whole."""
    return lambda message, done: progress(f"{title}: {message}", start + share * done)


def describe_run(run: ev.Run) -> dict[str, Any]:
    """Return champion and learning curve as plain JSON content."""
    assert run.champion is not None
    history = run.history
    return {
        "champion": run.champion.as_dict(),
        "genotypes": int(history["evaluations"][-1]),
        "generations": len(history),
        "evaluations": history["evaluations"].tolist(),
        "best": history["best"].tolist(),
        "median": history["median"].tolist(),
    }


def judge_champion(
    champion: ev.Champion, arenas: Mapping[str, str | sg.Arena], config: PaperConfig, workers: int
) -> dict[str, dict[str, int]]:
    """Return arena -> `successes` and number of `trials`, which start on the floor before the first ramp."""
    judged = {}
    for name, arena in arenas.items():
        outcome = ev.judge(champion, arena, config.trials, config.seed, workers=workers)
        judged[name] = {"successes": outcome.successes, "trials": outcome.trials}
    return judged


def film_robots(
    folder: Path, run: ev.Run, config: PaperConfig, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Film robots in the true arena: an insufficiently evolved one, one that is too short, and the champion.

    Args:
        folder: videos, frames and positions are written to it.
        run: whose champion and first generation are filmed.
        config: seed.
        progress: called with a message and the share that is done.

    Returns:
        Robot -> `modules`, `success`, `progress` [m], `seconds`, and `moments`, the times of the three frames [s]
        (empty where the machine has no OpenGL).
    """
    champion = run.champion
    assert champion is not None
    robots = {
        "insufficient": find_insufficient(run),
        "short": dataclasses.replace(champion, modules=SHORT_MODULES),
        "champion": champion,
    }
    truth = sg.load_arena("truth")
    (folder / "films").mkdir(exist_ok=True)
    figures = {}
    for index, (name, robot) in enumerate(robots.items()):
        progress(name, index / len(robots))
        film = ev.play(robot, truth, config.seed, film=True, speed=FILM_SPEED, fps=config.film_rate)
        figures[name] = {
            "modules": robot.modules,
            "success": film.success,
            "progress": film.progress,
            "seconds": film.seconds,
            "moments": _save_film(folder / "films", name, film),
        }
    return figures


def select_frames(
    positions: Float[np.ndarray, "ticks modules 3"], num_frames: int, near: float = NEAR_PIT
) -> list[int]:
    """Return the indices of three frames: shortly before the pit, half way from there to the end, and the last.

    Args:
        positions: positions of the modules, head first [m].
        num_frames: number of frames of the video, evenly distributed over the ticks.
        near: position of the head shortly before the pit [m].
    """
    arrives = int(np.argmax(positions[:, 0, 0] > near)) if (positions[:, 0, 0] > near).any() else 0
    last = len(positions) - 1
    ticks = np.array([arrives, (arrives + last) / 2, last])
    return np.clip(ticks / max(last, 1) * (num_frames - 1), 0, num_frames - 1).round().astype(int).tolist()


def _save_film(folder: Path, name: str, film: ev.Recording) -> list[float]:
    """Save positions, and where there are images video and three frames; return the times of these [s]."""
    with write_atomically(folder / f"{name}.npz") as beside:
        np.savez_compressed(beside, positions=film.positions, rotations=film.rotations)
    if not film.frames:
        return []
    with write_atomically(folder / f"{name}.mp4") as beside:
        beside.write_bytes(encode_video(film.frames, film.fps))
    selected = select_frames(film.positions, len(film.frames))
    for index, frame in enumerate(selected):
        with write_atomically(folder / f"{name}_{index + 1}.png") as beside:
            Image.fromarray(film.frames[frame]).save(beside, optimize=True)
    return [round(min(frame * FILM_SPEED / film.fps, film.seconds), 2) for frame in selected]
