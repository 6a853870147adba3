"""Features found on scans, compared with the truth: edges of the pit, start, width, heading; the truth only judges.

`python -m benchmarks.features [--quick]`
"""

import argparse
from collections.abc import Iterator
from itertools import product

import numpy as np
import trimesh

from benchmarks.material.bare_surfaces import make_bare
from benchmarks.report import write_results
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import preprocess, thin
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.loading import load_arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.ready_made import RECIPES, SPACING
from symbrion_gym._src.sensing.survey import survey
from symbrion_gym._src.tasks.features.gap import Gap, find_gap

PITS = (0.45, 0.40, 0.35, 0.30, 0.25)
"""Widths of the pit [m]."""
HEADINGS = (0.0, 20.0, -65.0, 90.0, 137.0)
"""Angles by which the scanned surfaces are turned [deg]."""
_MOVE = (3.0, -2.0)
"""Where the turned surfaces lie [m]."""
_JUDGED = ("width_mm", "start_mm", "floor_mm", "heading_deg", "way_width_mm")
"""Errors whose largest value is reported."""


def make_surfaces(pit: float, seed: int) -> Iterator[tuple[str, trimesh.Trimesh]]:
    """Survey the course with a pit of this width [m] and yield the surfaces of both networks."""
    log = survey(load_arena("truth", Course(pit=pit)), seed=seed)
    points = thin(preprocess(log), SPACING)
    for method, recipe in RECIPES.items():
        yield method, reconstruct(points, method=recipe.method, units=recipe.units, seed=seed).mesh


def judge(gap: Gap, pit: float, yaw: float) -> dict[str, float]:
    """Return errors of a gap against the true course, turned by `yaw` [rad] and moved: [mm] and [deg]."""
    along, direction = np.array([np.cos(yaw), np.sin(yaw)]), np.array(gap.way.direction)
    sign = float(np.sign(along @ direction))

    def find_error(s: float, true: float) -> float:
        return float(1000 * ((np.array(gap.way.place(s)) - _MOVE) @ along * sign - true))

    return {
        "near_mm": find_error(gap.near, -pit / 2),
        "far_mm": find_error(gap.far, pit / 2),
        "width_mm": 1000 * (gap.width - pit),
        "start_mm": find_error(gap.start, -Course(pit=pit).ramp_feet[1]),
        "floor_mm": 1000 * gap.floor,
        "heading_deg": float(np.degrees(np.arccos(min(1.0, abs(along @ direction))))),
        "way_width_mm": 1000 * (gap.way.width - Course().width),
        "confidence": gap.confidence,
    }


def run(quick: bool = False) -> dict:
    """Measure every pit, seed and heading, print and write results/features.json."""
    rows = []
    for pit, seed in product(PITS[:1] if quick else PITS, range(1 if quick else 2)):
        for method, surface in make_surfaces(pit, seed):
            for degrees in HEADINGS:
                case = {"method": method, "pit": pit, "seed": seed, "heading": degrees}
                try:
                    gap = find_gap(make_bare(surface, np.radians(degrees), _MOVE))
                    rows.append(case | {"is_found": True} | judge(gap, pit, np.radians(degrees)))
                except TaskError as reason:
                    rows.append(case | {"is_found": False, "reason": str(reason)})
    summary = {method: summarize([row for row in rows if row["method"] == method]) for method in RECIPES}
    for method, figures in summary.items():
        print(method, "  ".join(f"{name} {value:.3g}" for name, value in figures.items()))
    results = {"edges": summary, "rows": rows}
    if not quick:
        write_results("features", results)
    return results


def summarize(rows: list[dict]) -> dict[str, float]:
    """Return the number of gaps, of those found, and median and largest errors."""
    found = [row for row in rows if row["is_found"]]
    edges = np.abs([[row["near_mm"], row["far_mm"]] for row in found])
    worst = {name: float(np.abs([row[name] for row in found]).max()) for name in _JUDGED}
    return {
        "gaps": len(rows),
        "found": len(found),
        "edge_median_mm": float(np.median(edges)),
        "edge_max_mm": float(edges.max()),
        **{f"{name}_max": value for name, value in worst.items()},
        "confidence_min": min(row["confidence"] for row in found),
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one survey, nothing written")
    run(parser.parse_args().quick)
