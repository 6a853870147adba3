"""Table I and Figs. 4 and 5: both networks at every size, timed cold and warm, compared with the true surface."""

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
from evolution._src.experiments.paper.config import PaperConfig
from reconstruction._src.base.cache import CACHE_VARIABLE
from reconstruction._src.surfaces.quality import measure_quality


def name_network(method: str, size: int) -> str:
    """Return the name of a network of a given size, in files and tables: "gsrm_2200", "gg_13860"."""
    return f"{method}_{size}"


def list_networks(config: PaperConfig) -> dict[str, dict[str, Any]]:
    """Return name -> method and size, as arguments of `rc.reconstruct`."""
    jobs = {name_network("gsrm", units): {"method": "gsrm", "units": units} for units in config.gsrm_units}
    return jobs | {
        name_network("gg", count): {"method": "gg", "triangles": count} for count in config.gg_triangles
    }


def measure_networks(
    folder: Path, config: PaperConfig, progress: rc.Progress = rc.silent
) -> list[dict[str, Any]]:
    """Reconstruct the survey at every size (Table I).

    Args:
        folder: contains the points; the surfaces are written to it.
        config: sizes and seed.
        progress: called with a message and the share that is done.

    Returns:
        Rows with `network`, `method`, requested `size`, `triangles`, `cold_seconds` (the first call of a process
        without compiled programs; None where it is not measured), `warm_seconds` (the median of the next three
        calls), and the measures of `measure_surface`. The last row is the hand-made model, without size and seconds.

    Raises:
        ReconstructionError: a network cannot learn the points.
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
    """Return a course without its vertical sides, which no scan sees."""
    top = mesh.copy()
    top.update_faces(np.abs(mesh.face_normals[:, 1]) < 0.5)  # other faces have no component across the course
    top.merge_vertices()
    return top


def measure_surface(mesh: trimesh.Trimesh, truth: trimesh.Trimesh) -> dict[str, float]:
    """Return `triangles`, distances from and to the true surface [m], and defects of the topology."""
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
    """Return the wall time of the first call and of a later one [s], in a process without compiled programs."""
    spawn = multiprocessing.get_context("spawn")
    with (
        tempfile.TemporaryDirectory() as cache,
        ProcessPoolExecutor(1, spawn, initializer=_use_empty_cache, initargs=(cache,)) as pool,
    ):
        return pool.submit(_time_calls, cloud, seed, options).result()


def _use_empty_cache(cache: str) -> None:
    """Let this process find no compiled programs."""
    os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)
    os.environ[CACHE_VARIABLE] = cache


def _time_calls(cloud: Path, seed: int, options: dict[str, Any]) -> tuple[float, float]:
    """Return the wall time of the first of four reconstructions, and the median of the others [s]."""
    rc.GSRMConfig, rc.GrowingGridConfig  # noqa: B018  (imports JAX, which is not to be timed)
    points, seconds = rc.load_points(cloud), []
    for _ in range(4):
        start = time.perf_counter()
        rc.reconstruct(points, seed=seed, **options)
        seconds.append(time.perf_counter() - start)
    return seconds[0], float(np.median(seconds[1:]))
