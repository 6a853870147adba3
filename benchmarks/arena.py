"""The arena: how closely contact pieces follow the truth, and whether robots notice.

Run as `python -m benchmarks.arena [--quick]`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.arena_behaviour import compare, compare_sleds, time_steps
from benchmarks.report import write_results
from reconstruction.reconstruct import reconstruct
from reconstruction.scans.formats import load_points
from symbrion_gym.arenas.arena import Arena, make_arena
from symbrion_gym.arenas.course import Course, StairsCourse
from symbrion_gym.arenas.quality import measure_arena
from symbrion_gym.arenas.scanned_surface import cut_irregular, make_scanned_surface
from symbrion_gym.pieces.decomposition import decompose
from symbrion_gym.pieces.mesh_repair import repair_mesh
from symbrion_gym.pieces.solid import close_downwards

STAIRS = Path(__file__).resolve().parents[2] / "shared" / "data" / "octomap_stairs_scan.dat.bz2"
SLANTED_PIT = [(-3, 0), (-1.7, 0), (-0.7, 0.25), (-0.3, 0.25), (-0.1, 0), (0.15, 0), (0.3, 0.25), (0.7, 0.25)]
SLANTED_PIT += [(1.7, 0), (3, 0)]
SURFACES = {"gsrm 800": ("gsrm", 800), "gsrm 2200": ("gsrm", 2200), "gg": ("gg", 7000)}


def run(quick: bool = False) -> dict:
    """Measure; `quick` leaves out the naive decomposition and most controllers."""
    course = Course()
    truth = course.surface()
    points = scan(truth)
    surfaces = {
        name: reconstruct(points, method, units=units).mesh for name, (method, units) in SURFACES.items()
    }
    rows, arenas = {}, {}
    for name, mesh in surfaces.items():
        arenas[name] = make_arena(mesh, course=course, cache=False, name=name)
        rows[name] = judge(arenas[name], truth, mesh)
        yaw = np.radians(20)
        turned = cut_irregular(mesh, yaw)
        rows[f"{name}, yawed and cut"] = judge(make_arena(turned, cache=False), turn(truth, yaw), turned)
    for name, profile in make_other_profiles().items():
        mesh = turn(make_scanned_surface(profile, num_vertices=2200), -0.6)
        exact = turn(make_scanned_surface(profile, num_vertices=20000, noise=0.0), -0.6)
        rows[name] = judge(make_arena(mesh, cache=False), exact, mesh)
    if STAIRS.is_file():
        mesh = reconstruct(crop_stairs(load_points(STAIRS)), units=2200).mesh
        rows["real staircase, own surface"] = judge(make_arena(mesh, cache=False), mesh, mesh)
    mesh = surfaces["gsrm 2200"]
    if not quick:
        rows["naive coacd 0.05"] = judge(make_naive(mesh), truth, mesh)
    print_table(rows)
    kinds = {
        kind: make_arena(mesh, kind=kind, course=course, cache=False) for kind in ("primitives", "hfield")
    }
    results = {
        "accuracy": rows,
        "steps_us": time_steps({"boxes": Arena.from_course(course), **arenas, **kinds}, 300),
    }
    print(results["steps_us"])
    results["sled"] = compare_sleds(Arena.from_course(course), arenas)
    print_table(results["sled"])
    results["behaviour"] = measure_behaviour(quick)
    print_table(results["behaviour"])
    write_results("arena", results)
    return results


def scan(surface: trimesh.Trimesh, count: int = 60_000, noise: float = 0.005, seed: int = 0) -> np.ndarray:
    """Points strewn over a surface, with noise [m]."""
    points, _ = trimesh.sample.sample_surface(surface, count, seed=seed)
    return np.asarray(points) + np.random.default_rng(seed).normal(scale=noise, size=(count, 3))


def judge(arena: Arena, truth: trimesh.Trimesh, region: trimesh.Trimesh) -> dict:
    """Distances of the contact pieces from the truth [mm], their number and the time they took."""
    quality = measure_arena(arena.pieces, truth, region=region)
    return {
        "pieces": quality.num_pieces,
        "mean_mm": 1e3 * quality.mean,
        "p95_mm": 1e3 * quality.p95,
        "uncovered": quality.uncovered,
        "seconds": arena.quality.seconds,
    }


def measure_behaviour(quick: bool) -> dict:
    """Crossing of random controllers: a pit of 0.30 m, which some of them cross."""
    course = Course(pit=0.30)
    points = scan(course.surface())
    arenas = {}
    for name, (method, units) in SURFACES.items():
        mesh = reconstruct(points, method, units=units).mesh
        arenas[name] = make_arena(mesh, course=course, cache=False)
        if name == "gsrm 2200" and not quick:
            for kind in ("primitives", "hfield", "prisms"):
                arenas[f"{name}, {kind}"] = make_arena(mesh, course=course, kind=kind, cache=False)
    truth = Arena.from_course(course)
    moved = [piece.copy().apply_translation([0, 0, 0.001]) for piece in truth.pieces]
    arenas["truth moved by 1 mm"] = replace(truth, pieces=moved)
    return compare(truth, arenas, 10 if quick else 30, 15.0 if quick else 40.0)


def make_other_profiles() -> dict[str, np.ndarray]:
    """Profiles that are not the course: a slanted pit, a hump, steps."""
    x = np.linspace(-0.5, 0.5, 60)
    hump = [(-2.5, 0), *zip(x, 0.1 * (1 + np.cos(2 * np.pi * x)), strict=True), (2.5, 0)]
    steps = StairsCourse(rise=0.1).profile()
    return {"slanted pit": np.array(SLANTED_PIT), "hump": np.array(hump), "steps": steps}


def make_naive(mesh: trimesh.Trimesh) -> Arena:
    """What anybody would do first: close the mesh and hand it to coacd."""
    made = make_arena(mesh, cache=False)
    pieces = decompose(close_downwards(repair_mesh(mesh), 0.2), 0.05, time_limit=300)
    return replace(made, pieces=pieces)


def crop_stairs(points: np.ndarray) -> np.ndarray:
    """The stairs of the scan (see the data's README)."""
    low, high = np.array([0.4, -4.3, -np.inf]), np.array([9.6, 1.4, 2.0])
    return points[((points > low) & (points < high)).all(axis=1)]


def turn(mesh: trimesh.Trimesh, yaw: float) -> trimesh.Trimesh:
    """A copy turned about z [rad]."""
    return mesh.copy().apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))


def print_table(rows: dict[str, dict]) -> None:
    """Print rows of names and figures."""
    for name, row in rows.items():
        print(f"{name:32s}", "  ".join(f"{key} {value:.4g}" for key, value in row.items()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer controllers, no naive decomposition")
    run(parser.parse_args().quick)
