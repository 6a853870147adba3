"""Beyond the paper: the pit is widened, the robot scans again, the same network goes on learning."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.paper.cloud import LOG, survey_arena
from evolution.experiments.paper.config import PIT, PaperConfig
from evolution.experiments.paper.networks import measure_surface
from evolution.experiments.paper.robots import describe_run, evolve_champion, judge_champion, make_part
from symbrion_gym.ready_made import SPACING


def measure_widened(
    folder: Path, config: PaperConfig, workers: int, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Let a network that knows a narrower pit learn on from the survey of the true one, and evolve in both.

    Both walls of the pit have moved, each by half of the difference; all else stays where it was.

    Args:
        folder: holds the survey; keeps one of the narrower pit, both surfaces, their arenas and runs.
        config: by how much the pit widens, generations and seed.
        workers: threads.
        progress: told how far it is.

    Returns:
        `pit` before and after [m]; `surfaces`: rows for the surface as it was, refined, and made anew of the
        second scan log, with `seconds` (processor time of a warm call, pre-processing included) and distances from the
        widened truth [m]; `before` and `after`: what is known of the champions that evolved in either surface,
        `judged` in both true arenas.
    """
    narrow = sg.Course(pit=PIT - config.widened, plateau=sg.Course().plateau + config.widened / 2)
    truths = {"narrow": sg.Arena.from_course(narrow), "wide": sg.load_arena("truth")}
    progress("first survey", 0.0)
    _, points = survey_arena(truths["narrow"], folder, "narrow_", config.seed + 1, rc.silent)
    known = _make(points, config)
    progress("refining", 0.1)
    log = rc.load_scan_log(folder / LOG)
    (refined, refine_seconds), (anew, anew_seconds) = _time_in_turns(
        lambda: known.refine(log, seed=config.seed),
        lambda: _make(rc.thin(rc.preprocess(log), SPACING), config),
    )
    surface = truths["wide"].surface
    told: dict[str, Any] = {
        "pit": [narrow.pit, PIT],
        "surfaces": [
            {"surface": "as it was", "seconds": None, **measure_surface(known.mesh, surface)},
            {"surface": "refined", "seconds": refine_seconds, **measure_surface(refined.mesh, surface)},
            {"surface": "made anew", "seconds": anew_seconds, **measure_surface(anew.mesh, surface)},
        ],
    }
    stages = {"before": ("narrow", known, narrow), "after": ("refined", refined, sg.Course())}
    for index, (when, (name, network, course)) in enumerate(stages.items()):
        within = make_part(progress, f"evolution {when}", 0.2 + 0.4 * index, 0.4)
        network.save(folder / "surfaces" / f"{name}.npz")
        arena = sg.make_arena(network.mesh, name=name, course=course, seed=config.seed)
        arena.save(folder / "arenas" / name)
        run = evolve_champion(
            folder, name, f"runs/{name}", config, config.widened_generations, workers, within
        )
        assert run.champion is not None
        told[when] = describe_run(run) | {"judged": judge_champion(run.champion, truths, config, workers)}
    return told


def _make(points: np.ndarray, config: PaperConfig) -> rc.Reconstruction:
    return rc.reconstruct(points, method="gsrm", units=config.arena_units, seed=config.seed)


def _time_in_turns(*makers: Callable[[], rc.Reconstruction]) -> list[tuple[rc.Reconstruction, float]]:
    """Return what each makes and its processor time [s], the median of three calls after one that may compile."""
    made = [make() for make in makers]
    seconds: list[list[float]] = [[] for _ in makers]
    for _ in range(3):
        for make, times in zip(makers, seconds, strict=True):
            start = time.process_time()
            make()
            times.append(time.process_time() - start)
    return [(surface, float(np.median(times))) for surface, times in zip(made, seconds, strict=True)]
