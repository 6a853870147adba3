"""Beyond the paper: the pit is widened, the robot scans again, and the same network continues to learn."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.paper.cloud import LOG, survey_arena
from evolution._src.experiments.paper.config import PIT, PaperConfig
from evolution._src.experiments.paper.networks import measure_surface
from evolution._src.experiments.paper.robots import (
    describe_run,
    evolve_champion,
    judge_champion,
    scale_progress,
)
from symbrion_gym._src.ready_made import SPACING


def measure_widened(
    folder: Path, config: PaperConfig, workers: int, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Refine a network of a narrower pit with the survey of the true one, and evolve in both surfaces.

    Both walls of the pit move by half of the difference; everything else stays where it is.

    Args:
        folder: contains the survey; that of the narrower pit, both surfaces, their arenas and runs are written to it.
        config: widening of the pit, generations and seed.
        workers: threads; the results do not depend on their number.
        progress: called with a message and the share that is done.

    Returns:
        `pit`: width before and after [m]; `surfaces`: rows for the surface before the change, the refined one and a
        new one from the second scan log, with `seconds` (processor time of a warm call, including pre-processing) and
        distances from the widened true surface [m]; `before` and `after`: the champions that evolved in the surface
        before and after the change, `judged` in both true arenas.

    Raises:
        ScanError: the survey fails.
        ArenaError: a surface cannot become an arena.
        RunError: an evolution fails.
    """
    narrow = sg.Course(pit=PIT - config.widened, plateau=sg.Course().plateau + config.widened / 2)
    truths = {"narrow": sg.Arena.from_course(narrow), "wide": sg.load_arena("truth")}
    progress("first survey", 0.0)
    _, points = survey_arena(truths["narrow"], folder, "narrow_", config.seed + 1, rc.silent)
    before = _reconstruct(points, config)
    progress("refining", 0.1)
    log = rc.load_scan_log(folder / LOG)
    (refined, refine_seconds), (new, new_seconds) = _time_alternately(
        lambda: before.refine(log, seed=config.seed),
        lambda: _reconstruct(rc.thin(rc.preprocess(log), SPACING), config),
    )
    surface = truths["wide"].surface
    figures: dict[str, Any] = {
        "pit": [narrow.pit, PIT],
        "surfaces": [
            {"surface": "before the change", "seconds": None, **measure_surface(before.mesh, surface)},
            {
                "surface": "refined with the new scans",
                "seconds": refine_seconds,
                **measure_surface(refined.mesh, surface),
            },
            {"surface": "new network", "seconds": new_seconds, **measure_surface(new.mesh, surface)},
        ],
    }
    stages = {"before": ("narrow", before), "after": ("refined", refined)}
    for index, (when, (name, network)) in enumerate(stages.items()):
        within = scale_progress(progress, f"evolution {when}", 0.2 + 0.4 * index, 0.4)
        network.save(folder / "surfaces" / f"{name}.npz")
        arena = sg.make_arena(network.mesh, name=name, seed=config.seed)
        arena.save(folder / "arenas" / name)
        run = evolve_champion(
            folder, name, f"runs/{name}", config, config.widened_generations, workers, within
        )
        assert run.champion is not None
        figures[when] = describe_run(run) | {"judged": judge_champion(run.champion, truths, config, workers)}
    return figures


def _reconstruct(points: Float[np.ndarray, "N 3"], config: PaperConfig) -> rc.Reconstruction:
    return rc.reconstruct(points, method="gsrm", units=config.arena_units, seed=config.seed)


def _time_alternately(*makers: Callable[[], rc.Reconstruction]) -> list[tuple[rc.Reconstruction, float]]:
    """Return what each call returns and its processor time [s]: the median of three calls after one that compiles."""
    made = [make() for make in makers]
    seconds: list[list[float]] = [[] for _ in makers]
    for _ in range(3):
        for make, times in zip(makers, seconds, strict=True):
            start = time.process_time()
            make()
            times.append(time.process_time() - start)
    return [(surface, float(np.median(times))) for surface, times in zip(made, seconds, strict=True)]
