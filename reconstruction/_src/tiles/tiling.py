"""The surface of a scan that is too large for memory, tile by tile."""

import itertools
import logging
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.preprocess import preprocess
from reconstruction._src.surfaces.color import WHITE, ColorSource
from reconstruction._src.tiles.folder import (
    TiledSurface,
    claim_folder,
    name_tile,
    read_surface,
    write_index,
    write_surface,
)
from reconstruction._src.tiles.point_stream import (
    Place,
    TilesConfig,
    fill_buckets,
    name_bucket,
    open_points,
    read_bucket,
)
from reconstruction._src.tiles.seams import join_tile
from reconstruction._src.tiles.workers import Job, RunJobs, Work, run_in_processes

_NEIGHBORS = [shift for shift in itertools.product((-1, 0, 1), repeat=2) if shift != (0, 0)]
_MOST_VIEWPOINTS = 64  # Viewpoints that a tile knows: the nearest
_POINTS_PER_UNIT = 20.0  # Points for each unit at least: with fewer, a network learns the noise
_MIN_UNITS, _MAX_UNITS = 25, 20_000  # Of a tile; one with points for fewer is left out: a rim
_STEPS_PER_OCTAVE = 4  # Units come in steps of 2^(1/4): programs are compiled for each number, for seconds

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
        progress: called with each step and the fraction done.

    Raises:
        ReconstructionError: no tile has a surface, the folder holds something else, or a worker died.
        ScanError: the source cannot be read.
        MissingExtraError: laspy is not installed.
    """
    config = config or TilesConfig()
    run_jobs = run_in_processes(workers)
    stream, folder = open_points(source, meters), Path(folder).absolute()
    positions = None
    if viewpoints is not None:
        seen = Cloud(stream.offset[None], viewpoints=np.asarray(viewpoints))  # checks them
        positions = seen.viewpoints - stream.offset
    claim_folder(folder)
    with tempfile.TemporaryDirectory(prefix=".working-", dir=folder) as temporary:
        working = Path(temporary)
        counts = fill_buckets(stream, working, config, progress)

        def make_job(place: Place) -> Job:
            return {
                "place": list(place),
                "config": asdict(config),
                "points": str(name_bucket(working, place)),
                "columns": stream.columns,
                "surface": str(working / name_tile(place)),
            }

        jobs = [
            make_job(place)
            | {"seed": seed, "method": method, "is_raw": is_raw}
            | {"viewpoints": _find_near_viewpoints(positions, place, config)}
            for place in sorted(counts)
            if counts[place] >= _POINTS_PER_UNIT  # not the one point that lies on the rim of the scan
        ]
        reports = _collect(run_jobs, reconstruct_tile, jobs, "surface of tile", (0.1, 0.9), progress)
        units = {tuple(report["place"]): report["units"] for report in reports if report["units"]}
        joins = []
        for x, y in units:
            near = [shift for shift in _NEIGHBORS if (x + shift[0], y + shift[1]) in units]
            neighbors = [[i, j, str(working / name_tile((x + i, y + j)))] for i, j in near]
            joins.append(make_job((x, y)) | {"out": str(folder / name_tile((x, y))), "neighbors": neighbors})
        joined = _collect(run_jobs, finish_tile, joins, "seams of tile", (0.9, 1.0), progress)
    faces = {tuple(result["place"]): result["faces"] for result in joined}
    entries = [
        {"place": list(place), "points": counts[place], "units": units[place], "faces": faces[place]}
        for place in units
        if faces[place]
    ]
    if not entries:
        problems = {report["problem"] for report in reports if report["problem"]}
        raise ReconstructionError(f"no tile has a surface: {'; '.join(sorted(problems)) or 'no points'}")
    num_points = counts.total()
    lost = num_points - sum(entry["points"] for entry in entries)
    if lost:
        _logger.warning("%d of the points lie in tiles with too few for a surface", lost)
    index = {
        "complete": True,
        "tile": config.tile,
        "offset": stream.offset.tolist(),
        "points": num_points,
        "points_without_surface": lost,
        "method": method,
        "seed": seed,
        "config": asdict(config),
        "tiles": entries,
    }
    write_index(folder, index)
    return TiledSurface.load(folder)


def _find_near_viewpoints(
    positions: Float[np.ndarray, "K 3"] | None, place: Place, config: TilesConfig
) -> list[list[float]] | None:
    """Return the viewpoints nearest to a tile, in its own coordinates."""
    if positions is None:
        return None
    local = positions - np.array([*place, 0.0]) * config.tile
    distance = np.linalg.norm(local[:, :2] - config.tile / 2, axis=1)
    return local[np.argsort(distance, kind="stable")[:_MOST_VIEWPOINTS]].tolist()


def _collect(
    run_jobs: RunJobs, work: Work, jobs: list[Job], name: str, span: tuple[float, float], progress: Progress
) -> list[Job]:
    """Run jobs and report the progress: the surfaces take the most time."""
    results = []
    for number, result in enumerate(run_jobs(work, jobs), start=1):
        progress(f"{name} {number} of {len(jobs)}", span[0] + (span[1] - span[0]) * number / len(jobs))
        results.append(result)
    return results


def reconstruct_tile(job: Job) -> Job:
    """Reconstruct a tile with its halo and write its surface, in coordinates of the whole scan; for any worker."""
    config = TilesConfig(**job["config"])
    points = np.ascontiguousarray(read_bucket(Path(job["points"]), job["columns"])[:, :3])
    report = {"place": job["place"], "units": 0, "problem": None}
    try:
        if not job["is_raw"]:
            points = preprocess(points)
        units = choose_units(points, config)
        if not units:
            return report | {"problem": f"{len(points)} points are too few"}
        count = round(units * _POINTS_PER_UNIT)
        if len(points) > count:  # as many by chance, in their order
            seeds = [job["seed"], *(number % 2**32 for number in job["place"])]
            rng = np.random.default_rng(seeds)
            points = points[np.sort(rng.choice(len(points), count, replace=False, shuffle=False))]
        made = reconstruct(
            points, method=job["method"], units=units, seed=job["seed"], viewpoints=job["viewpoints"]
        )
    except (ReconstructionError, ScanError) as error:
        return report | {"problem": str(error)}
    corner = np.array([*job["place"], 0.0]) * config.tile
    write_surface(Path(job["surface"]), made.mesh.vertices + corner, np.asarray(made.mesh.faces))
    return report | {"units": units}


def choose_units(points: Float[np.ndarray, "N 3"], config: TilesConfig) -> int:
    """Return the units for the points of a tile, one of a ladder of numbers; 0 where there are too few points."""
    most = min(len(points) / _POINTS_PER_UNIT, _MAX_UNITS)
    if config.units_per_area is not None:
        cell = config.tile / 20  # the area that has points is counted in such cells
        num_cells = len(np.unique(np.floor(points[:, :2] / cell).astype(np.int64), axis=0))
        most = min(most, config.units_per_area * num_cells * cell**2)
    if most < _MIN_UNITS:
        return 0
    step = np.floor(_STEPS_PER_OCTAVE * np.log2(most))
    return max(int(2 ** (step / _STEPS_PER_OCTAVE)), _MIN_UNITS)


def finish_tile(job: Job) -> Job:
    """Cut and blend a tile with its neighbors, and write it to its place."""
    config = TilesConfig(**job["config"])
    neighbors = {(int(x), int(y)): read_surface(Path(path))[0] for x, y, path in job["neighbors"]}
    column, row = job["place"]
    joined = join_tile(read_surface(Path(job["surface"]))[0], neighbors, (column, row), config)
    colors = None
    if job["columns"] > 3 and len(joined.vertices):
        rows = read_bucket(Path(job["points"]), job["columns"])
        colored = Cloud(rows[:, :3], np.clip(np.round(rows[:, 3:]), 0, WHITE).astype(np.uint8))
        corner = np.array([column, row, 0.0]) * config.tile
        colors = ColorSource(colored).find_colors(joined.vertices - corner)
    write_surface(Path(job["out"]), joined.vertices, joined.faces, colors)
    return {"place": job["place"], "faces": len(joined.faces)}
