"""The experiments of the paper (Tables I-III, Figs. 3-7): what is measured. `paper_page` shows it.

Each experiment is a function of the output folder, whose result is saved as `experiments/NAME.json` when it is finished
and read by the next call. The experiments follow each other as the pipeline does: a survey of the true arena, networks
of its points, arenas of their surfaces, an evolution in one of them, and what physics and laser scans cost there.
"""

import copy
import dataclasses
import datetime
import logging
import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import trimesh
from jaxtyping import Float
from PIL import Image

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.champions.playback import ChampionPolicy, Recording, judge, play
from evolution._src.controllers.controller import make_controller
from evolution._src.errors import RunError
from evolution._src.experiments.folders import Track, evolve_or_resume
from evolution._src.report.body_page import describe_machine
from evolution._src.report.video import encode_video
from evolution._src.search.cmaes import Run
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import load_run
from evolution._src.search.run import load_champion
from evolution._src.search.validation import Champion
from reconstruction._src.base.atomic_write import write_atomically, write_file
from reconstruction._src.base.typed_json import JsonError, read_json, write_json
from reconstruction._src.surfaces.quality import compute_distances
from symbrion_gym._src.contact.quality import measure_arena
from symbrion_gym._src.sensing.survey import SPACING
from symbrion_gym._src.sensing.survey_robot import LaserScanner

logger = logging.getLogger(__name__)
Result = dict[str, Any]  # Plain JSON content


@dataclasses.dataclass(frozen=True)
class PaperSizes:
    """Sizes and numbers of repetitions."""

    # sizes of the GSRM, Table I and Fig. 4; 2200 is the paper's.
    gsrm_units: tuple[int, ...] = (800, 2200, 5000)
    # sizes of the growing grid, Table I and Fig. 5; 13,860 is the paper's.
    gg_triangles: tuple[int, ...] = (210, 1500, 13860)
    generations: int = 40  # limit of the evolution, which stops earlier when a champion is confirmed
    trials: int = 20  # randomized trials in which the champion is judged; 18 of 20 count as a success
    runs: int = 100  # crossings that are timed in each arena, Table II; 100 in the paper
    scans: int = 1000  # laser scans that are timed with each method, Table III


QUICK = PaperSizes((800, 2200), (13860,), 5, 8, 3, 100)
"""A reduced version, which takes three minutes on two cores."""
ARENA_NETWORKS = {"gsrm": "gsrm_2200", "gg": "gg_13860"}
"""Arena -> the network whose surface it is made of, as in the paper."""
MODULES = 8
RECIPES = {
    "gg": ("gg", "convex", "growing grid, convex pieces"),
    "gsrm": ("gsrm", "convex", "GSRM, convex pieces"),
    "simple": ("hand", "convex", "hand-made model, convex pieces"),
    "boxes": ("hand", "exact", "hand-made model, exact boxes"),
    "mixed": ("gsrm", "mixed", "GSRM, primitives and mesh"),
    "hfield": ("gsrm", "hfield", "GSRM, height field"),
    "prisms": ("gsrm", "prisms", "GSRM, one prism per triangle"),
}
"""Arena -> network ("hand": the hand-made model), kind of contact geometry, and description."""
MARKER, LOG, CLOUD, RUN = "config.json", "survey.npz", "cloud.ply", "run"
OUTPUTS = (
    "experiments",
    LOG,
    CLOUD,
    "surfaces",
    "arenas",
    RUN,
    "films",
    "figures",
    "results.json",
    "report.html",
)
"""Files and folders that the experiments and their page make."""

# Table II: what differs between the runs, and which part of a crossing is timed.
STEPS = 3500  # Physics steps that are timed in each crossing, as in the paper
CONDITIONS = {"friction": (0.55, 0.9), "yaw": (-0.05, 0.05), "start_offset": (-0.05, 0.05)}
"""Ranges of a run: friction as in the trials of a champion; a small heading [rad], as a run that leaves the course does
not cross the pit; offset along the course [m]."""
PIT_EDGE = -0.2  # Position of the head from which a run is timed: just behind the edge of the pit [m]
LEAD_TICKS = 400  # A run is timed after as many ticks in any case
REST_TICKS = 1000
"""Ticks after the timed ones, for the body to be completely across: in 17.5 s it moves 1.75 m at most."""
MAX_WAIT = 50e-6
"""A tick whose wall time exceeds its processor time by more was interrupted by other work, and is left out [s]."""

# Table III: poses of the scanner along the course.
FIRST, LAST, HEIGHT, PITCH = -2.8, 2.0, 0.3, np.deg2rad(20.0)
"""From half a meter behind the beginning of the course to behind the second ramp [m]; above the ground [m], so that it
looks over the ramps; angle by which the middle beam looks down [rad]."""
BLOCK = 20
"""Scans that one method takes before the next one follows: in a simulation, too, the arena is in the caches."""
BRUTE_SCANS = 20  # Scans that are timed by brute force, which takes much longer
PAIRS = 2_000_000
"""Pairs of ray and triangle that brute force tests at once; more would not fit into a processor's cache."""

# Fig. 7.
SHORT_MODULES = 4
"""Modules of a body that is too short to cross the pit with any controller: 0.5 m, and the pit is 0.45 m wide."""
FILM_SPEED, FILM_RATE = 5.0, 20  # Playback speed of the videos, relative to real time, and frames a second
NEAR_PIT = -0.35  # Position of the head shortly before the pit, whose edge is at -0.225 m [m]


def run_experiments(
    folder: Path, is_quick: bool, seed: int, track: Track, workers: int = os.cpu_count() or 1
) -> dict[str, Result]:
    """Run all experiments whose results do not exist yet."""
    sizes = QUICK if is_quick else PaperSizes()
    experiments: dict[str, tuple[str, Callable[..., Any]]] = {
        "cloud": ("Fig. 3: survey and cloud", measure_cloud),
        "networks": ("Table I: networks", measure_networks),
        "arenas": ("arenas", build_arenas),
        "evolution": ("evolution in the GSRM arena", partial(evolve_champion, workers=workers)),
        "physics": ("Table II: physics", measure_physics),
        "laser": ("Table III: laser scan", measure_laser),
        "films": ("Fig. 7: videos", film_robots),
    }
    results = {}
    for index, (name, (title, work)) in enumerate(experiments.items()):
        path = folder / "experiments" / f"{name}.json"
        if not path.is_file():
            with track(f"{index + 1}/{len(experiments)} {title}") as step:
                write_json(path, _time_work(partial(work, folder, sizes, seed), step.progress))
        results[name] = read_result(path)
    return results


def read_result(path: Path) -> Result:
    """Return the saved result of an experiment."""
    try:
        result = read_json(path)
        if not isinstance(result, dict) or not {"figures", "seconds", "machine", "date"} <= set(result):
            raise JsonError("fields are missing")
    except JsonError as error:
        raise RunError(f"{path} is damaged ({error}); remove it, and the experiment is repeated") from error
    return result


def _time_work(work: Callable[[rc.Progress], Any], progress: rc.Progress) -> Result:
    start, cpu_start = time.perf_counter(), sum(os.times()[:4])
    figures = work(progress)
    return {
        "figures": figures,
        "seconds": round(time.perf_counter() - start, 1),
        "cpu_seconds": round(sum(os.times()[:4]) - cpu_start, 1),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": describe_machine(),
    }


def measure_cloud(folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress) -> Result:
    """Survey the true arena and measure the points after each step of preprocessing (Fig. 3)."""
    truth = sg.load_arena("truth").surface
    log = sg.survey("truth", seed=seed, progress=progress)
    log.save(folder / LOG)
    points = rc.thin(rc.preprocess(log), SPACING)
    rc.save_points(folder / CLOUD, points)
    progress("measuring the steps", 0.9)
    leveled = rc.level_floor(log)
    filtered = rc.remove_mixed_pixels(leveled)
    stages = {
        "raw": log.points(),
        "floor leveled": leveled.points(),
        "mixed pixels removed": filtered.points(),
        "ranges smoothed": rc.smooth_ranges(filtered).points(),
        "cropped to the arena": rc.preprocess(log),
        f"thinned to {1000 * SPACING:.0f} mm": points,
    }
    assert log.truth is not None
    assert log.box is not None
    steps = []
    for name, cloud in stages.items():
        distances = compute_distances(rc.crop(cloud, log.box), truth.vertices, truth.faces)
        p95 = float(np.percentile(distances, 95))
        steps.append({"step": name, "readings": len(cloud), "mean": float(distances.mean()), "p95": p95})
    is_removed, is_mixed = leveled.is_valid & ~filtered.is_valid, log.truth.is_mixed & log.is_valid
    others = log.is_valid & ~is_mixed
    mixed = {
        "mixed": int(is_mixed.sum()),
        "mixed_removed": int((is_mixed & is_removed).sum()),
        "others": int(others.sum()),
        "others_removed": int((others & is_removed).sum()),
    }
    scans, beams = log.ranges.shape
    return {"scans": scans, "beams": beams, "steps": steps, "mixed": mixed}


def find_removed(log: rc.ScanLog) -> Float[np.ndarray, "N 3"]:
    """Return the readings that the filter removes as mixed pixels, at their places in the raw scan log [m]."""
    leveled = rc.level_floor(log)
    return log.grid()[leveled.is_valid & ~rc.remove_mixed_pixels(leveled).is_valid]


def load_network(folder: Path, name: str) -> rc.Reconstruction:
    """Return a network that `measure_networks` saved."""
    return rc.Reconstruction.load(folder / "surfaces" / f"{name}.npz")


def measure_networks(folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress) -> list[Result]:
    """Reconstruct the survey at every size (Table I)."""
    truth, points = sg.load_arena("truth").surface, rc.load_points(folder / CLOUD)
    (folder / "surfaces").mkdir(exist_ok=True)
    jobs = [("gsrm", "units", size) for size in sizes.gsrm_units]
    jobs += [("gg", "triangles", size) for size in sizes.gg_triangles]
    rows = []
    for index, (method, unit, size) in enumerate(jobs):
        name, options = f"{method}_{size}", {"method": method, unit: size}
        progress(name, index / len(jobs))
        surface, seconds = rc.reconstruct(points, seed=seed, **options), []  # also compiles
        for _ in range(3):
            start = time.perf_counter()
            rc.reconstruct(points, seed=seed, **options)
            seconds.append(time.perf_counter() - start)
        surface.save(folder / "surfaces" / f"{name}.npz")
        row = {"network": name, "method": method, "size": size, "seconds": float(np.median(seconds))}
        rows.append(row | _measure_surface(surface.mesh, truth))
    hand_made = sg.load_arena("simple").surface
    measured = _measure_surface(cut_sides(hand_made), truth) | {"triangles": len(hand_made.faces)}
    return [*rows, {"network": "simple", "method": "hand", "size": None, "seconds": None} | measured]


def cut_sides(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a course without its vertical sides."""
    top = mesh.copy()
    top.update_faces(np.abs(mesh.face_normals[:, 1]) < 0.5)  # other faces have no component across the course
    top.merge_vertices()
    return top


def _measure_surface(mesh: trimesh.Trimesh, truth: trimesh.Trimesh) -> Result:
    quality = rc.measure_quality(mesh, truth=truth)
    assert quality.truth_to_mesh is not None
    assert quality.mesh_to_truth is not None
    return {
        "triangles": len(mesh.faces),
        "truth_to_mesh": quality.truth_to_mesh.mean,
        "truth_to_mesh_p95": quality.truth_to_mesh.p95,
        "mesh_to_truth": quality.mesh_to_truth.mean,
        "boundary_loops": quality.topology.boundary_loops,
    }


def load_arena(folder: Path, name: str) -> sg.Arena:
    """Return an arena that `build_arenas` saved."""
    return sg.Arena.load(folder / "arenas" / name)


def build_arenas(folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress) -> list[Result]:
    """Build the arenas of Tables II and III and save each as a folder."""
    truth, simple, rows = sg.load_arena("truth").surface, sg.load_arena("simple"), []
    for index, (name, (method, kind, text)) in enumerate(RECIPES.items()):
        progress(text, index / len(RECIPES))
        if kind == "exact":
            arena = simple
        else:
            is_hand_made = method == "hand"
            mesh = simple.surface if is_hand_made else load_network(folder, ARENA_NETWORKS[method]).mesh
            # No cache: a cached arena carries the building time of the first time.
            arena = sg.make_arena(mesh, kind=kind, name=name, seed=seed, cache=False)
        arena.save(folder / "arenas" / name)
        region = None if method == "hand" else arena.surface
        quality = measure_arena(arena.pieces, truth, region=region) if arena.pieces else None
        rows.append(
            {
                "arena": name,
                "text": text,
                "pieces": len(arena.pieces),
                "triangles": len(arena.surface.faces),
                "seconds": arena.quality.seconds,
                "mean": quality.mean if quality else None,
                "p95": quality.p95 if quality else None,
            }
        )
    return rows


def evolve_champion(
    folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress, workers: int = 1
) -> Result:
    """Evolve in the GSRM arena, or resume that run, and judge the champion there and in the true arena."""
    wanted = EvolutionConfig(
        arena=str((folder / "arenas" / "gsrm").resolve()),
        modules=MODULES,
        seed=seed,
        generations=sizes.generations,
        workers=workers,
        folder=str(folder / RUN),
    )
    run = evolve_or_resume(wanted, progress)
    champion, history = run.champion, run.history
    assert champion is not None
    judged = {}
    for name, arena in (("gsrm", load_arena(folder, "gsrm")), ("truth", sg.load_arena("truth"))):
        outcome = judge(champion, arena, sizes.trials, seed, workers=workers)
        judged[name] = {"successes": outcome.successes, "trials": outcome.trials}
    return {
        "champion": champion.to_json(),
        "genotypes": int(history["evaluations"][-1]),
        "generations": len(history),
        **{name: history[name].tolist() for name in ("evaluations", "best", "median")},
        "judged": judged,
    }


def measure_physics(folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress) -> Result:
    """Time the champion's crossings in every arena, by MuJoCo's own timers (Table II).

    The arenas alternate run by run, so that a machine that slows down slows all of them down; run i has the same
    conditions in all of them.
    """
    champion = load_champion(folder / RUN)
    sensors = make_controller(champion.controller, champion.modules).sensors
    options = {
        "modules": champion.modules,
        "sensors": sensors,
        "start": "pit",
        "timers": True,
        "stuck_time": 1e3,
    }
    environments = {name: _make_environment(load_arena(folder, name), **options) for name in RECIPES}
    samples: dict[str, list[Result]] = {name: [] for name in RECIPES}
    for run in range(sizes.runs):
        progress(f"run {run + 1} of {sizes.runs}", run / sizes.runs)
        for name, environment in environments.items():
            samples[name].append(_time_crossing(environment, champion, seed + run))
    for environment in environments.values():
        environment.close()
    columns = {
        name: {key: [each[key] for each in found] for key in found[0]} for name, found in samples.items()
    }
    costs, hand_made = ("physics_us", "collision_us"), columns["simple"]
    return {
        "runs": sizes.runs,
        "interrupted": float(np.mean([found["interrupted"] for found in columns.values()])),
        "rows": [
            {
                "arena": name,
                "text": RECIPES[name][2],
                **{cost: summarize(found[cost]) for cost in costs},
                "contacts": float(np.mean(found["contacts"])),
                "crossed": int(np.sum(found["crossed"])),
            }
            for name, found in columns.items()
        ],
        "ratios": {
            name: {cost: compute_ratio(found[cost], hand_made[cost], seed) for cost in costs}
            for name, found in columns.items()
            if name != "simple"
        },
    }


def _make_environment(arena: sg.Arena, **options: Any) -> Any:
    made = gymnasium.make("symbrion_gym/SnakePit-v1", arena=arena, disable_env_checker=True, **options)
    return made.unwrapped


def _time_crossing(environment: Any, champion: Champion, seed: int) -> Result:
    """Time `STEPS` physics steps from when the head is above the pit; then continue until the body has crossed."""
    policy = ChampionPolicy(champion, environment.observation_structure)
    observation, _ = environment.reset(seed=seed, options=CONDITIONS)
    state, crossed = None, False
    timed: list[tuple[float, float, int]] = []
    waits: list[float] = []
    ticks = max(1, STEPS // environment.config.frame_skip)
    for tick in range(LEAD_TICKS + ticks + REST_TICKS):
        action, state = policy.predict(observation, state)
        waited_before = time.perf_counter() - time.thread_time()
        observation, _, _, _, info = environment.step(action)
        wait = time.perf_counter() - time.thread_time() - waited_before
        crossed = crossed or info["success"]
        if len(timed) < ticks and (tick >= LEAD_TICKS or info["x_position"] > PIT_EDGE):
            timed.append((info["physics_us"], info["collision_us"], environment.data.ncon))
            waits.append(wait)
        if crossed and len(timed) == ticks:
            break
    is_undisturbed = np.array(waits) < MAX_WAIT
    counted = np.array(timed)[is_undisturbed if is_undisturbed.any() else slice(None)]
    names = ("physics_us", "collision_us", "contacts")
    means = dict(zip(names, counted.mean(axis=0).tolist(), strict=True))
    return means | {"crossed": bool(crossed), "interrupted": float(1 - is_undisturbed.mean())}


Ranges = Float[np.ndarray, " beams"]  # Of a scan [m], nan where nothing is in range
Caster = Callable[[Float[np.ndarray, "4 4"]], Ranges]  # Casts a scan from a pose


def make_tree_caster(arena: sg.Arena) -> Caster:
    """Return what casts scans of the exact surface by `mj_multiRay`, through bounding-volume trees."""
    environment = _make_environment(arena, modules=1)
    environment.reset(seed=0)
    data, site = copy.copy(environment.data), environment.model.site("module_0").id
    finder = sg.RangeFinder(environment.model, "module_0")

    def cast(pose: Float[np.ndarray, "4 4"]) -> Ranges:
        data.site_xpos[site], data.site_xmat[site] = pose[:3, 3], pose[:3, :3].ravel()
        return finder.read(data)

    return cast


def make_brute_force_caster(arena: sg.Arena) -> Caster:
    """Return what tests every triangle with every beam, like a simulator without bounding volumes.

    References:
        Möller and Trumbore (1997), Fast, minimum storage ray-triangle intersection. With one origin for all rays the
        triple products become matrix products: with s = origin - corner, det = -d . (e1 x e2), u det = -d . (s x e2),
        v det = -d . (e1 x s), t det = s . (e1 x e2).
    """
    corners, scanner = np.asarray(arena.surface.triangles, dtype=np.float64), LaserScanner()
    parts = (corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def cast(pose: Float[np.ndarray, "4 4"]) -> Ranges:
        directions = scanner.directions @ pose[:3, :3].T
        nearest = np.full(len(directions), np.inf)
        rows = max(1, PAIRS // len(directions))
        for start in range(0, len(corners), rows):
            corner, edge, other = (part[start : start + rows] for part in parts)
            reach, normal = pose[:3, 3] - corner, np.cross(edge, other)
            det = -directions @ normal.T
            with np.errstate(divide="ignore", invalid="ignore"):
                u = -(directions @ np.cross(reach, other).T) / det
                v = -(directions @ np.cross(edge, reach).T) / det
                t = np.sum(reach * normal, axis=1) / det
                t[~((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0))] = np.inf
            np.minimum(nearest, t.min(axis=1, initial=np.inf), out=nearest)
        return np.where(nearest <= scanner.max_range, nearest, np.nan)

    return cast


def list_poses(arena: sg.Arena, count: int) -> Float[np.ndarray, "count 4 4"]:
    """Return poses of a scanner along the middle of a course, above its ground, looking ahead and down."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    sine, cosine = np.sin(PITCH), np.cos(PITCH)
    poses[:, :3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    poses[:, :3, 3] = [
        (x, 0.0, float(arena.height(x, 0.0)) + HEIGHT) for x in np.linspace(FIRST, LAST, count)
    ]
    return poses


def measure_laser(folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress) -> Result:
    """Time scans of 361 beams from positions along the course, looking ahead and down (Table III).

    The methods alternate, a block of poses each. The processor time of the thread that scans is measured, so that other
    work does not count; of brute force, whose matrix products may use several threads, that of the process.
    """
    arenas = {name: load_arena(folder, name) for name in ("gg", "gsrm", "simple")}
    methods = {"tree": make_tree_caster, "brute force": make_brute_force_caster}
    casters = {
        (name, method): make(arena) for method, make in methods.items() for name, arena in arenas.items()
    }
    poses = list_poses(arenas["simple"], sizes.scans)
    hits = np.mean([np.isfinite(casters["gg", "tree"](pose)) for pose in poses])
    times: dict[tuple[str, str], list[float]] = {key: [] for key in casters}
    for start in range(0, len(poses), BLOCK):
        progress(f"scan {start + 1} of {len(poses)}", start / len(poses))
        for (name, method), cast in casters.items():
            is_brute = method == "brute force"
            clock = time.process_time if is_brute else time.thread_time
            cast(poses[start])  # the first scan takes longer: memory is allocated, caches are filled
            block = poses[start : start + BLOCK]
            for pose in block[: max(1, BRUTE_SCANS * len(block) // len(poses))] if is_brute else block:
                begin = clock()
                cast(pose)
                times[name, method].append(1e6 * (clock() - begin))
    triangles = {name: len(arena.surface.faces) for name, arena in arenas.items()}
    rows = [
        {
            "model": name,
            "method": method,
            "triangles": triangles[name],
            "scan_us": summarize(found),
            "scans": len(found),
        }
        for (name, method), found in times.items()
    ]
    ratios = {}
    for method in methods:
        own = {name: times[name, method] for name in arenas}
        ratios[method] = {name: compute_ratio(own[name], own["simple"]) for name in ("gg", "gsrm")}
    return {"beams": LaserScanner.num_beams, "hits": float(hits), "rows": rows, "ratios": ratios}


def film_robots(folder: Path, sizes: PaperSizes, seed: int, progress: rc.Progress) -> Result:
    """Film robots in the true arena (Fig. 7): an insufficiently evolved one, one that is too short, the champion."""
    run = load_run(folder / RUN)
    champion = run.champion
    assert champion is not None
    robots = {
        "insufficient": find_insufficient(run),
        "short": dataclasses.replace(champion, modules=SHORT_MODULES),
        "champion": champion,
    }
    truth, figures = sg.load_arena("truth"), {}
    (folder / "films").mkdir(exist_ok=True)
    for index, (name, robot) in enumerate(robots.items()):
        progress(name, index / len(robots))
        film = play(robot, truth, seed, film=True, speed=FILM_SPEED, fps=FILM_RATE)
        figures[name] = {
            "modules": robot.modules,
            "success": film.success,
            "progress": film.progress,
            "seconds": film.seconds,
            "moments": _save_film(folder / "films", name, film),
        }
    return figures


def select_frames(positions: Float[np.ndarray, "ticks modules 3"], num_frames: int) -> list[int]:
    """Return the indices of three frames: shortly before the pit, half way from there to the end, and the last."""
    is_near = positions[:, 0, 0] > NEAR_PIT
    arrives, last = int(np.argmax(is_near)) if is_near.any() else 0, len(positions) - 1
    ticks = np.array([arrives, (arrives + last) / 2, last])
    return np.clip(ticks / max(last, 1) * (num_frames - 1), 0, num_frames - 1).round().astype(int).tolist()


def _save_film(folder: Path, name: str, film: Recording) -> list[float]:
    """Save positions, and where there are images video and three frames; return the times of these [s]."""
    with write_atomically(folder / f"{name}.npz") as beside:
        np.savez_compressed(beside, positions=film.positions)
    if not film.frames:
        return []
    write_file(folder / f"{name}.mp4", encode_video(film.frames, film.fps))
    selected = select_frames(film.positions, len(film.frames))
    for index, frame in enumerate(selected):
        with write_atomically(folder / f"{name}_{index + 1}.png") as beside:
            Image.fromarray(film.frames[frame]).save(beside, optimize=True)
    return [round(min(frame * FILM_SPEED / film.fps, film.seconds), 2) for frame in selected]


def summarize(values: Sequence[float]) -> dict[str, float]:
    """Return mean, standard deviation and median."""
    return {
        "mean": float(np.mean(values)),
        "deviation": float(np.std(values)),
        "median": float(np.median(values)),
    }


def compute_ratio(costs: Sequence[float], reference: Sequence[float], seed: int = 0) -> Mapping[str, float]:
    """Return the ratio of two mean costs with its bootstrap interval of 95 %.

    References:
        Efron and Tibshirani (1993), An Introduction to the Bootstrap, section 13.3 (percentile interval).
    """
    pairs, rng = np.stack([costs, reference], axis=1), np.random.default_rng(seed)
    sums = np.stack([pairs[rng.integers(0, len(pairs), len(pairs))].sum(axis=0) for _ in range(10_000)])
    low, high = np.percentile(sums[:, 0] / sums[:, 1], (2.5, 97.5))
    mean = pairs.mean(axis=0)
    return {"ratio": float(mean[0] / mean[1]), "low": float(low), "high": float(high)}


def find_insufficient(run: Run) -> Champion:
    """Return an insufficiently evolved robot: of those of the first generation that did not cross, the median one."""
    assert run.champion is not None
    first = [entry for entry in run.record.entries if entry.generation == 0]
    failed = sorted(
        (entry for entry in first if not any(entry.outcome.succeeded)), key=lambda entry: entry.fitness
    )
    if not failed:  # all crossed at once: a robot that does nothing instead
        return dataclasses.replace(run.champion, genotype=(0.0,) * len(run.champion.genotype))
    genotype = failed[len(failed) // 2].genotype
    return dataclasses.replace(run.champion, genotype=tuple(map(float, genotype)))
