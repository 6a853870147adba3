"""Beyond the paper: the pit is widened, the robot scans again, the same network goes on learning."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import trimesh

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution.paper.arenas import load_surface
from evolution.paper.cloud import find_origins, survey_arena
from evolution.paper.config import PIT, PaperConfig
from evolution.paper.robots import describe_run, evolve_champion, judge_champion


def measure_widened(
    folder: Path, champion: ev.Champion, config: PaperConfig, workers: int, progress: rc.Progress = rc.silent
) -> dict[str, Any]:
    """Refine the GSRM with the scan of a wider pit, and try the champion before and after.

    Args:
        folder: holds the GSRM; keeps the second survey, the refined surface, its arena and a run.
        champion: evolved for the pit as it was.
        config: by how much the pit widens, generations and seed.
        workers: threads.
        progress: told how far it is.

    Returns:
        `pit` [m]; `surfaces`: rows for the surface as it was, refined, and made anew of the second cloud, with
        `seconds` (a second, warm call) and distances from the widened truth [m]; `arena`: pieces of the
        refined one; `before` and `after`: the champions in either true arena; `run` of the second evolution,
        None where it is left out.
    """
    course = sg.Course(pit=PIT + config.widened)
    truth = sg.Arena.from_course(course)
    progress("second survey", 0.0)
    log, points = survey_arena(truth, folder, "widened_", config.seed + 1, rc.silent)
    progress("refining", 0.2)
    known = load_surface(folder, "gsrm", config)
    origins = find_origins(log, points)
    refined, refine_seconds = _time(lambda: known.refine(points, origins=origins, seed=config.seed))
    anew, anew_seconds = _time(
        lambda: rc.reconstruct(points, method="gsrm", units=config.arena_units, seed=config.seed)
    )
    refined.save(folder / "surfaces" / "widened.npz")
    progress("arena", 0.4)
    arena = sg.make_arena(refined.mesh, name="widened", course=course, seed=config.seed)
    arena.save(folder / "arenas" / "widened")
    places = {"truth": sg.load_arena("truth"), "widened": truth}
    progress("champion before", 0.5)
    before, after, told = judge_champion(champion, places, config, workers), None, None
    if config.widened_generations:
        run = evolve_champion(
            folder, "widened", "run_widened", config, config.widened_generations, workers,
            lambda text, share: progress(text, 0.6 + 0.3 * share),
        )  # fmt: skip
        assert run.champion is not None
        after, told = judge_champion(run.champion, places, config, workers), describe_run(run)
    return {
        "pit": [PIT, course.pit],
        "surfaces": [
            {"surface": "as it was", "seconds": None, **_measure(known, truth.surface)},
            {"surface": "refined", "seconds": refine_seconds, **_measure(refined, truth.surface)},
            {"surface": "made anew", "seconds": anew_seconds, **_measure(anew, truth.surface)},
        ],
        "arena": {"pieces": len(arena.pieces), "mean": arena.quality.mean, "p95": arena.quality.p95},
        "before": before,
        "after": after,
        "run": told,
    }


def _time(make: Callable[[], rc.Reconstruction]) -> tuple[rc.Reconstruction, float]:
    """Return what is made and the seconds of a second call: the first one may compile."""
    make()
    start = time.perf_counter()
    return make(), time.perf_counter() - start


def _measure(surface: rc.Reconstruction, truth: trimesh.Trimesh) -> dict[str, float]:
    quality = surface.quality(truth)
    assert quality.truth_to_mesh is not None
    assert quality.mesh_to_truth is not None
    return {
        "triangles": len(surface.mesh.faces),
        "truth_to_mesh": quality.truth_to_mesh.mean,
        "truth_to_mesh_p95": quality.truth_to_mesh.p95,
        "mesh_to_truth": quality.mesh_to_truth.mean,
        "boundary_loops": quality.topology.boundary_loops,
    }
