"""Colors from readings to surface: error against the true colors, and what they cost.

Run as `python -m benchmarks.color [--quick]`. Courses with a known pattern are surveyed by the robot with its camera;
made scenes are scanned with a camera's noise on the true colors. The judge reads the files of the arena and samples the
true surface (`benchmarks.material.color_judge`). The groups `held-out ...` were looked at once, after all settings.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import symbrion_gym as sg
from benchmarks.material.color_judge import PAINTS, judge
from benchmarks.material.made_scenes import SCENES, MadeScan
from benchmarks.report import write_results
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.preprocess import preprocess
from reconstruction._src.scans.selection import thin
from symbrion_gym._src.arenas.obj_mesh import format_surface
from symbrion_gym._src.arenas.png import to_png
from symbrion_gym._src.arenas.texture import TEXTURE_FILE, make_texture
from symbrion_gym._src.ready_made import RECIPES, SPACING

Courses = dict[str, tuple[sg.Course | sg.StairsCourse, int]]
"""Name -> course and seed of its survey."""
COURSES: Courses = {
    "pit, checker": (sg.Course(color_pattern="checker"), 0),
    "pit, gradient": (sg.Course(color_pattern="gradient"), 1),
}
HELD_OUT_COURSES: Courses = {
    "pit 0.30 m, stripes": (sg.Course(pit=0.30, color_pattern="stripes"), 11),
    "deep pit, checker": (sg.Course(height=0.5, color_pattern="checker"), 12),
    "stairs, gradient": (sg.StairsCourse(color_pattern="gradient"), 13),
    "stairs, checker": (sg.StairsCourse(rise=0.12, color_pattern="checker"), 14),
}
SCENE_PATTERNS = {"room": "checker", "thin walls": "gradient", "rough ground": "stripes"}
HELD_OUT_PATTERNS = {
    "table": "checker",
    "rubble": "gradient",
    "spiral stairs": "gradient",
    "terrain": "stripes",
}
CAMERA_NOISE = 0.02
"""Of a channel of the colors of made scenes, of 1: as that of the survey's camera."""
REPETITIONS = 7


def run(quick: bool = False) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: one course and one scene, fewer repetitions.
    """
    results: dict[str, Any] = {
        "courses": measure_courses(COURSES, quick),
        "cost": measure_cost(3 if quick else REPETITIONS),
    }
    results["scenes"] = measure_scenes(SCENE_PATTERNS, quick)
    if not quick:
        results["held-out courses"] = measure_courses(HELD_OUT_COURSES)
        results["held-out scenes"] = measure_scenes(HELD_OUT_PATTERNS)
    write_results("color", results)
    return results


def measure_courses(courses: Courses, quick: bool = False) -> dict[str, dict[str, float]]:
    """Judge arenas made of surveys with the camera."""
    rows = {}
    for name, (course, seed) in list(courses.items())[: 1 if quick else None]:
        truth = sg.Arena.from_course(course)
        readings = preprocess(sg.survey(truth, seed=seed, camera=True))
        assert isinstance(readings, Cloud)
        for method, recipe in RECIPES.items():
            made = reconstruct(thin(readings, SPACING), method, units=recipe.units, readings=readings)
            arena = sg.make_arena(made, cache=False)
            with tempfile.TemporaryDirectory() as folder:
                arena.save(Path(folder) / "arena")
                row = judge(Path(folder) / "arena", truth.surface, PAINTS[str(course.color_pattern)])
            rows[f"{name}, {method}"] = _report(f"{name}, {method}", row)
    return rows


def measure_scenes(patterns: dict[str, str], quick: bool = False) -> dict[str, dict[str, float]]:
    """Judge surfaces of made scenes, by GSRM at the resolution that it chooses."""
    rows = {}
    for name, pattern in list(patterns.items())[: 1 if quick else None]:
        made = SCENES[name]()
        cloud = color_scan(made, pattern)
        surface = reconstruct(cloud)
        with tempfile.TemporaryDirectory() as folder:
            write_surface(Path(folder), surface)
            row = judge(Path(folder), made.truth, PAINTS[pattern], readings=made.points)
        rows[f"{name}, {pattern}"] = _report(f"{name}, {pattern}", row)
    return rows


def color_scan(made: MadeScan, pattern: str) -> Cloud:
    """Return the readings of a made scene with the colors of the true places behind them, as a camera measures them."""
    import igl

    _, _, places = igl.point_mesh_squared_distance(
        made.points, np.asarray(made.truth.vertices, float), np.asarray(made.truth.faces, np.int64)
    )
    rng = np.random.default_rng(20)
    colors = PAINTS[pattern](places) + rng.normal(0, CAMERA_NOISE, places.shape)
    as_bytes = np.round(255 * np.clip(colors, 0, 1)).astype(np.uint8)
    return Cloud(made.points, as_bytes, made.viewpoints, made.seen_from)


def write_surface(folder: Path, made: Reconstruction) -> None:
    """Write a colored surface as an arena's folder has it."""
    colored = made.colored_readings
    assert colored is not None
    texture = make_texture(made.mesh, colored)
    files = {"surface.obj": format_surface(made.mesh, texture, 6), TEXTURE_FILE: to_png(texture.image)}
    for name, content in files.items():
        with write_atomically(folder / name) as temporary:
            temporary.write_bytes(content)


def measure_cost(repetitions: int) -> dict[str, dict[str, float]]:
    """Compare reconstructions of the same points with and without colors, in turn: medians of processor time."""
    readings = preprocess(sg.survey("truth", seed=0, camera=True))
    assert isinstance(readings, Cloud)
    points, rows = thin(readings, SPACING), {}
    plain, bare = Cloud(points.points), Cloud(readings.points)
    for method, recipe in RECIPES.items():
        tasks: dict[str, Callable[[], Reconstruction]] = {
            "plain": lambda m=method, u=recipe.units: reconstruct(plain, m, units=u),
            "colored": lambda m=method, u=recipe.units: reconstruct(points, m, units=u),
            "plain with readings": lambda m=method, u=recipe.units: reconstruct(
                plain, m, units=u, readings=bare
            ),
            "colored with readings": lambda m=method, u=recipe.units: reconstruct(
                points, m, units=u, readings=readings
            ),
        }
        made = {name: task() for name, task in tasks.items()}  # compiles, too
        times: dict[str, list[float]] = {name: [] for name in tasks}
        for _ in range(repetitions):
            for name, task in tasks.items():
                start = time.process_time()
                task()
                times[name].append(time.process_time() - start)
        cost = {name: float(np.median(values)) for name, values in times.items()}
        same = np.array_equal(made["plain"].mesh.vertices, made["colored"].mesh.vertices)
        rows[method] = (
            cost
            | {
                "share": cost["colored"] / cost["plain"] - 1,
                "share with readings": cost["colored with readings"] / cost["plain with readings"] - 1,
                "equal surfaces": float(same),
            }
            | measure_texture(made["colored with readings"])
        )
        print(f"cost, {method}: {rows[method]}", flush=True)
    return rows


def measure_texture(made: Reconstruction) -> dict[str, float]:
    """Return the processor time of the texture of an arena, and its size."""
    colored = made.colored_readings
    assert colored is not None
    start = time.process_time()
    texture = make_texture(made.mesh, colored)
    return {"texture": time.process_time() - start, "texels": float(texture.image.size // 3)}


def _report(name: str, row: dict[str, float]) -> dict[str, float]:
    print(f"{name}: " + ", ".join(f"{key} {value:.3f}" for key, value in row.items()), flush=True)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.color", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one course and one scene")
    run(parser.parse_args().quick)


if __name__ == "__main__":
    main()
