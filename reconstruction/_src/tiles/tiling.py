"""The surface of a scan that is too large for memory, tile by tile."""

from __future__ import annotations

import logging
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.tiles.folder import TiledSurface, claim_folder, name_tile, write_index
from reconstruction._src.tiles.point_stream import (
    Bucket,
    Place,
    TilesConfig,
    fill_buckets,
    name_bucket,
    open_points,
)
from reconstruction._src.tiles.seams import Surface, join_tile
from reconstruction._src.tiles.tile import find_tile_colors, read_surface, reconstruct_tile, write_surface
from reconstruction._src.tiles.workers import RunJobs, run_in_processes

_NEIGHBORS = tuple((x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if (x, y) != (0, 0))

_MOST_VIEWPOINTS = 64  # Viewpoints that a tile knows: the nearest

_logger = logging.getLogger(__name__)


def reconstruct_tiles(
    source: str | Path | ArrayLike | Cloud,
    folder: str | Path,
    config: TilesConfig | None = None,
    *,
    method: str = "gsrm",
    seed: int = 0,
    meters: float | None = None,
    viewpoints: ArrayLike | None = None,
    is_raw: bool = False,
    workers: int = 1,
    run_jobs: RunJobs | None = None,
    progress: Progress = silent,
) -> TiledSurface:
    """Reconstruct the surface of a large scan in tiles, and write it as a folder.

    Points are streamed into files, one for each tile and its halo. Each tile is reconstructed by itself; then the
    surfaces are cut at the borders of the tiles, and blended in the halos. Memory is that of the workers, however many
    points there are. Equal sources and seeds give equal files with any number of workers.

    Args:
        source: a file .las, .laz (laspy) or .npy, which are streamed; another point file, a cloud or an array `[N, 3]`.
            Where it has colors, so have the vertices of the tiles.
        folder: new, empty, or of a former reconstruction, whose tiles are replaced. Needs 12 bytes a point meanwhile.
        config: size of tiles and halos, resolution.
        method: "gsrm" or "gg".
        seed: equal seeds give equal surfaces.
        meters: length of a unit of the source [m]; None: what a .las or .laz says, else 1.
        viewpoints: `[3]` or `[K, 3]` positions of the sensor, in the coordinates of the source [m]: surfaces look to
            where they were seen from. Without them they look up.
        is_raw: leave out the filter for isolated points.
        workers: processes of this machine.
        run_jobs: runs the jobs elsewhere, in place of `workers`; `folder` must be visible there.
        progress: called with each step and the fraction done.

    Raises:
        ReconstructionError: no tile has a surface, the folder holds something else, or a worker died.
        ScanError: the source cannot be read.
        MissingExtraError: laspy is not installed.
    """
    config = config or TilesConfig()
    run_jobs = run_jobs or run_in_processes(workers)
    stream, folder = open_points(source, meters), Path(folder).absolute()
    positions = _read_viewpoints(viewpoints, stream.offset)
    claim_folder(folder)
    with tempfile.TemporaryDirectory(prefix=".working-", dir=folder) as temporary:
        working = Path(temporary)
        buckets = fill_buckets(stream, working, config, progress)
        common = {"seed": seed, "method": method, "is_raw": is_raw, "config": asdict(config)}
        jobs = [
            common
            | {
                "place": list(bucket.place),
                "points": str(name_bucket(working, bucket.place)),
                "columns": stream.columns,
                "viewpoints": _find_near_viewpoints(positions, bucket.place, config),
                "out": str(working / name_tile(bucket.place)),
            }
            for bucket in buckets
            if bucket.num_points
            >= config.points_per_unit  # not the one point that lies on the rim of the scan
        ]
        reports = _collect(run_jobs, reconstruct_tile, jobs, "surface of tile", 0.1, progress)
        places = {tuple(report["place"]) for report in reports if report["units"]}
        joins = [
            _make_join(bucket.place, places, working, folder, config) | {"columns": stream.columns}
            for bucket in buckets
            if bucket.place in places
        ]
        joined = _collect(run_jobs, finish_tile, joins, "seams of tile", 0.9, progress)
    entries = _describe(buckets, reports, joined)
    if not entries:
        problems = {report["problem"] for report in reports if report["problem"]}
        raise ReconstructionError(
            f"no tile has a surface: {'; '.join(sorted(problems)) or 'there are no points'}"
        )
    lost = sum(bucket.num_points for bucket in buckets) - sum(entry["points"] for entry in entries)
    if lost:
        _logger.warning("%d of the points lie in tiles with too few for a surface", lost)
    write_index(
        folder,
        {
            "complete": True,
            "tile": config.tile,
            "offset": [float(value) for value in stream.offset],
            "points": sum(bucket.num_points for bucket in buckets),
            "points_without_surface": lost,
            "method": method,
            "seed": seed,
            "config": asdict(config),
            "tiles": entries,
        },
    )
    return TiledSurface.load(folder)


def _read_viewpoints(viewpoints: ArrayLike | None, offset: Float[np.ndarray, " 3"]) -> np.ndarray | None:
    """Return positions of the sensor in the frame of the tiles."""
    if viewpoints is None:
        return None
    places = np.atleast_2d(np.asarray(viewpoints, dtype=np.float64))
    if places.ndim != 2 or places.shape[1] != 3 or not len(places) or not np.isfinite(places).all():
        raise ReconstructionError(
            f"viewpoints must be finite positions x, y, z in meters, got {viewpoints!r}"
        )
    return places - offset


def _find_near_viewpoints(
    positions: np.ndarray | None, place: Place, config: TilesConfig
) -> list[list[float]] | None:
    """Return the viewpoints nearest to a tile, in its own coordinates."""
    if positions is None:
        return None
    corner = np.array([*place, 0.0]) * config.tile
    distance = np.linalg.norm((positions - corner)[:, :2] - config.tile / 2, axis=1)
    return (positions[np.argsort(distance, kind="stable")[:_MOST_VIEWPOINTS]] - corner).tolist()


def finish_tile(job: dict[str, Any]) -> dict[str, Any]:
    """Cut and blend a tile with its neighbors, and write it to its place; a function of plain data, for any worker."""
    config = TilesConfig(**job["config"])
    neighbors = {(int(x), int(y)): Surface(*read_surface(Path(path))) for x, y, path in job["neighbors"]}
    own = Surface(*read_surface(Path(job["own"])))
    column, row = job["place"]
    joined = join_tile(own, neighbors, (column, row), config)
    colors = None
    if job.get("columns", 3) > 3 and len(joined.vertices):
        corner = np.array([column, row, 0.0]) * config.tile
        colors = find_tile_colors(Path(job["points"]), joined.vertices, corner)
    write_surface(Path(job["out"]), joined.vertices, joined.faces, colors)
    return {"place": job["place"], "faces": len(joined.faces)}


def _make_join(
    place: Place, places: set[Place], working: Path, folder: Path, config: TilesConfig
) -> dict[str, Any]:
    near = [(x, y) for x, y in _NEIGHBORS if (place[0] + x, place[1] + y) in places]
    return {
        "place": list(place),
        "config": asdict(config),
        "own": str(working / name_tile(place)),
        "points": str(name_bucket(working, place)),
        "out": str(folder / name_tile(place)),
        "neighbors": [[x, y, str(working / name_tile((place[0] + x, place[1] + y)))] for x, y in near],
    }


def _collect(
    run_jobs: RunJobs, work: Any, jobs: list[dict[str, Any]], name: str, begin: float, progress: Progress
) -> list[dict[str, Any]]:
    """Run jobs and report the progress: the surfaces take the most time."""
    share = 0.8 if begin < 0.5 else 0.1
    results = []
    for number, result in enumerate(run_jobs(work, jobs), start=1):
        progress(f"{name} {number} of {len(jobs)}", begin + share * number / len(jobs))
        results.append(result)
    return results


def _describe(
    buckets: list[Bucket], reports: list[dict[str, Any]], joined: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the entries of tiles that have a surface."""
    faces = {tuple(result["place"]): result["faces"] for result in joined}
    units = {tuple(report["place"]): report["units"] for report in reports}
    return [
        {"place": list(place), "points": num_points, "units": units[place], "faces": faces[place]}
        for place, num_points, _ in buckets
        if faces.get(place)
    ]
