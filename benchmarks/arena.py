"""The arena: accuracy and cost of contact pieces, and their influence on robots.

python -m benchmarks.arena [--quick] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from benchmarks.material.arena_drives import OutcomeComparison, drive_waves, time_steps
from benchmarks.material.arena_surfaces import (
    MAIN,
    RESOLUTIONS,
    load_bunny,
    make_other_profiles,
    map_stairs,
    scan_course,
    turn,
)
from benchmarks.material.ray_casts import compare_with_embree, measure_scans
from benchmarks.material.sleds import compare_pulled
from benchmarks.report import load_record, write_results
from reconstruction._src.geometry.mesh_repair import repair_mesh
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.loading import load_arena
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.arenas.scanned_surface import cut_irregular, make_scanned_surface
from symbrion_gym._src.contact.decomposition import decompose
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.contact.solid import close_downwards
from symbrion_gym._src.contact.surface_error import measure_arena

_PIT = Course().pit
_EASY_PIT = 0.30
"""Width of a pit that some random controllers cross and some do not [m]."""
Rows = dict[str, dict[str, Any]]


def run(quick: bool = False, only: tuple[str, ...] = ()) -> dict:
    """Run the parts and return what they measured; parts left out keep their last results.

    Args:
        quick: fewer controllers, rounds and rows.
        only: names of parts; all by default.
    """
    for name, part in PARTS.items():
        if only and name not in only:
            continue
        begin = time.perf_counter()
        print(f"{name} ...", flush=True)
        write_results("arena", part(quick))
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)
    return load_record("arena")["results"]


def measure_accuracy(quick: bool) -> dict:
    """Measure the distance of contact pieces from the true surface, their number and the time to make them."""
    truth, rows = Course().surface(), {}
    for name in MAIN:
        mesh, yaw = scan_course(_PIT, name), np.radians(20)
        _compare_with_truth(rows, name, make_arena(mesh, cache=False), truth, mesh)
        turned = cut_irregular(mesh, yaw)
        _compare_with_truth(
            rows, f"{name}, yawed and cut", make_arena(turned, cache=False), turn(truth, yaw), turned
        )
    for name, profile in make_other_profiles().items():
        mesh = turn(make_scanned_surface(profile, num_vertices=2200), -0.6)
        exact = turn(make_scanned_surface(profile, num_vertices=20000, noise=0.0), -0.6)
        _compare_with_truth(rows, name, make_arena(mesh, cache=False), exact, mesh)
    stairs = map_stairs()
    if stairs is not None:
        _compare_with_truth(
            rows, "real staircase, own surface", make_arena(stairs, cache=False), stairs, stairs
        )
    bunny = load_bunny()
    if bunny is not None:
        made = make_arena(bunny, cache=False)
        _record(rows, "bunny, own surface", made, made.quality)
    if not quick:
        mesh = scan_course(_PIT, "gsrm 2200")
        begin = time.perf_counter()
        pieces = decompose(close_downwards(repair_mesh(mesh), 0.2), 0.05, time_limit=300)
        seconds = time.perf_counter() - begin
        made = make_arena(mesh)
        naive = replace(made, pieces=pieces, quality=replace(made.quality, seconds=seconds))
        _compare_with_truth(rows, "naive coacd 0.05", naive, truth, mesh)
    return {"accuracy": rows}


def measure_steps(quick: bool) -> dict:
    """Measure the time of a physics step of one snake under one sequence of controls."""
    mesh, course = scan_course(_PIT, "gsrm 2200"), Course()
    arenas = {"boxes": Arena.from_course(course)}
    arenas |= {name: make_arena(scan_course(_PIT, name)) for name in MAIN}
    for kind in ("primitives", "hfield"):
        arenas[kind] = make_arena(mesh, kind=kind)
    return {"steps_us": _show_one(time_steps(arenas, 100 if quick else 600))}


def measure_seams(quick: bool) -> dict:
    """Measure jumps and losses of speed of a sled and a wheel pulled over the seams."""
    course = Course()
    truth = Arena.from_course(course)
    arenas = {"truth moved by 1 mm along": _move(truth, [0.001, 0.0, 0.0])}
    arenas |= {name: make_arena(scan_course(_PIT, name)) for name in MAIN}
    for name in ("gsrm", "gg"):
        arenas[f"ready-made {name}"] = ready = load_arena(name)
        arenas[f"ready-made {name}, made again"] = make_arena(ready.surface)
    if not quick:
        mesh = arenas["ready-made gsrm"].surface
        arenas["exact triangles of ready-made gsrm"] = make_arena(mesh, kind="prisms")
    found = compare_pulled(truth, course, arenas)
    for rows in found.values():
        _show(rows)
    return found


def measure_outcomes(quick: bool) -> dict:
    """Compare outcome and progress of random controllers in every kind of contact with the true arena."""
    course = Course(pit=_EASY_PIT)
    truth = Arena.from_course(course)
    moved = _move(truth, [0.0, 0.0, 0.001])
    comparison = OutcomeComparison(truth, 10 if quick else 30)
    rows: Rows = {"truth": comparison.reference, "truth moved by 1 mm": comparison.compare(moved)}
    _show(rows)
    wanted = [("convex", name) for name in RESOLUTIONS]
    if not quick:
        wanted += [(kind, name) for kind in ("primitives", "hfield") for name in RESOLUTIONS]
        wanted += [("prisms", name) for name in ("gsrm 800", "gsrm 2200", "gg 1500")]
    for kind, name in wanted:
        arena = make_arena(scan_course(_EASY_PIT, name), kind=kind)
        label = name if kind == "convex" else f"{name}, {kind}"
        rows[label] = comparison.compare(arena)
        _show({label: rows[label]})
        write_results("arena", {"behaviour": rows})
    return {"behaviour": rows}


def measure_waves(quick: bool) -> dict:
    """Compare the outcome of thirty sensitive controllers, which oscillate, with that in the true arena."""
    course = Course(pit=_EASY_PIT)
    truth = Arena.from_course(course)
    comparison = OutcomeComparison(truth, 30, drive_waves)
    rows: Rows = {"truth": comparison.reference}
    if not quick:
        rows["truth moved by 1 mm"] = comparison.compare(_move(truth, [0.0, 0.0, 0.001]))
    for name in MAIN:
        rows[name] = comparison.compare(make_arena(scan_course(_EASY_PIT, name)))
    _show(rows)
    return {"behaviour_of_waves": rows}


def measure_rays(quick: bool) -> dict:
    """Measure the time of one laser scan with several ray casters, and compare MuJoCo's ranges with Embree's."""
    course, mesh = Course(), scan_course(_PIT, "gg")
    arenas = {
        "gg": make_arena(mesh),
        "hfield": make_arena(mesh, kind="hfield"),
        "hand-made": load_arena("simple"),
        "boxes": Arena.from_course(course),
    }
    rows = measure_scans(arenas, "gg", quick)
    _show(rows)
    return {"scans": rows, "random_rays": _show_one(compare_with_embree(arenas["gg"]))}


PARTS: dict[str, Callable[[bool], dict]] = {
    "accuracy": measure_accuracy,
    "steps": measure_steps,
    "seams": measure_seams,
    "rays": measure_rays,
    "behaviour": measure_outcomes,
    "waves": measure_waves,
}


def _move(arena: Arena, by: list[float]) -> Arena:
    return replace(arena, pieces=[piece.copy().apply_translation(by) for piece in arena.pieces])


def _compare_with_truth(
    rows: Rows, name: str, arena: Arena, truth: trimesh.Trimesh, region: trimesh.Trimesh
) -> None:
    """Record distances from the true surface [mm], number of pieces and time."""
    _record(rows, name, arena, measure_arena(arena.pieces, truth, region=region))


def _record(rows: Rows, name: str, arena: Arena, quality: ArenaQuality) -> None:
    rows[name] = {
        "pieces": quality.num_pieces,
        "mean_mm": 1e3 * quality.mean,
        "p95_mm": 1e3 * quality.p95,
        "uncovered": quality.uncovered,
        "seconds": arena.quality.seconds,
    }
    _show({name: rows[name]})


def _show(rows: Rows) -> None:
    for name, row in rows.items():
        values = (
            f"{key} {value if isinstance(value, list) else f'{value:.4g}'}" for key, value in row.items()
        )
        print(f"  {name:32s}", "  ".join(values), flush=True)


def _show_one(row: dict) -> dict:
    _show({"": row})
    return row


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="fewer controllers, rounds and rows")
    parser.add_argument("--only", nargs="+", default=[], choices=PARTS, help="parts to run (default: all)")
    options = parser.parse_args()
    run(options.quick, tuple(options.only))
