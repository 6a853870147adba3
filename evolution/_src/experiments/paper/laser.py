"""Table III: the time of one laser scan, by method of casting rays and number of triangles."""

import importlib.util
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.paper.arenas import load_arena
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.paper.networks import list_networks, name_network
from evolution._src.experiments.paper.ray_casters import (
    BruteForceCaster,
    Caster,
    EmbreeCaster,
    TreeCaster,
    show_surface,
)
from evolution._src.experiments.paper.statistics import find_power, find_ratio, summarize
from symbrion_gym._src.sensing.laser_scanner import LaserScanner

MODELS = ("gg", "gsrm", "simple")
CONTACT_SHAPES = {
    "gg": "hulls",
    "gsrm": "hulls",
    "boxes": "boxes",
    "mixed": "mixed",
    "hfield": "height field",
}
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ScanPlan:
    """Where the timed scans are taken, and in which order.

    Attributes:
        start: first position of the scanner along the course [m]; half a meter from the beginning of the course.
        end: last position [m]; behind the second ramp.
        height: height of the scanner above the ground [m]; it looks over the ramps, which are 0.25 m high.
        pitch: angle by which the middle beam looks down [rad]; downwards, so that beams hit the arena: the
            result `hits` is their share.
        block: scans that one method takes before the next one follows; in a simulation, too, the arena is already in
            the processor's caches.
    """

    start: float = -2.8
    end: float = 2.0
    height: float = 0.3
    pitch: float = float(np.deg2rad(20.0))
    block: int = 20


class ScanMethod(NamedTuple):
    """A method of scanning a model.

    Attributes:
        model: name of arena or network.
        method: "tree", "embree", "brute force", the contact shapes that are scanned, or "mixed": primitives and the
            triangles that they do not replace.
        triangles: number of triangles that are searched; 0 where the shapes are no triangles.
        caster: casts the scan.
        reference: the model with whose exact surface the ranges are compared.
    """

    model: str
    method: str
    triangles: int
    caster: Caster
    reference: str


def measure_laser(
    folder: Path, config: PaperConfig, progress: rc.Progress = rc.silent, plan: ScanPlan | None = None
) -> dict[str, Any]:
    """Time scans of 361 beams from positions along the course, looking ahead and down.

    The methods alternate, a block of poses each. The processor time of the thread that scans is measured, so other
    work on the machine does not count, nor does drawing the progress. (The matrix products of brute force may use
    several threads: for them it is the processor time of the process.) The arena contains no robot.

    Args:
        folder: contains surfaces and arenas.
        config: number of scans.
        progress: called with a message and the share that is done.
        plan: positions and order of the scans.

    Returns:
        `beams` of a scan, and the share of them that `hits` the arena; `rows`, one for each model and method:
        `model`, `method`, `triangles`, `scan_us` (mean, deviation, median), `scans`, `error` (mean difference from
        the ranges on the exact surface [m]; None for the exact surface itself);
        `ratios` of GG and GSRM to the hand-made model on the exact surface and by brute force; `powers`: by method,
        the exponent with which the median time grows with the number of triangles.
    """
    plan = plan or ScanPlan()
    poses = list_poses(load_arena(folder, "simple"), config.scans, plan)
    methods = _list_methods(folder, config)
    measured = _time_alternately(methods, poses, config, plan, progress)
    return {
        "beams": LaserScanner.num_beams,
        "hits": float(np.mean(measured.hits)),
        "rows": [
            {
                "model": method.model,
                "method": method.method,
                "triangles": method.triangles,
                "scan_us": summarize(times),
                "scans": len(times),
                "error": float(np.mean(differences)) if method.method != "tree" and differences else None,
            }
            for method, times, differences in zip(methods, measured.times, measured.differences, strict=True)
        ],
        "ratios": {
            name: {
                model: find_ratio(
                    _find_times(methods, measured.times, model, name),
                    _find_times(methods, measured.times, "simple", name),
                )
                for model in ("gg", "gsrm")
            }
            for name in ("tree", "brute force")
        },
        "powers": _find_powers(methods, measured.times),
    }


class ScanTimes(NamedTuple):
    """What was measured.

    Attributes:
        times: for each method, the time of every scan [µs].
        differences: for each method, differences from the ranges on the exact surface [m].
        hits: share of the beams of each scan that hit the arena.
    """

    times: list[list[float]]
    differences: list[list[float]]
    hits: list[float]


def _time_alternately(
    methods: list[ScanMethod],
    poses: Float[np.ndarray, "count 4 4"],
    config: PaperConfig,
    plan: ScanPlan,
    progress: rc.Progress,
) -> ScanTimes:
    """Time all methods block by block; brute force takes only a share of each block."""
    for method in methods:
        method.caster(poses[0])  # the first scan takes longer: memory is allocated, trees are built
    measured = ScanTimes([[] for _ in methods], [[] for _ in methods], [])
    for start in range(0, len(poses), plan.block):
        progress(f"scan {start + 1} of {len(poses)}", start / len(poses))
        block = poses[start : start + plan.block]
        exact: dict[str, list[np.ndarray]] = {}
        for index, method in enumerate(methods):
            is_brute = method.method == "brute force"
            taken = block[: -(-len(block) * config.brute_scans // config.scans)] if is_brute else block
            clock = time.process_time if is_brute else time.thread_time
            ranges = _time_scans(method.caster, taken, measured.times[index], clock)
            if index == 0:
                measured.hits.extend(float(np.isfinite(one).mean()) for one in ranges)
            expected = exact.setdefault(method.model if method.method == "tree" else method.reference, ranges)
            for one, other in zip(ranges, expected, strict=False):
                difference = np.abs(one - other)
                measured.differences[index].extend(difference[np.isfinite(difference)].tolist())
    return measured


def _find_powers(methods: list[ScanMethod], times: list[list[float]]) -> dict[str, float]:
    """Return method -> exponent with which the median time grows with the number of triangles."""
    points: dict[str, list[tuple[int, float]]] = {}
    for method, values in zip(methods, times, strict=True):
        if method.triangles:
            points.setdefault(method.method, []).append((method.triangles, float(np.median(values))))
    return {name: find_power(*np.transpose(pairs)) for name, pairs in points.items()}


def list_poses(arena: sg.Arena, count: int, plan: ScanPlan | None = None) -> Float[np.ndarray, "count 4 4"]:
    """Return poses along the middle of a course, above its ground.

    The poses of the survey are around the arena, from where six of seven beams miss it.
    """
    plan = plan or ScanPlan()
    places = np.linspace(plan.start, plan.end, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    sine, cosine = np.sin(plan.pitch), np.cos(plan.pitch)
    poses[:, :3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    poses[:, :3, 3] = [(x, 0.0, float(arena.height(x, 0.0)) + plan.height) for x in places]
    return poses


def _time_scans(
    caster: Caster, poses: Float[np.ndarray, "count 4 4"], times: list[float], clock: Callable[[], float]
) -> list[Float[np.ndarray, " beams"]]:
    """Return the ranges of scans from the poses [m], and append the time of each by the clock [µs] to `times`."""
    ranges = []
    for pose in poses:
        start = clock()
        ranges.append(caster(pose))
        times.append(1e6 * (clock() - start))
    return ranges


def _find_times(methods: list[ScanMethod], times: list[list[float]], model: str, name: str) -> list[float]:
    """Return the times of a model with a method [µs]."""
    pairs = zip(methods, times, strict=True)
    return next(values for method, values in pairs if (method.model, method.method) == (model, name))


def _list_methods(folder: Path, config: PaperConfig) -> list[ScanMethod]:
    """Return all models with all methods, first those that see the exact surface by its tree."""
    arenas = {name: load_arena(folder, name) for name in dict.fromkeys((*MODELS, *CONTACT_SHAPES))}
    surfaces = {name: arenas[name].surface for name in MODELS} | _load_others(folder, config)
    methods = [
        ScanMethod(
            name,
            "tree",
            len(mesh.faces),
            TreeCaster(arenas[name] if name in arenas else show_surface(mesh)),
            name,
        )
        for name, mesh in surfaces.items()
    ]
    for name, shapes in CONTACT_SHAPES.items():
        reference = {"boxes": "simple"}.get(name, name if name in MODELS else "gsrm")
        caster = TreeCaster(arenas[name], on_contact=arenas[name].primitives is None)
        methods.append(ScanMethod(name, shapes, 0, caster, reference))
    casters: dict[str, type[EmbreeCaster | BruteForceCaster]] = {"brute force": BruteForceCaster}
    if importlib.util.find_spec("embreex"):
        casters = {"embree": EmbreeCaster, **casters}
    else:
        logger.warning("Table III is made without Embree; pip install '.[embree]' installs it")
    for method, make in casters.items():
        methods += [
            ScanMethod(name, method, len(mesh.faces), make(mesh), name) for name, mesh in surfaces.items()
        ]
    return methods


def _load_others(folder: Path, config: PaperConfig) -> dict[str, trimesh.Trimesh]:
    """Return the surfaces of all networks that none of the arenas is made of."""
    in_arenas = {name_network("gsrm", config.arena_units), name_network("gg", config.arena_triangles)}
    names = [name for name in list_networks(config) if name not in in_arenas]
    return {name: rc.Reconstruction.load(folder / "surfaces" / f"{name}.npz").mesh for name in names}
