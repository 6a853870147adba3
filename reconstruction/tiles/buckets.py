"""Points sorted into the files of their tiles, chunk by chunk."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction.progress import Progress, silent
from reconstruction.tiles.config import TilesConfig
from reconstruction.tiles.point_stream import PointStream

Place = tuple[int, int]
"""Column and row of a tile: it reaches from (column, row) times its edge to one more [m]."""
_MOST_PLACE = 2**20
"""Columns and rows; beyond are stray points."""


class Bucket(NamedTuple):
    """The points of a tile.

    Attributes:
        place: column and row of the tile.
        num_points: points in the tile itself.
        with_halo: points in the tile and its halo, which are in the file.
    """

    place: Place
    num_points: int
    with_halo: int


def fill_buckets(
    stream: PointStream, folder: Path, config: TilesConfig, progress: Progress = silent
) -> list[Bucket]:
    """Write the points of each tile and its halo into a file of its own, in single precision from its corner.

    Memory is that of a chunk, however many points there are; the disk needs 12 bytes a point, and the halo's share.

    Args:
        stream: the points.
        folder: an empty folder for the files.
        config: size of the tiles and of the halo.
        progress: called with each chunk.

    Returns:
        The tiles with points, ordered by place.
    """
    counts: dict[Place, int] = {}
    with_halo: dict[Place, int] = {}
    for number, chunk in enumerate(stream.chunks()):
        points = chunk - stream.offset
        points = points[(np.abs(points[:, :2]) < _MOST_PLACE * config.tile).all(axis=1)]
        own = np.floor(points[:, :2] / config.tile).astype(np.int64)
        _count(own, counts)
        for shift in ((x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)):
            chosen = _find_halo(points, own, shift, config)
            _append(points[chosen], own[chosen] + shift, folder, config.tile, with_halo)
        progress(f"points into tiles, chunk {number + 1}", 0.0)
    return [Bucket(place, counts[place], with_halo[place]) for place in sorted(counts)]


def read_bucket(path: Path) -> Float[np.ndarray, "N 3"]:
    """Return the points of a tile and its halo, relative to its corner [m]."""
    return np.fromfile(path, dtype=np.float32).reshape(-1, 3).astype(np.float64)


def name_bucket(folder: Path, place: Place) -> Path:
    """Return the file of a tile's points."""
    return folder / f"{place[0]}_{place[1]}.f4"


def _find_halo(
    points: Float[np.ndarray, "N 3"], own: Int[np.ndarray, "N 2"], shift: Place, config: TilesConfig
) -> Int[np.ndarray, " M"]:
    """Return the points that lie in the halo of the neighbor in a direction; for (0, 0) all."""
    is_near = np.ones(len(points), dtype=bool)
    for axis, step in enumerate(shift):
        if step:
            border = (own[:, axis] + (step > 0)) * config.tile
            is_near &= np.abs(points[:, axis] - border) <= config.width
    return np.flatnonzero(is_near)


def _append(
    points: Float[np.ndarray, "N 3"],
    places: Int[np.ndarray, "N 2"],
    folder: Path,
    tile: float,
    totals: dict[Place, int],
) -> None:
    """Append points to the files of their tiles."""
    if not len(points):
        return
    order = np.lexsort((places[:, 1], places[:, 0]))  # stable: points stay in the order of the source
    points, places = points[order], places[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(places, axis=0) != 0).any(axis=1)])
    for begin, end in zip(starts, [*starts[1:], len(points)], strict=True):
        place = (int(places[begin, 0]), int(places[begin, 1]))
        local = points[begin:end] - [place[0] * tile, place[1] * tile, 0.0]
        with name_bucket(folder, place).open("ab") as bucket:
            bucket.write(local.astype(np.float32).tobytes())
        totals[place] = totals.get(place, 0) + int(end - begin)


def _count(places: Int[np.ndarray, "N 2"], counts: dict[Place, int]) -> None:
    if not len(places):
        return
    different, numbers = np.unique(places, axis=0, return_counts=True)
    for place, number in zip(different.tolist(), numbers.tolist(), strict=True):
        key = (place[0], place[1])
        counts[key] = counts.get(key, 0) + number
