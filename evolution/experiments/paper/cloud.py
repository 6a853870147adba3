"""Fig. 3: the raw and the pre-processed cloud of the survey, with figures for each step."""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from reconstruction.surfaces.quality import find_distances
from symbrion_gym.ready_made import SPACING

LOG, CLOUD = "survey.npz", "cloud.ply"


def survey_arena(
    arena: Any, folder: Path, prefix: str, seed: int, progress: rc.Progress
) -> tuple[rc.ScanLog, np.ndarray]:
    """Scan an arena, pre-process and thin; return the log and the cloud `[N, 3]`, kept in the folder."""
    log = sg.survey(arena, seed=seed, progress=progress)
    log.save(folder / f"{prefix}{LOG}")
    points = rc.thin(rc.preprocess(log), SPACING)
    rc.save_points(folder / f"{prefix}{CLOUD}", points)
    return log, points


def measure_cloud(folder: Path, seed: int, progress: rc.Progress = rc.silent) -> dict[str, Any]:
    """Survey the true arena, and measure the cloud after each step of the pre-processing.

    Args:
        folder: keeps log and cloud.
        seed: of the survey.
        progress: told how far it is.

    Returns:
        `scans`, `beams`; `steps`: rows with `step`, `readings` and the distance of the readings within the
        arena's box from the true surface, `mean` and `p95` [m]; `mixed`: how many beams mixed two surfaces,
        and how many of those and of the others were removed.
    """
    truth = sg.load_arena("truth").surface
    log, points = survey_arena("truth", folder, "", seed, progress)
    progress("measuring the steps", 0.9)
    levelled = rc.level_floor(log)
    filtered = rc.remove_mixed_pixels(levelled)
    stages = {
        "raw": log.points(),
        "floor levelled": levelled.points(),
        "mixed pixels removed": filtered.points(),
        "ranges smoothed": rc.smooth_ranges(filtered).points(),
        "cut to the arena": rc.preprocess(log),
        f"thinned to {1000 * SPACING:.0f} mm": points,
    }
    return {
        "scans": log.ranges.shape[0],
        "beams": log.ranges.shape[1],
        "steps": [
            {"step": name, "readings": len(cloud), **_measure(cloud, truth, log.box)}
            for name, cloud in stages.items()
        ],
        "mixed": _count_mixed(log, levelled.is_valid & ~filtered.is_valid),
        "localisation": log.report,
    }


def find_removed(log: rc.ScanLog) -> np.ndarray:
    """Return the readings that the filter takes for mixed pixels, `[N, 3]`, as they were in the raw log."""
    levelled = rc.level_floor(log)
    return log.grid()[levelled.is_valid & ~rc.remove_mixed_pixels(levelled).is_valid]


def _measure(points: np.ndarray, truth: trimesh.Trimesh, box: np.ndarray | None) -> dict[str, float]:
    if box is not None:
        points = rc.crop(points, box)
    distances = find_distances(points, truth.vertices, truth.faces)
    return {"mean": float(distances.mean()), "p95": float(np.percentile(distances, 95))}


def _count_mixed(log: rc.ScanLog, is_removed: np.ndarray) -> dict[str, int]:
    if log.truth is None:
        return {}
    is_mixed = log.truth.is_mixed & log.is_valid
    return {
        "mixed": int(is_mixed.sum()),
        "mixed_removed": int((is_mixed & is_removed).sum()),
        "others": int((log.is_valid & ~is_mixed).sum()),
        "others_removed": int((log.is_valid & ~is_mixed & is_removed).sum()),
    }
