"""One tile: from its points to its surface, halo included. A function of plain data, for any worker."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import find_npz_names, read_npz
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.preprocess import preprocess
from reconstruction._src.surfaces.color import WHITE, ColorSource
from reconstruction._src.tiles.point_stream import TilesConfig, read_bucket

_STEPS_PER_OCTAVE = 4
"""Numbers of units come in steps of 2^(1/4): the programs of a network are compiled for each number of units and
points, which takes seconds. With fewer steps, tiles lose more of their points."""


def reconstruct_tile(job: dict[str, Any]) -> dict[str, Any]:
    """Reconstruct a tile with its halo and write its surface, in coordinates of the whole scan."""
    config = TilesConfig(**job["config"])
    points = np.ascontiguousarray(read_bucket(Path(job["points"]), job.get("columns", 3))[:, :3])
    report = {"place": job["place"], "units": 0, "used": 0, "problem": None}
    try:
        if not job["is_raw"]:
            points = np.asarray(preprocess(points), dtype=np.float64)
        units = choose_units(points, config)
        if not units:
            return report | {"problem": f"{len(points)} points are too few"}
        points = _sample(
            points, round(units * config.points_per_unit), [job["seed"], *_as_unsigned(job["place"])]
        )
        viewpoints = job.get("viewpoints")
        mesh = reconstruct(
            points, method=job["method"], units=units, seed=job["seed"], viewpoints=viewpoints
        ).mesh
    except (ReconstructionError, ScanError) as error:
        return report | {"problem": str(error)}
    corner = np.array([*job["place"], 0.0]) * config.tile
    write_surface(Path(job["out"]), np.asarray(mesh.vertices) + corner, np.asarray(mesh.faces))
    return report | {"units": units, "used": len(points)}


def choose_units(points: Float[np.ndarray, "N 3"], config: TilesConfig) -> int:
    """Return the units for the points of a tile, one of a ladder of numbers; 0 where there are too few points."""
    most = min(len(points) / config.points_per_unit, config.max_units)
    if config.units_per_area is not None:
        most = min(most, config.units_per_area * _compute_area(points, config))
    if most < config.min_units:
        return 0
    step = np.floor(_STEPS_PER_OCTAVE * np.log2(most))
    return max(int(2 ** (step / _STEPS_PER_OCTAVE)), config.min_units)


def write_surface(
    path: Path,
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    colors: UInt8[np.ndarray, "V 3"] | None = None,
) -> None:
    """Write the surface of a tile, with the colors of its vertices where they are known."""
    arrays = {"vertices": vertices, "faces": faces.astype(np.int32)}
    if colors is not None:
        arrays["colors"] = colors
    with write_atomically(path) as temporary:
        np.savez_compressed(temporary, **arrays)  # pyright: ignore[reportArgumentType]


def read_colors(path: Path) -> UInt8[np.ndarray, "V 3"] | None:
    """Read the colors of the vertices of a tile, or None."""
    try:
        if "colors" not in find_npz_names(path):
            return None
        arrays = read_npz(path, ("vertices", "colors"))
        colors = arrays["colors"]
        if colors.dtype != np.uint8 or colors.shape != (len(arrays["vertices"]), 3):
            raise ValueError(f"colors are {colors.dtype} of {colors.shape}")
    except (OSError, ValueError, KeyError) as error:
        raise ReconstructionError(
            f"{path}: no colors of a tile ({error}); reconstruct the scan again"
        ) from error
    return colors


def find_tile_colors(
    bucket: Path, vertices: Float[np.ndarray, "V 3"], corner: Float[np.ndarray, " 3"]
) -> UInt8[np.ndarray, "V 3"]:
    """Return the colors of the vertices of a tile, of its points and those of its halo."""
    rows = read_bucket(bucket, columns=6)
    colored = Cloud(rows[:, :3], np.clip(np.round(rows[:, 3:]), 0, WHITE).astype(np.uint8))
    return ColorSource(colored).find_colors(vertices - corner)


def read_surface(path: Path) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Read the surface of a tile."""
    try:
        arrays = read_npz(path, ("vertices", "faces"))
        vertices, faces = arrays["vertices"].astype(np.float64), arrays["faces"].astype(np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError("not a mesh of triangles")
        if not np.isfinite(vertices).all() or (
            len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices)
        ):
            raise ValueError("a face names a vertex that is not there")
    except (OSError, ValueError, KeyError) as error:
        raise ReconstructionError(
            f"{path}: no surface of a tile ({error}); reconstruct the scan again"
        ) from error
    return vertices, faces


def _compute_area(points: Float[np.ndarray, "N 3"], config: TilesConfig) -> float:
    """Return the area of a tile and its halo that has points [m²], in cells of a twentieth of the tile."""
    cells = np.floor(points[:, :2] / (config.tile / 20)).astype(np.int64)
    return len(np.unique(cells, axis=0)) * (config.tile / 20) ** 2


def _sample(points: Float[np.ndarray, "N 3"], count: int, seed: list[int]) -> Float[np.ndarray, "M 3"]:
    """Return as many points by chance, in their order."""
    if len(points) <= count:
        return points
    chosen = np.random.default_rng(seed).choice(len(points), count, replace=False, shuffle=False)
    return points[np.sort(chosen)]


def _as_unsigned(place: list[int]) -> list[int]:
    return [number % 2**32 for number in place]
