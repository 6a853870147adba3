"""Table I and Figs. 4 and 5: both networks at every size, started cold and warm, against the truth."""

import multiprocessing
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.paper.config import PaperConfig
from reconstruction.files.cache import CACHE_VARIABLE
from reconstruction.surfaces.quality import measure_quality


def name_network(method: str, size: int) -> str:
    """Return the name of a network of some size, in files and tables: "gsrm_2200", "gg_13860"."""
    return f"{method}_{size}"


def list_networks(config: PaperConfig) -> dict[str, dict[str, Any]]:
    """Return name -> method and size, as `rc.reconstruct` takes them."""
    jobs = {name_network("gsrm", units): {"method": "gsrm", "units": units} for units in config.gsrm_units}
    return jobs | {
        name_network("gg", count): {"method": "gg", "triangles": count} for count in config.gg_triangles
    }


def measure_networks(
    folder: Path, config: PaperConfig, progress: rc.Progress = rc.silent
) -> list[dict[str, Any]]:
    """Reconstruct the cloud at every size (Table I).

    Args:
        folder: holds the cloud; keeps the surfaces.
        config: sizes and seed.
        progress: told how far it is.

    Returns:
        Rows with `network`, `method`, `size` wanted, `triangles`, `cold_seconds` (the first call of a process
        that finds nothing compiled; None where that is left out), `warm_seconds` (the median of the next three),
        and what `measure_surface` tells. The hand-made model is the last row, without size and seconds.
    """
    truth = sg.load_arena("truth").surface
    points = rc.load_points(folder / "cloud.ply")
    (folder / "surfaces").mkdir(exist_ok=True)
    jobs = list_networks(config)
    rows = []
    for index, (name, options) in enumerate(jobs.items()):
        progress(name, index / len(jobs))
        if config.cold_starts:
            cold, warm = _time_in_fresh_process(folder / "cloud.ply", config.seed, options)
        else:
            cold, warm = None, _time_calls(folder / "cloud.ply", config.seed, options)[1]
        surface = rc.reconstruct(points, seed=config.seed, **options)
        surface.save(folder / "surfaces" / f"{name}.npz")
        rows.append(
            {
                "network": name,
                "method": options["method"],
                "size": options.get("units", options.get("triangles")),
                "cold_seconds": cold,
                "warm_seconds": warm,
                **measure_surface(surface.mesh, truth),
            }
        )
    by_hand = sg.load_arena("simple").surface
    measured = measure_surface(cut_sides(by_hand), truth) | {"triangles": len(by_hand.faces)}
    row = {"network": "simple", "method": "hand", "size": None, "cold_seconds": None, "warm_seconds": None}
    return [*rows, row | measured]


def cut_sides(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a course without its upright sides, which no scan sees."""
    top = mesh.copy()
    top.update_faces(np.abs(mesh.face_normals[:, 1]) < 0.5)
    top.merge_vertices()
    return top


def measure_surface(mesh: trimesh.Trimesh, truth: trimesh.Trimesh) -> dict[str, float]:
    """Return `triangles`, distances from and to the truth [m], and what spoils a two-manifold."""
    quality = measure_quality(mesh, truth=truth)
    assert quality.truth_to_mesh is not None
    assert quality.mesh_to_truth is not None
    return {
        "triangles": len(mesh.faces),
        "truth_to_mesh": quality.truth_to_mesh.mean,
        "truth_to_mesh_p95": quality.truth_to_mesh.p95,
        "mesh_to_truth": quality.mesh_to_truth.mean,
        "boundary_loops": quality.topology.boundary_loops,
        "pinched_vertices": quality.topology.pinched_vertices,
        "euler_number": quality.topology.euler_number,
    }


def _time_in_fresh_process(cloud: Path, seed: int, options: dict[str, Any]) -> tuple[float, float]:
    """Return seconds of the first call and of a later one, in a process that finds nothing compiled."""
    spawn = multiprocessing.get_context("spawn")
    with (
        tempfile.TemporaryDirectory() as cache,
        ProcessPoolExecutor(1, spawn, initializer=_forget_compiled, initargs=(cache,)) as pool,
    ):
        return pool.submit(_time_calls, cloud, seed, options).result()


def _forget_compiled(cache: str) -> None:
    os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)
    os.environ[CACHE_VARIABLE] = cache


def _time_calls(cloud: Path, seed: int, options: dict[str, Any]) -> tuple[float, float]:
    rc.GSRMConfig, rc.GrowingGridConfig  # noqa: B018  (to import JAX is not what is timed)
    points, seconds = rc.load_points(cloud), []
    for _ in range(4):
        start = time.perf_counter()
        rc.reconstruct(points, seed=seed, **options)
        seconds.append(time.perf_counter() - start)
    return seconds[0], float(np.median(seconds[1:]))
