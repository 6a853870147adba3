"""Folds and self-intersections of both networks' surfaces: for surveys, other kinds of ground, and after changes.

Run as `python -m benchmarks.folds [--quick]`. Every cloud is reconstructed by the growing grid (7,000 units) and by
GSRM (2,200), as the demo does; a row counts pairs of faces that intersect and edges at which the surface doubles back
(`Quality.self_intersections`, `Quality.folds`). Survey seeds 0 to 9 of both pits were used for development; seeds from
10 on and all other kinds of ground are held out, except the real staircase, whose first result (four pairs on the
grid) was fixed as well.
"""

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

import symbrion_gym as sg
from benchmarks.material.changes import make_changes
from benchmarks.material.clouds import DATA, load_stairs, make_far_arena, make_hills
from benchmarks.report import write_results
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.scans.preprocess import preprocess, thin
from symbrion_gym._src.ready_made import RECIPES, SPACING

PITS = (0.40, 0.45)
SEEDS = {0.40: 20, 0.45: 10}
DEVELOPED = 10
"""Survey seeds below this were used for development."""
COURSES: dict[str, sg.Course | sg.StairsCourse] = {
    "pit 0.20 m": sg.Course(pit=0.20),
    "deep pit": sg.Course(pit=0.45, height=0.5),
    "stairs": sg.StairsCourse(),
    "high stairs": sg.StairsCourse(rise=0.12),
}
TERRAIN_SIZE = 6.0
"""Edge of the generated terrain [m]."""
TERRAIN_SEEDS = 5


def run(quick: bool = False) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: one survey per pit, one terrain and one course.
    """
    groups = {
        "surveys": survey_pits(developed=True, quick=quick),
        "held-out surveys": iter(()) if quick else survey_pits(developed=False),
        "held-out ground": make_grounds(quick),
    }
    results: dict[str, Any] = {}
    for group, clouds in groups.items():
        rows = {
            f"{name}, {method}": _count(reconstruct(points, method, units=recipe.units, seed=seed))
            for name, seed, points in clouds
            for method, recipe in RECIPES.items()
        }
        results[group] = rows
        _print_group(group, rows)
    results["changes"] = measure_changes()
    _print_group("changes", results["changes"])
    write_results("folds", results)
    return results


def survey_pits(*, developed: bool, quick: bool = False) -> Iterator[tuple[str, int, np.ndarray]]:
    """Yield name, seed and points of one group of surveys."""
    for pit in PITS:
        seeds = range(1 if quick else DEVELOPED) if developed else range(DEVELOPED, SEEDS[pit])
        for seed in seeds:
            yield f"pit {pit:.2f} m, survey {seed}", seed, survey_course(sg.Course(pit=pit), seed)


def survey_course(course: sg.Course | sg.StairsCourse, seed: int) -> np.ndarray:
    """Return the points of a survey as in the demo, `[N, 3]`."""
    return thin(preprocess(sg.survey(sg.load_arena("truth", course), seed=seed)), SPACING)


def make_grounds(quick: bool = False) -> Iterator[tuple[str, int, np.ndarray]]:
    """Yield name, seed and points of the other kinds of ground."""
    for name, course in list(COURSES.items())[: 1 if quick else None]:
        yield name, 0, survey_course(course, 0)
    for seed in range(1 if quick else TERRAIN_SEEDS):
        yield f"natural terrain {seed}", seed, make_terrain(seed)
    if quick:
        return
    yield "hills", 0, make_hills().points
    yield "far arena", 0, make_far_arena().points
    if DATA.exists():
        yield "stairs scan", 0, load_stairs().points


def make_terrain(seed: int, number: int = 60_000, height: float = 0.15, noise: float = 0.004) -> np.ndarray:
    """Return points on terrain whose height is noise with a spectrum of 1/f², `[number, 3]`.

    Args:
        seed: of terrain and noise.
        number: of points.
        height: standard deviation of the heights [m].
        noise: of the readings [m].
    """
    rng = np.random.default_rng(seed)
    size = 64
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    spectrum = np.fft.fft2(rng.normal(size=(size, size))) / np.maximum(frequency, 1 / size) ** 2
    heights = np.fft.ifft2(spectrum).real
    heights *= height / heights.std()
    place = rng.uniform(0, size - 1, (number, 2))
    low = np.minimum(place.astype(int), size - 2)
    s, t = (place - low).T
    i, j = low.T
    z = (1 - s) * ((1 - t) * heights[i, j] + t * heights[i, j + 1])
    z += s * ((1 - t) * heights[i + 1, j] + t * heights[i + 1, j + 1])
    points = np.column_stack([place * TERRAIN_SIZE / (size - 1), z])
    return points + rng.normal(0, noise, points.shape)


def measure_changes() -> dict[str, dict[str, int]]:
    """Count folds and intersections of surfaces after `refine`."""
    rows = {}
    for name, change in make_changes().items():
        for method, recipe in RECIPES.items():
            old = reconstruct(change.points, method, units=recipe.units)
            rows[f"{name}, {method}"] = _count(old.refine(change.new_points, origins=change.origins))
    return rows


def _count(result: Reconstruction) -> dict[str, int]:
    quality = result.quality()
    return {
        "self_intersections": quality.self_intersections,
        "folds": quality.folds,
        "faces": quality.topology.num_faces,
    }


def _print_group(group: str, rows: dict[str, dict[str, int]]) -> None:
    faulty = {name: row for name, row in rows.items() if row["self_intersections"] or row["folds"]}
    print(f"{group}: {len(rows)} surfaces, {len(faulty)} with folds or self-intersections", flush=True)
    for name, row in faulty.items():
        print(f"  {name}: {row['self_intersections']} pairs, {row['folds']} folds of {row['faces']} faces")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.folds", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one cloud of each kind")
    run(parser.parse_args().quick)


if __name__ == "__main__":
    main()
