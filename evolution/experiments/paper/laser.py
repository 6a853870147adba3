"""Table III: what one laser scan costs, by the way of casting it and the number of triangles."""

import importlib.util
import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.paper.arenas import load_arena
from evolution.experiments.paper.config import PaperConfig
from evolution.experiments.paper.networks import list_networks, name_network
from evolution.experiments.paper.ray_casters import (
    BruteForceCaster,
    Caster,
    EmbreeCaster,
    TreeCaster,
    show_surface,
)
from evolution.experiments.paper.statistics import find_power, find_ratio, summarise

MODELS = ("gg", "gsrm", "simple")
CONTACTS = {"gg": "hulls", "gsrm": "hulls", "boxes": "boxes", "mixed": "mixed", "hfield": "height field"}
BLOCK = 20
"""Scans of one way before the next one's turn: as in a simulation, the arena is in the processor's caches."""
REACH = (-2.8, 2.0)
"""Places of the scanner along the course [m]."""
HEIGHT, PITCH = 0.3, np.deg2rad(20.0)
"""Of the scanner above the ground [m], and how far it looks down [rad]."""
log = logging.getLogger(__name__)


class Way(NamedTuple):
    """A way of scanning an arena.

    Attributes:
        model: name of arena or network.
        method: "tree", "embree", "brute force", or the contact shapes that are seen.
        triangles: that are searched; 0 where there are none.
        caster: does it.
        reference: the model whose exact surface the ranges are compared with.
    """

    model: str
    method: str
    triangles: int
    caster: Caster
    reference: str


def measure_laser(folder: Path, config: PaperConfig, progress: rc.Progress = rc.silent) -> dict[str, Any]:
    """Time scans of 361 beams from places along the course, from a robot that looks ahead and down.

    All ways take turns, a block of poses each. Processor time of the one thread that scans counts: other work on the
    machine does not, nor does drawing the progress. (The matrix products of brute force may use several threads: there
    the whole process counts.) No robot stands in the arena: what is timed is the arena alone.

    Args:
        folder: holds surfaces and arenas.
        config: number of scans.
        progress: told how far it is.

    Returns:
        `beams` of a scan, and the share of them that `hits` the arena; `rows`, one a way: `model`, `method`,
        `triangles`, `scan_us` (mean, deviation, median), `scans`, `error` (mean distance from the ranges on the
        exact surface [m]; None for the exact ones);
        `ratios` of GG and GSRM to the hand-made model on the exact surface and by brute force; `powers` of the
        number of triangles with which the median time grows, by method.
    """
    poses = list_poses(load_arena(folder, "simple"), config.scans)
    ways = _list_ways(folder, config)
    for way in ways:
        way.caster(poses[0])  # the first scan of all is slower: pages are touched, trees are made
    seconds: list[list[float]] = [[] for _ in ways]
    errors: list[list[float]] = [[] for _ in ways]
    hits: list[float] = []
    for start in range(0, len(poses), BLOCK):
        progress(f"scan {start + 1} of {len(poses)}", start / len(poses))
        block = poses[start : start + BLOCK]
        exact: dict[str, list[np.ndarray]] = {}
        for way, times, apart in zip(ways, seconds, errors, strict=True):
            is_slow = way.method == "brute force"
            chosen = block[: -(-len(block) * config.brute_scans // config.scans)] if is_slow else block
            clock = time.process_time if is_slow else time.thread_time
            ranges = _time_scans(way.caster, chosen, times, clock)
            if way is ways[0]:
                hits += [float(np.isfinite(one).mean()) for one in ranges]
            known = exact.setdefault(way.model if way.method == "tree" else way.reference, ranges)
            for one, other in zip(ranges, known, strict=False):
                difference = np.abs(one - other)
                apart += difference[np.isfinite(difference)].tolist()
    return {
        "beams": 361,
        "hits": float(np.mean(hits)),
        "rows": [
            {
                "model": way.model,
                "method": way.method,
                "triangles": way.triangles,
                "scan_us": summarise(times),
                "scans": len(times),
                "error": float(np.mean(apart)) if way.method != "tree" and apart else None,
            }
            for way, times, apart in zip(ways, seconds, errors, strict=True)
        ],
        "ratios": {
            method: {
                model: find_ratio(_pick(ways, seconds, model, method), _pick(ways, seconds, "simple", method))
                for model in ("gg", "gsrm")
            }
            for method in ("tree", "brute force")
        },
        "powers": {
            method: find_power(
                *np.transpose(
                    [
                        (way.triangles, np.median(times))
                        for way, times in zip(ways, seconds, strict=True)
                        if way.method == method
                    ]
                )
            )
            for method in dict.fromkeys(way.method for way in ways if way.triangles)
        },
    }


def list_poses(arena: sg.Arena, count: int) -> np.ndarray:
    """Return poses `[count, 4, 4]` along the middle of a course, above its ground.

    The survey's own poses are around the arena, where six beams of seven miss it.
    """
    places = np.linspace(*REACH, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    sine, cosine = np.sin(PITCH), np.cos(PITCH)
    poses[:, :3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    poses[:, :3, 3] = [(x, 0.0, float(arena.height(x, 0.0)) + HEIGHT) for x in places]
    return poses


def _time_scans(
    caster: Caster, poses: np.ndarray, times: list[float], clock: Callable[[], float]
) -> list[np.ndarray]:
    """Return the ranges of scans from the poses, and add what each took by the clock [µs] to `times`."""
    ranges = []
    for pose in poses:
        start = clock()
        ranges.append(caster(pose))
        times.append(1e6 * (clock() - start))
    return ranges


def _pick(ways: list[Way], seconds: list[list[float]], model: str, method: str) -> list[float]:
    return next(
        times for way, times in zip(ways, seconds, strict=True) if (way.model, way.method) == (model, method)
    )


def _list_ways(folder: Path, config: PaperConfig) -> list[Way]:
    """Return the ways; those that see exactly by the tree stand first."""
    arenas = {name: load_arena(folder, name) for name in dict.fromkeys((*MODELS, *CONTACTS))}
    surfaces = {name: arenas[name].surface for name in MODELS} | _load_others(folder, config)
    ways = [
        Way(
            name,
            "tree",
            len(mesh.faces),
            TreeCaster(arenas[name] if name in arenas else show_surface(mesh)),
            name,
        )
        for name, mesh in surfaces.items()
    ]
    for name, shapes in CONTACTS.items():
        reference = {"boxes": "simple"}.get(name, name if name in MODELS else "gsrm")
        ways.append(Way(name, shapes, 0, TreeCaster(arenas[name], on_contact=True), reference))
    casters: dict[str, type[EmbreeCaster | BruteForceCaster]] = {"brute force": BruteForceCaster}
    if importlib.util.find_spec("embreex"):
        casters = {"embree": EmbreeCaster, **casters}
    else:
        log.warning("Embree is left out of Table III; pip install '.[embree]' brings it")
    for method, make in casters.items():
        ways += [Way(name, method, len(mesh.faces), make(mesh), name) for name, mesh in surfaces.items()]
    return ways


def _load_others(folder: Path, config: PaperConfig) -> dict[str, trimesh.Trimesh]:
    """Return the surfaces of the sizes of the networks that no arena of the tables is made of."""
    known = {name_network("gsrm", config.arena_units), name_network("gg", config.arena_triangles)}
    names = [name for name in list_networks(config) if name not in known]
    return {name: rc.Reconstruction.load(folder / "surfaces" / f"{name}.npz").mesh for name in names}
