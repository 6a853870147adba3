"""Verdicts about arenas, judged by dropping bodies and by driving; nothing of the verdict is used to judge.

    python -m benchmarks.verdict [--scenes apartment room truth] [--arenas FOLDER] [--drives 20]

The surface is made of all readings, and the arena with the defaults. 100 spheres and 100 boxes of a Scout's size fall
from 6 cm above level surface that has a reading within 10 cm, and have to rest within 2 cm of the surface; a Scout
follows 20 ways that the arena proposes from places drawn at random, and has to end upright within its length of the
goal: it heads for the next point of the way that is 8 cm ahead, by its true pose.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import mujoco
import numpy as np
import trimesh
from scipy.spatial import cKDTree

import reconstruction as rc
import symbrion_gym as sg
from benchmarks.evidence.judge import measure_distances
from benchmarks.material.made_scenes import SCENES
from benchmarks.material.scan_sources import PUBLIC, MissingScanError, find_folders, load_case
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.traversability.routes import DrivingRoute

FALL, REST = 0.06, 0.02
"""Height from which bodies fall, and distance from the surface at which they rest on it [m]."""
SEEN = 0.10
"""A place with a reading this near was seen [m]."""
RADIUS, HALF = 0.03, 0.0525
"""Of spheres, and half the edge of boxes [m]."""
LEVEL = np.cos(np.deg2rad(15.0))
ARRIVED, AHEAD, UPRIGHT = 0.105, 0.08, 0.5
"""Of a Scout that follows a way: how near the goal it ends and how far ahead it looks [m]; z of its up axis."""
SECONDS = 2.0
"""Bodies fall and rest for this long [s]."""


def load_scene(name: str, folder: Path) -> tuple[sg.Arena, np.ndarray | None, float]:
    """Return an arena, its readings in its frame or None, and the processor time of its making [s]."""
    if name in NAMED_ARENAS:
        return sg.load_arena(name), None, 0.0
    case, began = load_case(name, find_folders([])), time.process_time()
    cloud = rc.recenter(rc.Cloud(case.points, viewpoints=case.viewpoints, seen_from=case.seen_from))
    kept = folder / name.replace("/", "per")
    if (kept / "arena.json").is_file():
        return sg.Arena.load(kept), cloud.points, 0.0
    made = rc.reconstruct(rc.preprocess_cloud(cloud), readings=cloud)
    arena = sg.make_arena(made)
    arena.save(kept)
    return arena, made.readings.points, time.process_time() - began


def drop_bodies(arena: sg.Arena, readings: np.ndarray | None, count: int = 100) -> float:
    """Return the share of spheres and boxes that rest on the seen surface where they fell."""
    mesh, rng = arena.surface, np.random.default_rng(0)
    is_level = mesh.face_normals[:, 2] > LEVEL
    if not is_level.any():
        return 0.0
    level = trimesh.Trimesh(mesh.vertices, mesh.faces[is_level], process=False)
    places = np.asarray(trimesh.sample.sample_surface(level, 50 * count, seed=0)[0])
    if readings is not None:
        places = places[cKDTree(readings).query(places)[0] < SEEN]
    if not len(places):
        return 0.0
    ground = arena.traversability()
    known = ground.positions[ground.is_drivable]
    # boxes need room: they fall where the map has some
    roomy = places[cKDTree(known).query(places)[0] < ground.grid.cell] if len(known) else places
    spec = arena.spec()
    spec.option.timestep = 0.005
    sizes = [RADIUS] * count + [HALF] * (count if len(roomy) else 0)
    chosen = [places[rng.integers(len(places))] for _ in range(count)]
    chosen += [roomy[rng.integers(len(roomy))] for _ in range(len(sizes) - count)]
    for number, (size, place) in enumerate(zip(sizes, chosen, strict=True)):
        body = spec.worldbody.add_body(name=f"fallen_{number}", pos=np.add(place, [0.0, 0.0, size + FALL]))
        body.add_freejoint()
        kind = mujoco.mjtGeom.mjGEOM_SPHERE if size == RADIUS else mujoco.mjtGeom.mjGEOM_BOX
        body.add_geom(type=kind, size=[size] * 3, density=900, contype=0, conaffinity=1, condim=6,
                      friction=[0.9, 0.02, 0.02])  # fmt: skip
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(int(SECONDS / 0.005)):
        mujoco.mj_step(model, data)
    ends = np.array([data.body(f"fallen_{number}").xpos for number in range(len(sizes))])
    gaps = measure_distances(ends, mesh) - sizes
    return float(np.mean(np.abs(gaps) <= REST)) * len(sizes) / (2 * count)


def drive(arena: sg.Arena, count: int) -> tuple[int, int]:
    """Return how many of the ways between proposed places a Scout arrives on, and how many were proposed."""
    ground, rng, arrived, tried = arena.traversability(), np.random.default_rng(0), 0, 0
    usable = np.flatnonzero(ground.region == 0)
    while tried < count and len(usable):
        start = ground.positions[rng.choice(usable)]
        tried += 1
        try:
            route = arena.find_route(start=start, max_length=3.0)
            arrived += _follow(arena, route, tried)
        except ValueError as error:
            print(f"    refused: {error}", flush=True)
    return arrived, tried


def _follow(arena: sg.Arena, route: DrivingRoute, seed: int) -> bool:
    env = sg.OrganismEnv(
        arena=arena, task="reach", organism=1, start=route.start, goal=route.goal, track_control="skid",
        stuck_time=1e3,
    )  # fmt: skip
    env.reset(seed=seed)
    points, number, done = route.path[:, :2], 0, False
    while not done:
        place, rotation = env.physics.position[0, 0], env.physics.rotation[0, 0].reshape(3, 3)
        if np.linalg.norm(place[:2] - points[-1]) < ARRIVED and rotation[2, 2] > UPRIGHT:
            return True
        while number < len(points) - 1 and np.linalg.norm(points[number] - place[:2]) < AHEAD:
            number += 1
        x, y = points[number] - place[:2]
        turn = np.arctan2(y, x) - np.arctan2(rotation[1, 0], rotation[0, 0])
        turn = np.clip((turn + np.pi) % (2 * np.pi) - np.pi, -1.0, 1.0)
        speed = 1.0 - abs(turn)
        _, _, terminated, truncated, _ = env.step(np.array([speed - turn, speed + turn]))
        done = terminated or truncated
    return False


def main() -> None:
    """Print a line for each scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="*", default=[*PUBLIC, *SCENES, *NAMED_ARENAS])
    parser.add_argument("--arenas", type=Path, default=Path("verdicts"), help="where made arenas are kept")
    parser.add_argument("--drives", type=int, default=20)
    options = parser.parse_args()
    for name in options.scenes:
        try:
            arena, readings, seconds = load_scene(name, options.arenas)
        except (MissingScanError, ValueError) as error:
            print(f"{name}: {error}", flush=True)
            continue
        try:
            rests, (arrived, tried) = drop_bodies(arena, readings), drive(arena, options.drives)
        except sg.ArenaError:  # no ground at all
            rests, arrived, tried = 0.0, 0, 0
        is_good = rests >= 0.98 and arrived >= 0.9 * options.drives
        found = f"{rests:.1%} rest, {arrived} of {tried} arrive: {'good' if is_good else 'bad'}"
        print(f"{name}: {seconds:.0f} s; {found}; {arena.verdict}", flush=True)


if __name__ == "__main__":
    main()
