"""Scans: the survey's accuracy after every step, a real raw scan, speed and memory.

`python -m benchmarks.scans [--quick] [--pictures FOLDER]`
"""

import argparse
import statistics
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np
import trimesh
from scipy.spatial import cKDTree

from benchmarks.material.survey_noise import measure_noise
from benchmarks.report import write_results
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.scans.leveling import level_floor
from reconstruction._src.scans.preprocess import preprocess, remove_mixed_pixels, thin
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.scan_log_file import load_scan_log
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.sensing.survey import SurveyRobot, make_path, survey
from symbrion_gym._src.sensing.survey_world import SurveyWorld

REAL_SCAN = Path(__file__).parents[2] / "shared" / "data" / "3dtk_scan000.3d"
FAR = 0.03
"""A point farther than this from the surface counts as an error [m]."""
VOXEL = 0.015
"""Thinning for the coverage [m]."""


def measure_survey(seed: int, surface: trimesh.Trimesh) -> dict[str, float]:
    """Survey the arena and compare the points with the true surface, step by step."""
    log = survey(surface, seed=seed)
    levelled = level_floor(log)
    points = preprocess(log)
    assert log.truth is not None
    in_box, is_mixed = find_in_box(levelled), log.truth.is_mixed
    kept = remove_mixed_pixels(log).is_valid
    raw, level = (
        find_distances(log.grid()[find_in_box(log)], surface),
        find_distances(levelled.grid()[in_box], surface),
    )
    clean = find_distances(points, surface)
    after, shift = find_shaking(levelled), find_shifts(levelled)
    truth = trimesh.sample.sample_surface(surface, 20_000, seed=0)[0]
    thinned = thin(points, VOXEL)
    return {
        "scans": len(log.ranges),
        "points": len(points),
        "points_thinned": len(thinned),
        "far_before": float(np.mean(raw > FAR)),
        "far_levelled": float(np.mean(level > FAR)),
        "far_after": float(np.mean(clean > FAR)),
        "median_before": float(np.median(raw)),
        "median_after": float(np.median(clean)),
        "mixed": int((is_mixed & in_box).sum()),
        "mixed_removed": float((is_mixed & in_box & ~kept).sum() / (is_mixed & in_box).sum()),
        "others_kept": float((~is_mixed & in_box & kept).sum() / (~is_mixed & in_box).sum()),
        **summarize("in_plane_before_deg", find_lean_angles(log.truth.robot_poses)[0]),
        **summarize("in_plane_after_deg", after[0]),
        **summarize("across_before_deg", find_lean_angles(log.truth.robot_poses)[1]),
        **summarize("across_after_deg", after[1]),
        **summarize("across_before_mm", shift[0]),
        **summarize("across_after_mm", shift[1]),
        "localisation_max": log.report["localization_max"],
        "localisation_median": log.report["localization_median"],
        "localisation_max_deg": log.report["localization_max_deg"],
        "largest_gap": float(cKDTree(thinned).query(truth)[0].max()),
    }


def find_distances(points: np.ndarray, surface: trimesh.Trimesh) -> np.ndarray:
    """Return the distance of every point from the surface [m]."""
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    return np.sqrt(igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)[0])


def find_in_box(log: ScanLog) -> np.ndarray:
    """Return which beams end in the arena's box, with a margin of 0.3 m in height, `[S, B]`."""
    assert log.box is not None
    ends, spare = log.grid(), np.array([0.0, 0.0, 0.3])
    with np.errstate(invalid="ignore"):
        return ((ends >= log.box[0] - spare) & (ends <= log.box[1] + spare)).all(axis=2)


def find_shaking(log: ScanLog) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the poses in roll (in the scan's plane) and in pitch (out of it), each `[S]` [deg]."""
    assert log.truth is not None
    return find_lean_angles(np.linalg.inv(log.truth.robot_poses) @ log.poses @ np.linalg.inv(log.mount))


def find_lean_angles(robot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the absolute roll and pitch of the robot, each `[S]` [deg]."""
    roll = np.degrees(np.abs(np.arctan2(robot[:, 2, 1], robot[:, 2, 2])))
    return roll, np.degrees(np.abs(np.arcsin(np.clip(robot[:, 2, 0], -1, 1))))


def find_shifts(levelled: ScanLog) -> tuple[np.ndarray, np.ndarray]:
    """How far points on the arena lie off their place across the scan's plane, for its pitch: taken as 0, and as found.

    Returns two arrays `[N]` [mm].
    """
    assert levelled.truth is not None
    assert levelled.box is not None
    scan, beam = np.nonzero(find_in_box(levelled))
    height = levelled.grid()[scan, beam, 2] - levelled.box[0, 2]
    pitches = find_lean_angles(levelled.truth.robot_poses)[1], find_shaking(levelled)[1]
    before, after = (1000 * height * np.sin(np.radians(pitch))[scan] for pitch in pitches)
    return before, after


def summarize(name: str, values: np.ndarray) -> dict[str, float]:
    """Return root mean square, 95th percentile and maximum of the values."""
    size = np.abs(values)
    return {
        f"{name}_rms": float(np.sqrt(np.mean(size**2))),
        f"{name}_p95": float(np.quantile(size, 0.95)),
        f"{name}_max": float(size.max()),
    }


def measure_real_scan(path: Path) -> dict[str, float]:
    """Count removed veils (steps over 10 cm in the same direction to both neighbors) and other removed beams."""
    log = load_scan_log(path)
    step = np.diff(log.ranges, axis=1)
    before, after = step[:, :-1], step[:, 1:]
    is_veil = np.zeros(log.ranges.shape, bool)
    is_veil[:, 1:-1] = (np.abs(before) > 0.1) & (np.abs(after) > 0.1) & (before * after > 0)
    kept, others = remove_mixed_pixels(log).is_valid, log.is_valid & ~is_veil
    return {
        "beams": int(log.is_valid.sum()),
        "veils": int(is_veil.sum()),
        "veils_removed": float((is_veil & ~kept).sum() / is_veil.sum()),
        "others_kept": float((others & kept).sum() / others.sum()),
    }


def measure_speed(surface: trimesh.Trimesh, repeats: int) -> dict[str, float]:
    """Measure the time of preprocessing a million beams and a million points, and of casting 100,000 beams."""
    robot = SurveyRobot()
    log = survey(surface, path=[[-1, 1.6], [1, 3.6], [3, 1.6]], seed=0)
    rows = np.resize(np.arange(len(log.ranges)), 1 + 1_000_000 // log.ranges.shape[1])
    million = ScanLog(log.ranges[rows], log.angles, log.poses[rows], mount=log.mount)
    rng = np.random.default_rng(0)
    cloud = np.resize(log.points(), (1_000_000, 3)) + rng.normal(0, 0.003, (1_000_000, 3))
    world = SurveyWorld(surface, make_path(np.asarray(surface.bounds)))
    assert log.truth is not None
    poses = np.resize(log.truth.robot_poses, (277, 4, 4)) @ robot.vertical_mount

    def cast() -> None:
        for pose in poses:
            robot.scanner.scan(world.cast_on_arena, pose, rng)

    tracemalloc.start()
    preprocess(million)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return {
        **measure("preprocess_million_beams", lambda: preprocess(million), repeats),
        **measure("preprocess_million_points", lambda: preprocess(cloud), repeats),
        **measure("cast_100k_beams", cast, repeats),
        "preprocess_peak_mb": peak / 1e6,
    }


def measure(name: str, work: Callable[[], object], repeats: int) -> dict[str, float]:
    """Return the median wall time and processor time [s]; the latter does not depend on other processes."""
    clock, processor = [], []
    for _ in range(repeats):
        start = time.perf_counter(), time.process_time()
        work()
        clock.append(time.perf_counter() - start[0])
        processor.append(time.process_time() - start[1])
    return {f"{name}_s": statistics.median(clock), f"{name}_cpu_s": statistics.median(processor)}


def draw_real_scan(path: Path, picture: Path) -> None:
    """Draw a raw scan from above: before, after, and what is removed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    log = load_scan_log(path)
    kept = remove_mixed_pixels(log).is_valid
    ends = log.grid()
    figure, axes = plt.subplots(1, 3, figsize=(18, 9), sharex=True, sharey=True)
    parts = {"before": log.is_valid, "after": kept, "removed": log.is_valid & ~kept}
    for axis, (name, which) in zip(axes, parts.items(), strict=True):
        axis.scatter(ends[which][:, 1], ends[which][:, 0], s=0.3, c=ends[which][:, 2], vmin=-1, vmax=2, lw=0)
        axis.set(title=f"{name}: {which.sum()} beams", aspect="equal", xlim=(5, -5), ylim=(0, 12))
    figure.tight_layout()
    with write_atomically(picture) as temporary:
        figure.savefig(temporary, dpi=90)
    plt.close(figure)


def run(quick: bool = False, pictures: Path | None = None) -> dict:
    """Measure everything, print tables and write results/scans.json."""
    surface = Course().surface()
    seeds = [measure_survey(seed, surface) for seed in range(1 if quick else 5)]
    print(f"{'survey of truth, by seed':26s}" + "".join(f"{seed:>12d}" for seed in range(len(seeds))))
    for name in seeds[0]:
        print(f"{name:26s}" + "".join(f"{row[name]:12.5g}" for row in seeds))
    results: dict = {"survey": seeds, "speed": measure_speed(surface, 1 if quick else 5)}
    results["noise"] = measure_noise(surface, quick)
    for row in results["noise"]:
        print("noise x {noise:g}, priors {priors}:".format(**row), end=" ")
        print("{localization_max:.4f} m {localization_max_deg:.3f} deg".format(**row), end=", median ")
        print("{localization_median:.4f} m {localization_median_deg:.4f} deg".format(**row))
    if REAL_SCAN.exists():
        results["real_scan"] = measure_real_scan(REAL_SCAN)
        if pictures:
            pictures.mkdir(parents=True, exist_ok=True)
            draw_real_scan(REAL_SCAN, pictures / "real_scan.png")
    else:
        print("the real scan in ../shared/data is missing: left out")
    for part in ("speed", "real_scan"):
        for name, value in results.get(part, {}).items():
            print(f"{part:12s}{name:32s}{value:12.5g}")
    if not quick:
        write_results("scans", results)
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed, one repetition, nothing written")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the real scan")
    arguments = parser.parse_args()
    run(arguments.quick, arguments.pictures)
