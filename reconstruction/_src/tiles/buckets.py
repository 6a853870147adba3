"""Points sorted into the files of their tiles, chunk by chunk."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.tiles.config import TilesConfig
from reconstruction._src.tiles.point_stream import PointStream

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
    """
    counts: dict[Place, int] = {}
    with_halo: dict[Place, int] = {}
    for number, chunk in enumerate(stream.chunks()):
        points = chunk - np.append(stream.offset, np.zeros(stream.columns - 3))
        points = points[(np.abs(points[:, :2]) < _MOST_PLACE * config.tile).all(axis=1)]
        own = np.floor(points[:, :2] / config.tile).astype(np.int64)
        _count(own, counts)
        is_near = _find_near(points, own, config)
        for shift in ((x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)):
            chosen = np.flatnonzero(is_near[0, shift[0]] & is_near[1, shift[1]])
            _append(points[chosen], own[chosen] + shift, folder, config.tile, with_halo)
        progress(f"points into tiles, chunk {number + 1}", 0.0)
    return [Bucket(place, counts[place], with_halo[place]) for place in sorted(counts)]


def read_bucket(path: Path, columns: int = 3) -> Float[np.ndarray, "N {columns}"]:
    """Return the points of a tile and its halo, relative to its corner [m]; their colors behind them in 6 columns."""
    return np.fromfile(path, dtype=np.float32).reshape(-1, columns).astype(np.float64)


def name_bucket(folder: Path, place: Place) -> Path:
    """Return the file of a tile's points."""
    return folder / f"{place[0]}_{place[1]}.f4"


def _find_near(
    points: Float[np.ndarray, "N columns"], own: Int[np.ndarray, "N 2"], config: TilesConfig
) -> dict[Place, Bool[np.ndarray, " N"]]:
    """Return which points are near the border in a direction: (axis, step) -> bool; for step 0 all."""
    is_near = {}
    for axis in (0, 1):
        depth = points[:, axis] - own[:, axis] * config.tile
        is_near[axis, -1] = depth <= config.width
        is_near[axis, 0] = np.ones(len(points), dtype=bool)
        is_near[axis, 1] = depth >= config.tile - config.width
    return is_near


def _append(
    points: Float[np.ndarray, "N columns"],
    places: Int[np.ndarray, "N 2"],
    folder: Path,
    tile: float,
    totals: dict[Place, int],
) -> None:
    """Append points to the files of their tiles."""
    if not len(points):
        return
    numbers = places[:, 0] * (4 * _MOST_PLACE) + places[:, 1]
    order = np.argsort(numbers, kind="stable")  # points stay in the order of the source
    points, places = points[order], places[order]
    starts = np.flatnonzero(np.r_[True, np.diff(numbers[order]) != 0])
    for begin, end in zip(starts, [*starts[1:], len(points)], strict=True):
        place = (int(places[begin, 0]), int(places[begin, 1]))
        corner = np.zeros(points.shape[1])
        corner[:2] = place[0] * tile, place[1] * tile
        local = points[begin:end] - corner
        with name_bucket(folder, place).open("ab") as bucket:
            bucket.write(local.astype(np.float32).tobytes())
        totals[place] = totals.get(place, 0) + int(end - begin)


def _count(places: Int[np.ndarray, "N 2"], counts: dict[Place, int]) -> None:
    different, numbers = np.unique(places[:, 0] * (4 * _MOST_PLACE) + places[:, 1], return_counts=True)
    for place, number in zip(different.tolist(), numbers.tolist(), strict=True):
        column = (place + 2 * _MOST_PLACE) // (4 * _MOST_PLACE)
        key = (column, place - column * 4 * _MOST_PLACE)
        counts[key] = counts.get(key, 0) + number
