"""Fig. 3: the raw and the pre-processed point cloud of the survey, measured after each step."""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float

import reconstruction as rc
import symbrion_gym as sg
from reconstruction._src.surfaces.quality import find_distances
from symbrion_gym._src.ready_made import SPACING

LOG, CLOUD = "survey.npz", "cloud.ply"


def survey_arena(
    arena: str | sg.Arena, folder: Path, prefix: str, seed: int, progress: rc.Progress
) -> tuple[rc.ScanLog, Float[np.ndarray, "N 3"]]:
    """Scan an arena, pre-process and thin; return the scan log and the points, and save both in the folder.

    Args:
        arena: the scanned arena, or its name.
        folder: the folder in which both are saved.
        prefix: prefix of the file names.
        seed: seed of the survey.
        progress: called with a message and the share that is done.

    Raises:
        ScanError: the survey cannot be pre-processed.
    """
    log = sg.survey(arena, seed=seed, progress=progress)
    log.save(folder / f"{prefix}{LOG}")
    points = rc.thin(rc.preprocess(log), SPACING)
    rc.save_points(folder / f"{prefix}{CLOUD}", points)
    return log, points


def measure_cloud(folder: Path, seed: int, progress: rc.Progress = rc.silent) -> dict[str, Any]:
    """Survey the true arena, and measure the points after each step of pre-processing.

    Args:
        folder: the folder in which scan log and points are saved.
        seed: seed of the survey.
        progress: called with a message and the share that is done.

    Returns:
        `scans`, `beams`; `steps`: rows with `step`, `readings` and the distance of the readings within the
        bounding box of the arena from the true surface, `mean` and `p95` [m]; `mixed`: the number of beams that mix
        two surfaces, of the others, and how many of each were removed; `localisation`: as `ScanLog.report`.

    Raises:
        ScanError: the survey cannot be pre-processed.
    """
    truth = sg.load_arena("truth").surface
    log, points = survey_arena("truth", folder, "", seed, progress)
    progress("measuring the steps", 0.9)
    leveled = rc.level_floor(log)
    filtered = rc.remove_mixed_pixels(leveled)
    stages = {
        "raw": log.points(),
        "floor leveled": leveled.points(),
        "mixed pixels removed": filtered.points(),
        "ranges smoothed": rc.smooth_ranges(filtered).points(),
        "cropped to the arena": rc.preprocess(log),
        f"thinned to {1000 * SPACING:.0f} mm": points,
    }
    return {
        "scans": log.ranges.shape[0],
        "beams": log.ranges.shape[1],
        "steps": [
            {"step": name, "readings": len(cloud), **_measure(cloud, truth, log.box)}
            for name, cloud in stages.items()
        ],
        "mixed": _count_mixed(log, leveled.is_valid & ~filtered.is_valid),
        "localisation": log.report,
    }


def find_removed(log: rc.ScanLog) -> Float[np.ndarray, "N 3"]:
    """Return the readings that the filter removes as mixed pixels, at their places in the raw scan log [m]."""
    leveled = rc.level_floor(log)
    return log.grid()[leveled.is_valid & ~rc.remove_mixed_pixels(leveled).is_valid]


def _measure(
    points: Float[np.ndarray, "N 3"], truth: trimesh.Trimesh, box: Float[np.ndarray, "2 3"] | None
) -> dict[str, float]:
    if box is not None:
        points = rc.crop(points, box)
    distances = find_distances(points, truth.vertices, truth.faces)
    return {"mean": float(distances.mean()), "p95": float(np.percentile(distances, 95))}


def _count_mixed(log: rc.ScanLog, is_removed: Bool[np.ndarray, "scans beams"]) -> dict[str, int]:
    if log.truth is None:
        return {}
    is_mixed = log.truth.is_mixed & log.is_valid
    return {
        "mixed": int(is_mixed.sum()),
        "mixed_removed": int((is_mixed & is_removed).sum()),
        "others": int((log.is_valid & ~is_mixed).sum()),
        "others_removed": int((log.is_valid & ~is_mixed & is_removed).sum()),
    }
