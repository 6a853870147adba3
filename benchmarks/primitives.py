"""Primitives within meshes: what a laser scan costs and how far its ranges are off, on courses and in made scenes.

`python -m benchmarks.primitives [--quick]`

Every scene is reconstructed from a scan. Scans of 361 beams from many places are cast on the exact mesh and on what
rays see of an arena of the kind "mixed", alternating, and on the truth. The settings were chosen on the courses and the
room. On `table`, `thin walls` and `spiral stairs`, first set aside, rectangles cost more than they saved: the rule
`PrimitivesConfig.min_cover` was added after that. How far rectangles grow and the tolerance were chosen on the courses,
the room, the bare room and the warehouse. `SET_ASIDE` was never looked at while anything was chosen.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, NamedTuple

import igl
import mujoco
import numpy as np
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from benchmarks.material.made_scenes import SCENES
from benchmarks.material.plain_rooms import ROOMS
from benchmarks.material.ray_casts import find_poses
from benchmarks.report import write_results
from symbrion_gym._src.arenas.geometry import ArenaGeometry
from symbrion_gym._src.arenas.primitives import find_arena_primitives
from symbrion_gym._src.arenas.spec import SURFACE_GROUP, make_arena_spec
from symbrion_gym._src.sensing.laser_scanner import LaserScanner

CHOSEN_ON = ("gsrm", "gg", "room", "table", "thin walls", "spiral stairs", "bare room", "warehouse")
SET_ASIDE = ("rubble", "office", "corridor")
COPIES, REPETITIONS = 4, 3
"""Times that each model is compiled, and that each scan is cast on each copy: where the compiler's memory lies changes
the time of a scan by up to a fifth."""
_COUNT = 60
"""Scans of a made scene."""
_MARGIN = 0.6
"""Distance of the scanner from the sides of a scene [m]."""
_HEIGHTS = (0.3, 1.3)
"""Of the scanner above the lowest point [m]."""
_PITCH = np.radians(20.0)
"""The scanner looks down by up to this."""
_CLEAR = 0.15
"""Distance of the scanner from the surface at least [m]."""


class Place(NamedTuple):
    """Where a scan is taken: `[3]` [m] and `[3, 3]` scanner to world."""

    origin: np.ndarray
    rotation: np.ndarray


class Scene(NamedTuple):
    """A reconstructed surface, its truth, and the places of scans."""

    surface: trimesh.Trimesh
    truth: trimesh.Trimesh
    places: list[Place]


def make_scene(name: str, count: int) -> Scene:
    """Return a ready-made course, or reconstruct a made scene."""
    if name in ("gsrm", "gg"):
        arena = sg.load_arena(name)
        places = [Place(pose.origin, pose.rotation) for pose in find_poses(arena)]
        return Scene(arena.surface, sg.load_arena("truth").surface, places)
    made = SCENES[name]() if name in SCENES else ROOMS[name]()
    mesh = rc.reconstruct(made.points, viewpoints=made.viewpoints, seen_from=made.seen_from, seed=0).mesh
    return Scene(mesh, made.truth, _draw_places(mesh, count))


def _draw_places(mesh: trimesh.Trimesh, count: int) -> list[Place]:
    """Return random places in a scene, clear of its surface, in random directions."""
    rng, places = np.random.default_rng(0), []
    (low, high), vertices = mesh.bounds, np.asarray(mesh.vertices)
    while len(places) < count:
        origin = np.append(
            rng.uniform(low[:2] + _MARGIN, high[:2] - _MARGIN), low[2] + rng.uniform(*_HEIGHTS)
        )
        yaw, pitch = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, _PITCH)
        squared = igl.point_mesh_squared_distance(origin[None], vertices, np.asarray(mesh.faces, np.int64))[0]
        if np.sqrt(np.ravel(squared)[0]) > _CLEAR:
            places.append(Place(origin, trimesh.transformations.euler_matrix(0.0, pitch, yaw)[:3, :3]))
    return places


class Model:
    """What rays see, in MuJoCo."""

    def __init__(self, geometry: ArenaGeometry) -> None:
        """Compile it."""
        self._model = make_arena_spec("rays", geometry, 0.7).compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._groups = (np.arange(mujoco.mjNGROUP) == SURFACE_GROUP).astype(np.uint8)

    def cast(self, place: Place) -> tuple[np.ndarray, float]:
        """Return the ranges of a scan [m], inf where nothing is hit, and its processor time [µs]."""
        directions = np.ascontiguousarray(LaserScanner().directions @ place.rotation.T).ravel()
        count = len(directions) // 3
        ranges, geoms = np.empty(count), np.empty(count, np.int32)
        start = time.thread_time()
        mujoco.mj_multiRay(
            self._model, self._data, np.ascontiguousarray(place.origin), directions, self._groups, True, -1, geoms,
            ranges, None, count, mujoco.mjMAXVAL,
        )  # fmt: skip
        spent = 1e6 * (time.thread_time() - start)
        return np.where(geoms < 0, np.inf, ranges), spent


def measure_scene(name: str, count: int) -> dict[str, Any]:
    """Return the figures of a scene: times [µs], their ratio, and differences of ranges [mm]."""
    scene = make_scene(name, count)
    start = time.process_time()
    primitives = find_arena_primitives(scene.surface, seed=0)
    seconds = time.process_time() - start
    shapes = {
        "exact": ArenaGeometry(scene.surface, [], None),
        "mixed": ArenaGeometry(scene.surface, [], None, primitives=primitives),
        "truth": ArenaGeometry(scene.truth, [], None),
    }
    models = [(key, Model(geometry)) for _ in range(COPIES) for key, geometry in shapes.items()]
    times: dict[str, list[float]] = {key: [] for key in shapes}
    ranges: dict[str, np.ndarray] = {}
    for _ in range(REPETITIONS):
        for key, model in models:
            scans = [model.cast(place) for place in scene.places]
            ranges[key] = np.array([one for one, _ in scans])
            times[key] += [spent for _, spent in scans]
    kinds = [one.kind for one in primitives.shapes]
    return {
        "triangles": len(scene.surface.faces),
        "left": int(sum(len(part) for part in primitives.find_rest(scene.surface))),
        "primitives": {kind: kinds.count(kind) for kind in sorted(set(kinds))},
        "seconds": seconds,
        "exact_us": float(np.median(times["exact"])),
        "mixed_us": float(np.median(times["mixed"])),
        "ratio": float(np.median(times["mixed"]) / np.median(times["exact"])),
        "scans": len(scene.places),
        "mixed_to_exact": compare(ranges["mixed"], ranges["exact"]),
        "mixed_to_truth": compare(ranges["mixed"], ranges["truth"]),
        "exact_to_truth": compare(ranges["exact"], ranges["truth"]),
    }


def compare(ranges: np.ndarray, others: np.ndarray) -> dict[str, float]:
    """Return mean, 95th percentile and largest difference [mm] of beams that hit both, and the share that hit one."""
    is_both = np.isfinite(ranges) & np.isfinite(others)
    gaps = 1000 * np.abs(ranges[is_both] - others[is_both])
    return {
        "mean_mm": float(gaps.mean()),
        "median_mm": float(np.median(gaps)),
        "p95_mm": float(np.percentile(gaps, 95)),
        "worst_mm": float(gaps.max()),
        "within_2_mm": float((gaps <= 2.0).mean()),
        "one_only": float((np.isfinite(ranges) != np.isfinite(others)).mean()),
    }


def run(quick: bool = False) -> dict[str, Any]:
    """Measure every scene, print and write results/primitives.json."""
    names = CHOSEN_ON[:1] if quick else (*CHOSEN_ON, *SET_ASIDE)
    results = {}
    for name in names:
        found = results[name] = measure_scene(name, _COUNT)
        found["set_aside"] = name in SET_ASIDE
        print(
            f"{name:14s}{found['triangles']:7d} triangles, {found['left']:6d} left  {found['primitives']}  "
            f"{found['seconds']:.1f} CPU s  scan {found['exact_us']:.0f} -> {found['mixed_us']:.0f} us "
            f"({found['ratio']:.2f})"
        )
        for key in ("mixed_to_exact", "mixed_to_truth", "exact_to_truth"):
            print("   ", key, "  ".join(f"{what} {value:.3g}" for what, value in found[key].items()))
    if not quick:
        write_results("primitives", {"scenes": results})
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one course, nothing written")
    run(parser.parse_args().quick)
