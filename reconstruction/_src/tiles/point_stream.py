"""Points of a large file in chunks, so that no more than a chunk is in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import load_cloud
from reconstruction._src.scans.formats import load_points
from reconstruction._src.scans.las import find_las_units
from reconstruction._src.scans.point_rows import COLORS

CHUNK = 1_000_000  # Points at a time: 24 MB, and a few times that while they are sorted into tiles
_SAMPLE = 100_000  # Points that say where the middle of a cloud is
_FAR = 1000.0
"""Clouds whose middle is farther from the origin are moved there [m]: beyond, single precision loses 0.1 mm."""
_COLORED = 6  # Columns of points with colors
_MAX_BYTE, _MAX_SHORT = 255, 65535
_NOISE_CLASSES = (7, 18)  # LAS 1.4, table 17: low point (noise), high noise


class PointStream(NamedTuple):
    """Points that are read when they are needed, as often as wanted."""

    # returns the points in chunks `[N, 3]`, in the coordinates of the file [m]; with colors `[N, 6]`: red,
    # green and blue (0 to 255) behind them
    chunks: Callable[[], Iterator[Float[np.ndarray, "N columns"]]]
    # what is to be subtracted from them [m]; zeros where they are near the origin
    offset: Float[np.ndarray, " 3"]
    columns: int = 3  # 3, or 6 with colors


def open_points(source: str | Path | ArrayLike | Cloud, meters: float | None = None) -> PointStream:
    """Open a file or an array of points for reading in chunks."""
    path = Path(source) if isinstance(source, str | Path) else None
    if path is not None and not path.is_file():
        raise ScanError(f"{path}: no such file")
    if path is not None and path.suffix.lower() in (".las", ".laz"):
        return _open_las(path, meters)
    meters = 1.0 if meters is None else meters
    if path is not None and path.suffix.lower() == ".npy":
        rows = _map_array(path)
    else:
        rows = _load_rows(source) if path is None else _load_rows(path)
    if rows.ndim != 2 or rows.shape[1] < 3 or not np.issubdtype(rows.dtype, np.number):
        raise ScanError(f"points must be numbers of shape [N, 3], not {rows.dtype} of {rows.shape}")
    if not len(rows):
        raise ScanError("there are no points")

    columns = _COLORED if isinstance(rows, _ColoredRows) else 3

    def read() -> Iterator[Float[np.ndarray, "N columns"]]:
        for start in range(0, len(rows), CHUNK):
            yield _as_meters(rows[start : start + CHUNK, :columns], meters)

    sample = _as_meters(rows[:: max(len(rows) // _SAMPLE, 1), :3], meters)
    return PointStream(read, _find_offset(np.median(sample, axis=0) if len(sample) else np.zeros(3)), columns)


class _ColoredRows(np.ndarray):
    """Rows of positions and colors, rather than an array of a user with more columns."""


def _load_rows(source: Path | ArrayLike) -> np.ndarray:
    """Return positions, with colors behind them where the source is a cloud or a file with colors."""
    if isinstance(source, Path):
        points, cloud = load_points(source), load_cloud(source)
    elif isinstance(source, Cloud):
        points, cloud = source.points + source.offset, source
    else:
        return np.asarray(source)
    if cloud.colors is None or cloud.num_points != len(points):
        return points
    return np.concatenate([points, cloud.colors], axis=1).view(_ColoredRows)


def _map_array(path: Path) -> np.ndarray:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise ScanError(f"{path}: not an array of numbers ({error})") from error


def _open_las(path: Path, meters: float | None) -> PointStream:
    try:
        import laspy
    except ImportError as error:
        raise MissingExtraError(
            f"a {path.suffix} file needs laspy, which is not installed: pip install 'symbrion-gym[formats]'"
        ) from error

    def read() -> Iterator[Float[np.ndarray, "N columns"]]:
        with path.open("rb") as file, laspy.LasReader(file, closefd=False) as reader:
            for chunk in reader.chunk_iterator(CHUNK):
                names = ("x", "y", "z", *(COLORS if scale else ()))
                points = np.stack([np.asarray(chunk[name], dtype=np.float64) for name in names], axis=1)
                points[:, 3:] *= scale
                yield _as_meters(points[_select_usable(chunk)], lengths)

    try:
        with path.open("rb") as file, laspy.LasReader(file, closefd=False) as reader:
            header = reader.header
            low, high, count = np.array(header.mins), np.array(header.maxs), header.point_count
            stated, height_factor = find_las_units(header)
            scale = _find_color_scale(next(iter(reader.chunk_iterator(CHUNK)), None), header)
    except (laspy.LaspyException, OSError, ValueError) as error:
        raise ScanError(f"{path}: not readable as LAS ({error})") from error
    if not count:
        raise ScanError(f"{path}: there are no points")
    unit = (stated or 1.0) if meters is None else meters
    lengths = unit * np.array([1.0, 1.0, height_factor])
    return PointStream(read, _find_offset(lengths * (low + high) / 2), _COLORED if scale else 3)


def _find_color_scale(chunk: Any, header: Any) -> float:
    """Return the factor from the colors of a .las to bytes, by its first points: 16 bits or 8; 0 without colors."""
    if chunk is None or not {*COLORS} <= set(header.point_format.dimension_names):
        return 0.0
    largest = max(int(np.max(np.asarray(chunk[name]), initial=0)) for name in COLORS)
    return 0.0 if not largest else 1.0 if largest <= _MAX_BYTE else _MAX_BYTE / _MAX_SHORT


def _select_usable(chunk: Any) -> np.ndarray:
    """Return which points are neither withheld nor noise."""
    is_noise = np.isin(np.asarray(chunk["classification"]), _NOISE_CLASSES)
    return ~(is_noise | np.asarray(chunk["withheld"]).astype(bool))


def _as_meters(rows: np.ndarray, meters: float | Float[np.ndarray, " 3"]) -> Float[np.ndarray, "N columns"]:
    """Return rows in double precision, without those that are not finite."""
    points = np.array(rows, dtype=np.float64)
    points[:, :3] *= meters
    is_finite = np.isfinite(points[:, :3]).all(axis=1)
    return points if is_finite.all() else points[is_finite]


def _find_offset(middle: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return the middle in whole meters, where it is far from the origin."""
    return np.round(middle) if np.abs(middle).max() > _FAR else np.zeros(3)


@dataclass(frozen=True)
class TilesConfig:
    """How a large scan is divided, and how finely its tiles are reconstructed.

    Attributes:
        tile: edge of a square tile [m]. A tile and its halo are reconstructed at once: memory grows with their
            points, and each tile costs a fixed second or so. 50 m of an aerial scan are 10^5 to 10^6 points.
        halo: how far a tile's points reach into its neighbors [m]; None: a tenth of the tile. In it, the surfaces of
            two neighbors are blended. It must span several units of the network; wider costs time.
        units_per_area: units of the network in a square meter; None: one for each `points_per_unit` points.
        points_per_unit: points for each unit at least: with fewer, a network learns the noise.
        max_units: most units of a tile; bounds time and memory of a tile.
        min_units: a tile with points for fewer is left out, and counted: a rim that hardly has points.
        max_gap: seams are joined where the surfaces of both tiles are at most this far from each other, as a share
            of the halo. Further apart they are different surfaces, such as a roof and the ground.
    """

    tile: float = 50.0
    halo: float | None = None
    units_per_area: float | None = None
    points_per_unit: float = 20.0
    max_units: int = 20_000
    min_units: int = 25
    max_gap: float = 0.5

    def __post_init__(self) -> None:
        for name in ("tile", "points_per_unit", "max_units", "max_gap"):
            if not getattr(self, name) > 0:
                raise ReconstructionError(f"{name} is {getattr(self, name)}; a number above 0 is needed")
        if self.min_units < 4:
            raise ReconstructionError(f"min_units is {self.min_units}; a network begins with 4 units")
        if self.units_per_area is not None and not self.units_per_area > 0:
            raise ReconstructionError(
                f"units_per_area is {self.units_per_area}; a number above 0 is needed, or None"
            )
        if self.halo is not None and not 0 < self.halo <= self.tile / 2:
            raise ReconstructionError(
                f"halo is {self.halo}; above 0 and up to half of the tile ({self.tile / 2:g} m)"
            )

    @property
    def width(self) -> float:
        """Width of the halo [m]."""
        return self.tile / 10 if self.halo is None else self.halo


Place = tuple[int, int]
"""Column and row of a tile: it reaches from (column, row) times its edge to one more [m]."""
_MOST_PLACE = 2**20  # Columns and rows; beyond are stray points


class Bucket(NamedTuple):
    """The points of a tile."""

    place: Place  # column and row of the tile
    num_points: int  # points in the tile itself
    with_halo: int  # points in the tile and its halo, which are in the file


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
