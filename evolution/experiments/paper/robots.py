"""Fig. 7: the evolution, its champion judged in the true arena, and an insufficiently evolved robot beside it."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.demo.demo import find_insufficient
from evolution.experiments.paper.config import PaperConfig
from evolution.report.video import encode_video
from evolution.search.run import RunFolder
from reconstruction.files.atomic_write import write_atomically

SHORT = 4
"""Modules of a body that is too short for the pit, whatever law moves it."""
FILM_SPEED = 5.0


def evolve_champion(
    folder: Path, arena: str, name: str, config: PaperConfig, generations: int, workers: int,
    progress: rc.Progress = rc.silent,
) -> ev.Run:  # fmt: skip
    """Evolve in an arena of the folder, or go on where an interrupted run stopped.

    Args:
        folder: holds the arenas; keeps the run.
        arena: name of the folder in `arenas`.
        name: of the run's folder.
        config: body and seed.
        generations: at most.
        workers: threads.
        progress: told how far it is.
    """
    place = folder / name
    wanted = ev.EvolutionConfig(
        arena=str((folder / "arenas" / arena).resolve()),
        modules=config.modules,
        seed=config.seed,
        generations=generations,
        workers=workers,
        folder=str(place),
    )
    if _goes_on(wanted, place):
        return ev.resume(place, workers=workers, progress=progress)
    former = RunFolder(place)
    with former.lock():
        former.remove()
    return ev.evolve(wanted, progress=progress)


def _goes_on(wanted: ev.EvolutionConfig, place: Path) -> bool:
    """Tell whether a run is there that can be gone on with: neither damaged, nor of an arena that has moved."""
    try:
        return not ev.load_run(place).config.differences(wanted)
    except ev.RunError:
        return False


def make_part(progress: rc.Progress, title: str, start: float, share: float) -> rc.Progress:
    """Return a progress for a part of the work, that begins at `start` and is a `share` of it."""
    return lambda message, done: progress(f"{title}: {message}", start + share * done)


def describe_run(run: ev.Run) -> dict[str, Any]:
    """Return champion and learning curve as plain content."""
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
    champion: ev.Champion, arenas: dict[str, Any], config: PaperConfig, workers: int
) -> dict[str, dict[str, int]]:
    """Return arena -> `successes` of `trials` from the floor."""
    judged = {}
    for name, arena in arenas.items():
        outcome = ev.judge(champion, arena, config.trials, config.seed, workers=workers)
        judged[name] = {"successes": outcome.successes, "trials": outcome.trials}
    return judged


def film_robots(
    folder: Path, run: ev.Run, config: PaperConfig, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Film robots in the true arena: an early one, one that is too short, and the champion.

    Args:
        folder: keeps films, frames and positions.
        run: whose champion and first generation are filmed.
        config: seed.
        progress: told how far it is.

    Returns:
        Robot -> `modules`, `success`, `progress` [m], `seconds`, and `moments` of the three frames [s] (empty
        where the machine has no OpenGL).
    """
    champion = run.champion
    assert champion is not None
    robots = {
        "insufficient": find_insufficient(run),
        "short": dataclasses.replace(champion, modules=SHORT),
        "champion": champion,
    }
    truth = sg.load_arena("truth")
    (folder / "films").mkdir(exist_ok=True)
    told = {}
    for index, (name, robot) in enumerate(robots.items()):
        progress(name, index / len(robots))
        film = ev.play(robot, truth, config.seed, film=True, speed=FILM_SPEED, fps=config.film_rate)
        told[name] = {
            "modules": robot.modules,
            "success": film.success,
            "progress": film.progress,
            "seconds": film.seconds,
            "moments": _keep_film(folder / "films", name, film),
        }
    return told


def choose_moments(positions: np.ndarray, num_frames: int, near: float = -0.35) -> list[int]:
    """Return three frames that tell the story: before the pit, in the middle, at the end.

    Args:
        positions: `[T, n, 3]` of the modules, head first [m].
        num_frames: of the film, evenly spread over T.
        near: where the head is close before the pit [m].
    """
    arrives = int(np.argmax(positions[:, 0, 0] > near)) if (positions[:, 0, 0] > near).any() else 0
    last = len(positions) - 1
    ticks = np.array([arrives, (arrives + last) / 2, last])
    return np.clip(ticks / max(last, 1) * (num_frames - 1), 0, num_frames - 1).round().astype(int).tolist()


def _keep_film(folder: Path, name: str, film: ev.Recording) -> list[float]:
    with write_atomically(folder / f"{name}.npz") as beside:
        np.savez_compressed(beside, positions=film.positions, rotations=film.rotations)
    if not film.frames:
        return []
    with write_atomically(folder / f"{name}.mp4") as beside:
        beside.write_bytes(encode_video(film.frames, film.fps))
    chosen = choose_moments(film.positions, len(film.frames))
    for index, frame in enumerate(chosen):
        with write_atomically(folder / f"{name}_{index + 1}.png") as beside:
            Image.fromarray(film.frames[frame]).save(beside, optimize=True)
    return [round(min(frame * FILM_SPEED / film.fps, film.seconds), 2) for frame in chosen]
