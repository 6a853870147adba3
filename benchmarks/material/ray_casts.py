"""Laser scans in an arena: time and accuracy of several ray casters."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
import trimesh

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.spec import CONTACT_GROUP, SURFACE_GROUP
from symbrion_gym._src.sensing.rangefinder import RangeFinder
from symbrion_gym._src.sensing.survey_robot import LaserScanner

NUM_POSES = 24
_HEIGHT = 0.3
_PITCH = np.radians(20.0)
Cast = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From an origin `[3]` and directions `[R, 3]` to distances `[R]` [m], NaN where nothing is hit."""


class Pose(NamedTuple):
    """The pose of the scanner.

    Attributes:
        origin: `[3]` [m].
        rotation: `[3, 3]` scanner to world.
    """

    origin: np.ndarray
    rotation: np.ndarray


def compute_poses(arena: Arena) -> list[Pose]:
    """Return poses along the course, 0.3 m above ground, looking ahead and 20 degrees down."""
    x = np.linspace(-2.8, 2.0, NUM_POSES)
    sine, cosine = np.sin(_PITCH), np.cos(_PITCH)
    down = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return [Pose(np.array([place, 0.0, float(arena.height(place, 0.0)) + _HEIGHT]), down) for place in x]


def make_cast(arena: Arena, group: int) -> Cast:
    """Return a ray caster for the geoms of one group, by `mj_multiRay`."""
    model = arena.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = (np.arange(mujoco.mjNGROUP) == group).astype(np.uint8)

    def cast(origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        count = len(directions)
        distances, geoms = np.empty(count), np.empty(count, np.int32)
        mujoco.mj_multiRay(
            model, data, origin, directions.ravel(), groups, True, -1, geoms, distances, None, count, mujoco.mjMAXVAL
        )  # fmt: skip
        distances[geoms < 0] = np.nan
        return distances

    return cast


def make_embree_cast(surface: trimesh.Trimesh) -> Cast:
    """Return a ray caster for a mesh, by Intel's Embree."""
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    rays = RayMeshIntersector(surface)

    def cast(origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        starts = np.broadcast_to(origin, directions.shape)
        faces = np.asarray(rays.intersects_first(starts, directions))
        corners = np.asarray(surface.triangles)[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            distances = np.sum((corners[:, 0] - starts) * normals, axis=1) / np.sum(
                directions * normals, axis=1
            )
        return np.where(faces >= 0, distances, np.nan)

    return cast


def measure_scans(arenas: dict[str, Arena], exact: str, quick: bool) -> dict[str, dict[str, Any]]:
    """Measure the time of a scan [µs] for every ray caster, side by side, and its error [mm].

    Args:
        arenas: "hand-made", "hfield", "boxes" and the scanned one.
        exact: name of the scanned one.
        quick: fewer rounds.
    """
    casts = {
        "exact surface": make_cast(arenas[exact], SURFACE_GROUP),
        "hand-made model": make_cast(arenas["hand-made"], SURFACE_GROUP),
        "contact pieces": make_cast(arenas[exact], CONTACT_GROUP),
        "height field": make_cast(arenas["hfield"], CONTACT_GROUP),
        "boxes of the truth": make_cast(arenas["boxes"], CONTACT_GROUP),
        "Embree, exact surface": make_embree_cast(arenas[exact].surface),
    }
    directions = LaserScanner().directions
    poses = compute_poses(arenas[exact])
    beams = [np.ascontiguousarray(directions @ pose.rotation.T) for pose in poses]
    laps: dict[str, list[float]] = {name: [] for name in casts}
    ranges: dict[str, np.ndarray] = {}
    for _ in range(5 if quick else 40):
        for name, cast in casts.items():
            found = []
            for pose, rays in zip(poses, beams, strict=True):
                begin = time.perf_counter()
                found.append(cast(pose.origin, rays))
                laps[name].append(time.perf_counter() - begin)
            ranges[name] = np.array(found)
    truth = ranges["exact surface"]
    rows: dict[str, dict[str, Any]] = {}
    for name in casts:
        off = np.abs(ranges[name] - truth)[np.isfinite(ranges[name]) & np.isfinite(truth)]
        rows[name] = {
            "scan_us": 1e6 * float(np.median(laps[name])),
            "off_mean_mm": 1e3 * float(off.mean()),
            "off_p95_mm": 1e3 * float(np.percentile(off, 95)),
        }
    base = rows["hand-made model"]["scan_us"]
    for row in rows.values():
        row["over_hand_made"] = row["scan_us"] / base
    rows["range finder"] = _time_finder(arenas, exact, 5 if quick else 40)
    return rows


def _time_finder(arenas: dict[str, Arena], exact: str, rounds: int) -> dict[str, Any]:
    """Measure the time of `RangeFinder.read` [µs] on the exact surface and on the hand-made model."""
    laps: dict[str, list[float]] = {exact: [], "hand-made": []}
    finders = {}
    for name in laps:
        spec = arenas[name].spec()
        body = spec.worldbody.add_body(name="scanner", mocap=True)
        body.add_site(name="scanner")
        model = spec.compile()
        finders[name] = model, mujoco.MjData(model), RangeFinder(model, "scanner")
    for pose in compute_poses(arenas[exact]) * rounds:
        for name, (model, data, finder) in finders.items():
            data.mocap_pos[0] = pose.origin
            mujoco.mju_mat2Quat(data.mocap_quat[0], pose.rotation.ravel())
            mujoco.mj_forward(model, data)
            begin = time.perf_counter()
            finder.read(data)
            laps[name].append(time.perf_counter() - begin)
    spent, base = (1e6 * float(np.median(laps[name])) for name in (exact, "hand-made"))
    return {"scan_us": spent, "over_hand_made": spent / base}


def compare_with_embree(arena: Arena, count: int = 10_000, seed: int = 0) -> dict[str, Any]:
    """Compare distances of random rays, each aimed at the exact surface, by MuJoCo and by Embree."""
    rng = np.random.default_rng(seed)
    low, high = arena.surface.bounds
    origins = rng.uniform([*low[:2], high[2] + 0.05], [*high[:2], high[2] + 1.0], (count, 3))
    found: Any = trimesh.sample.sample_surface(arena.surface, count, seed=seed)
    directions = np.asarray(found[0]) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    mujoco_cast, embree_cast = make_cast(arena, SURFACE_GROUP), make_embree_cast(arena.surface)
    pairs = [(o, d[None]) for o, d in zip(origins, directions, strict=True)]
    mine = np.array([mujoco_cast(origin, ray)[0] for origin, ray in pairs])
    theirs = np.array([embree_cast(origin, ray)[0] for origin, ray in pairs])
    both = np.isfinite(mine) & np.isfinite(theirs)
    off = np.abs(mine - theirs)[both]
    return {
        "rays": count,
        "both_hit": int(both.sum()),
        "one_hits": int((np.isfinite(mine) != np.isfinite(theirs)).sum()),
        "within_0.1_mm": int((off < 1e-4).sum()),
        "largest_mm": 1e3 * float(off.max()),
    }
