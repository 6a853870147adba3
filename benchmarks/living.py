"""Arenas and models that follow a place that changes: contact made again only where it changed, and a robot's round.

Run as `python -m benchmarks.living [--quick] [--only arenas|live] [--seeds 0 1 2]`. "live" runs `symbrion live` for
seeds that nothing was tuned on (1 and 2), besides 0. "arenas" updates arenas after changes of the course (those of
`benchmarks.refine`, and a held-out course with a box elsewhere), and of a made room: processor time relative to a new
arena, pieces that stay, and distances.
"""

import argparse
import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from benchmarks.material import changes as material
from benchmarks.report import describe_moment, load_record, write_results
from symbrion_gym._src.contact.local_changes import find_local_changes, measure_gaps, sample_faces

HELD_OUT = (sg.Course(width=1.6, pit=0.35), (-2.6, -2.35, -0.5, -0.1, 0.2), 11)
"""Course, box and seed that nothing was tuned on."""
CHANGES = ("agreeing", "wall moved", "box new", "box gone, rays", "box gone, readings", "extended")
REPEATS = 3
SEEDS = (0, 1, 2)


def run(quick: bool = False, only: str | None = None, seeds: tuple[int, ...] = SEEDS) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: one repetition, one seed, few genotypes.
        only: the one part to measure.
        seeds: of the rounds; those that were measured of the same commit stay.
    """
    if only in (None, "live"):
        for seed in seeds[:1] if quick else seeds:
            row = measure_live(seed, quick)
            print(f"live, seed {seed}: {row}", flush=True)
            write_results("living", {"live": _find_rows() | {str(seed): row}})
    if only in (None, "arenas"):
        write_results("living", measure_arenas(1 if quick else REPEATS))
    return load_record("living")["results"]


def _find_rows() -> dict[str, Any]:
    """Return the rounds that were measured of this commit."""
    record, now = load_record("living"), describe_moment()
    then = record["origins"].get("live", {})
    is_same = not now["dirty"] and all(then.get(key) == now[key] for key in ("commit", "dirty"))
    return record["results"]["live"] if is_same else {}


def measure_arenas(repeats: int) -> dict[str, Any]:
    """Measure updates of the arenas of courses and of a room."""
    results: dict[str, Any] = {"course": {}, "held-out course": {}}
    for name, change in material.make_changes().items():
        if name in CHANGES:
            results["course"][name] = measure_change(change, repeats)
            print(f"course, {name}: {results['course'][name]}", flush=True)
    for name, change in make_held_out().items():
        if name in CHANGES:
            results["held-out course"][name] = measure_change(change, repeats)
            print(f"held-out course, {name}: {results['held-out course'][name]}", flush=True)
    results["room"] = measure_room(repeats)
    print(f"room: {results['room']}", flush=True)
    return results


def make_held_out() -> dict[str, material.Change]:
    """Return the changes of a course with other sizes and a box elsewhere."""
    course, box, seed = HELD_OUT
    return material.make_changes(seed, course, box)


def measure_change(change: material.Change, repeats: int) -> dict[str, Any]:
    """Measure the update of an arena after one change of the course."""
    old = rc.reconstruct(change.points, units=2200)
    refined = old.refine(change.new_points, origins=change.origins)
    return measure_update(sg.make_arena(old, cache=False), refined, repeats)


def measure_update(
    arena: sg.Arena, surface: rc.Reconstruction | trimesh.Trimesh, repeats: int
) -> dict[str, Any]:
    """Measure an update beside a new arena of the same surface, in turns."""
    times, made, updated = [], arena, arena
    for _ in range(repeats):
        cpu, updated = _time(lambda: sg.update_arena(arena, surface))
        fresh, made = _time(lambda: sg.make_arena(surface, cache=False))
        times.append((cpu, fresh))
    seconds = np.median(np.array(times), axis=0)
    accuracy = made.provenance["accuracy"]
    part = find_local_changes(arena.surface, made.surface, arena.pieces, accuracy)
    places = sample_faces(made.surface, np.flatnonzero(part.is_changed | part.is_open))
    kept = sum(any(piece is old for old in arena.pieces) for piece in updated.pieces)
    return {
        "cpu_ratio": float(seconds[0] / seconds[1]),
        "cpu_seconds": [float(second) for second in seconds],
        "pieces": [len(each.pieces) for each in (arena, updated, made)],
        "kept": kept,
        "built_again": updated.provenance.get("update", {}).get("built_again", ""),
        "mean": [each.quality.mean for each in (arena, updated, made)],
        "p95": [each.quality.p95 for each in (arena, updated, made)],
        "changed_part": [
            float(measure_gaps(*places, each.pieces).mean()) if len(places[0]) else 0.0
            for each in (updated, made)
        ],
        "accuracy": accuracy,
    }


def measure_room(repeats: int) -> dict[str, Any]:
    """Measure the update of an arena of a room in which a box has been put on the floor."""
    room = trimesh.creation.box((6.0, 4.0, 2.5))
    room.invert()
    crate = trimesh.creation.box((0.5, 0.4, 0.4))
    crate.apply_translation([1.5, 0.8, -1.05])
    plain = room.subdivide_to_size(0.12)
    boxed = trimesh.util.concatenate([plain, crate.subdivide_to_size(0.12)])
    viewpoint = [[0.0, 0.0, 0.0]]
    arena = sg.make_arena(plain, accuracy=0.005, viewpoints=viewpoint, cache=False)
    times = []
    updated = made = arena
    for _ in range(repeats):
        cpu, updated = _time(lambda: sg.update_arena(arena, boxed, viewpoints=viewpoint))
        fresh, made = _time(lambda: sg.make_arena(boxed, accuracy=0.005, viewpoints=viewpoint, cache=False))
        times.append((cpu, fresh))
    seconds = np.median(np.array(times), axis=0)
    return {
        "cpu_ratio": float(seconds[0] / seconds[1]),
        "cpu_seconds": [float(second) for second in seconds],
        "pieces": [len(each.pieces) for each in (arena, updated, made)],
        "kept": sum(any(piece is old for old in arena.pieces) for piece in updated.pieces),
        "built_again": updated.provenance.get("update", {}).get("built_again", ""),
        "mean": [each.quality.mean for each in (arena, updated, made)],
    }


def measure_live(seed: int, quick: bool) -> dict[str, Any]:
    """Run `symbrion live` once and return its figures."""
    from evolution._src.experiments.live.live import LiveConfig, run_live

    with tempfile.TemporaryDirectory() as folder:
        config = LiveConfig(Path(folder), seed, workers=2)
        if quick:
            config = replace(config, generations=2, trials=5)
        result = run_live(config, lambda _title: _silent_step())
        models = [rc.Reconstruction.load(Path(folder) / f"{name}.npz") for name in ("before", "after")]
    intersections = [model.quality().self_intersections for model in models]
    return result.as_dict() | {"self_intersections": intersections}


class _Step:
    """A step that shows nothing."""

    seconds = 0.0

    def progress(self, *_: object) -> None:
        """Ignore how far the work is."""


@contextlib.contextmanager
def _silent_step() -> Iterator[Any]:
    yield _Step()


def _time(call: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.process_time()
    made = call()
    return time.process_time() - begin, made


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.living", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one repetition, one seed, few genotypes")
    parser.add_argument("--only", choices=("arenas", "live"), help="one part")
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS, help="of the rounds")
    options = parser.parse_args()
    run(options.quick, options.only, tuple(options.seeds))


if __name__ == "__main__":
    main()
