"""Updating a reconstruction after a change: cost relative to a new reconstruction, and effect on unchanged parts.

Run as `python -m benchmarks.refine [--quick] [--only SIZE]`. Ratios are medians of five pairs of runs, `refine` and new
reconstruction alternating, of wall and of processor time. The new reconstruction that is timed learns from a complete
new scan with as many readings as the first, evenly distributed, which is the fastest case. (The points known after
`refine` are denser where new readings were made; growing from them may take longer.) The new reconstruction whose
accuracy is reported learns from the points known after `refine`.
Distances in millimeters. Drift: the largest distance between old and new mesh, farther than two unit spacings from
everything that changed. Seven changes come with a tenth as many new readings as the first scan has; a removed object
without new readings in its place shows only in a complete new scan: "scanned anew". In "wall moved" the far wall of the
pit has moved away by 5 cm.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh

from benchmarks.material.changes import NUM_POINTS, Change, draw, make_changes, make_surface
from benchmarks.report import write_results
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.surfaces.quality import find_distances
from symbrion_gym._src.arenas.course import Course

SIZES: dict[str, tuple[str, dict[str, Any]]] = {
    "gsrm 2200": ("gsrm", {"units": 2200}),
    "gsrm 800": ("gsrm", {"units": 800}),
    "gg 13860": ("gg", {"triangles": 13860}),
}
REPEATS = 5
IN_A_ROW = 10


def run(quick: bool = False, only: str | None = None) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: one pair of runs instead of five, and no run of ten.
        only: the one size to run; then nothing is written.
    """
    changes, results = make_changes(), {}
    in_a_row: dict[str, Any] = {}
    for size, (method, options) in SIZES.items():
        if only not in (None, size):
            continue
        results[size], results[f"{size}, scanned anew"] = {}, {}
        for name, change in changes.items():
            row = measure_change(change, method, options, 1 if quick else REPEATS)
            is_whole = len(change.new_points) > NUM_POINTS / 2
            results[f"{size}, scanned anew" if is_whole else size][name] = row
            _print_row(f"{size}, {name}", row)
        if not quick:
            in_a_row[size] = measure_row(method, options)
            print(f"{size}, ten in a row: {in_a_row[size]}", flush=True)
    results["ten in a row"] = in_a_row
    if only is None:
        write_results("refine", results)
    return results


def measure_change(change: Change, method: str, options: dict[str, Any], repeats: int) -> dict[str, Any]:
    """Measure one scenario."""
    old = reconstruct(change.points, method, **options)
    scan = draw(change.new, NUM_POINTS, len(change.points))
    refined = old.refine(change.new_points, origins=change.origins)
    reconstruct(scan, method, **options)
    times = np.array(
        [
            [
                *_time(lambda seed=seed: old.refine(change.new_points, seed, origins=change.origins)),
                *_time(lambda seed=seed: reconstruct(scan, method, seed=seed, **options)),
            ]
            for seed in range(repeats)
        ]
    )
    fresh = reconstruct(refined.points, method, **options)
    quality = refined.quality()
    topology = quality.topology
    return {
        "ratio": float(np.median(times[:, 0] / times[:, 2])),
        "cpu_ratio": float(np.median(times[:, 1] / times[:, 3])),
        "seconds": float(np.median(times[:, 0])),
        "before": _measure(old, change.new),
        "after": _measure(refined, change.new),
        "fresh": _measure(fresh, change.new),
        "drift": _summarize(measure_drift(change, old.mesh, refined.mesh)),
        "units": [len(old.mesh.vertices), len(refined.mesh.vertices)],
        "loops": topology.boundary_loops,
        "euler_number": topology.euler_number,
        "manifold": topology.is_manifold,
        "self_intersections": quality.self_intersections,
        "folds": quality.folds,
    }


def measure_drift(change: Change, old: trimesh.Trimesh, new: trimesh.Trimesh) -> np.ndarray:
    """Return the distances of unchanged places of either mesh from the other [m].

    Unchanged means farther than two unit spacings of the old mesh from everything that changed.
    """
    spacing = float(np.sqrt(old.area / len(old.vertices) * 2 / np.sqrt(3)))
    found = []
    for one, other in ((old, new), (new, old)):
        places = sample_area(np.asarray(one.vertices), np.asarray(one.faces), 100_000)
        places = places[change.measure_remoteness(places) > 2 * spacing]
        found.append(find_distances(places, np.asarray(other.vertices), np.asarray(other.faces)))
    return np.concatenate(found)


def measure_row(method: str, options: dict[str, Any]) -> dict[str, Any]:
    """Refine ten times in a row: a wall moves out and back by 5 cm, with new readings each time."""
    surfaces = [make_surface(Course(), widening=width) for width in (0.05, 0.0)]
    points = draw(surfaces[1], 60_000, 0)
    change = Change(surfaces[1], surfaces[0], points, points)
    current = old = reconstruct(points, method, **options)
    first = _measure(current, surfaces[1])
    for turn in range(IN_A_ROW):
        new = draw(surfaces[turn % 2], 6000, 200 + turn, lambda p: np.abs(p[:, 0]) < 0.45)
        current = current.refine(new, seed=turn)
    quality = current.quality()
    topology = quality.topology
    return {
        "before": first,
        "after": _measure(current, surfaces[1]),
        "drift": _summarize(measure_drift(change, old.mesh, current.mesh)),
        "units": len(current.mesh.vertices),
        "loops": topology.boundary_loops,
        "euler_number": topology.euler_number,
        "manifold": topology.is_manifold,
        "self_intersections": quality.self_intersections,
        "folds": quality.folds,
    }


def _summarize(drift: np.ndarray) -> dict[str, float]:
    return {"mean": float(drift.mean()), "p99": float(np.quantile(drift, 0.99)), "max": float(drift.max())}


def _time(call: Callable[[], Any]) -> tuple[float, float]:
    begin, cpu = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - begin, time.process_time() - cpu


def _measure(result: Reconstruction, truth: trimesh.Trimesh) -> dict[str, float]:
    quality = result.quality(truth)
    assert quality.truth_to_mesh is not None
    assert quality.mesh_to_truth is not None
    return {
        "truth_to_mesh": quality.truth_to_mesh.mean,
        "p95": quality.truth_to_mesh.p95,
        "mesh_to_truth": quality.mesh_to_truth.mean,
    }


def _print_row(name: str, row: dict[str, Any]) -> None:
    distances = "  ".join(
        f"{when} {row[when]['truth_to_mesh'] * 1e3:5.2f}/{row[when]['mesh_to_truth'] * 1e3:5.2f}"
        for when in ("before", "after", "fresh")
    )
    sound = "manifold" if row["manifold"] else "NOT MANIFOLD"
    print(
        f"{name:40} ratio {row['ratio']:.2f} cpu {row['cpu_ratio']:.2f}  {distances}  "
        f"drift {row['drift']['max'] * 1e3:.2f}  units {row['units']}  "
        f"loops {row['loops']} euler {row['euler_number']} {sound} "
        f"intersecting {row['self_intersections']} folds {row['folds']}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.refine", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one pair of runs per scenario")
    parser.add_argument("--only", choices=SIZES, help="one size")
    options = parser.parse_args()
    run(options.quick, options.only)


if __name__ == "__main__":
    main()
