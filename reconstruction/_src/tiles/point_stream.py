"""How a large scan is divided into tiles, and its points in chunks, so that no more than a chunk is in memory."""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from reconstruction._src.base.bounded_read import open_bounded
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import load_cloud
from reconstruction._src.scans.frames import find_offset
from reconstruction._src.scans.survey_files import find_las_units, iterate_las, open_las

Rows = Float[np.ndarray, "N columns"]  # x, y, z [m], and where there are colors red, green and blue

CHUNK = 1_000_000  # Points at a time: 24 MB, and a few times that while they are sorted into tiles
_SAMPLE = 100_000  # Points that say where the middle of a cloud is
_MAX_BYTE, _MAX_SHORT = 255, 65535
MOST_PLACE = 2**20  # Columns and rows; beyond are stray points

Place = tuple[int, int]
"""Column and row of a tile: it reaches from (column, row) times its edge to one more [m]."""


@dataclass(frozen=True)
class TilesConfig:
    """How a large scan is divided, and how finely its tiles are reconstructed.

    Attributes:
        tile: edge of a square tile [m]. A tile and its halo are reconstructed at once: memory grows with their
            points, and each tile costs a fixed second or so. 50 m of an aerial scan are 10^5 to 10^6 points.
        halo: how far a tile's points reach into its neighbors [m]; None: a tenth of the tile. In it, the surfaces of
            two neighbors are blended. It must span several units of the network; wider costs time.
        units_per_area: units of the network in a square meter; None: one for each 20 points. More than one for 20
            would learn the noise; a tile has at most 20,000.
    """

    tile: float = 50.0
    halo: float | None = None
    units_per_area: float | None = None

    def __post_init__(self) -> None:
        for name in ("tile", "units_per_area"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ReconstructionError(f"{name} is {value}; a number above 0 is needed")
        if self.halo is not None and not 0 < self.halo <= self.tile / 2:
            raise ReconstructionError(
                f"halo is {self.halo}; above 0 and up to half of the tile of {self.tile:g} m"
            )

    @property
    def width(self) -> float:
        """Width of the halo [m]."""
        return self.tile / 10 if self.halo is None else self.halo


class PointStream(NamedTuple):
    """Points that are read when they are needed, as often as wanted."""

    # returns the points in chunks `[N, 3]`, in the coordinates of the file [m]; with colors `[N, 6]`: red,
    # green and blue (0 to 255) behind them
    chunks: Callable[[], Iterator[Rows]]
    # what is to be subtracted from them [m]; zeros where they are near the origin
    offset: Float[np.ndarray, " 3"]
    columns: int = 3  # 3, or 6 with colors


def open_points(source: str | Path | ArrayLike | Cloud, meters: float | None = None) -> PointStream:
    """Open a file or an array of points for reading in chunks."""
    if isinstance(source, str | Path):
        path = Path(source)
        if not path.is_file():
            raise ScanError(f"{path}: no such file")
        if path.suffix.lower() in (".las", ".laz"):
            return _open_las(path, meters)
        source = _map_array(path) if path.suffix.lower() == ".npy" else load_cloud(path, any_size=True)
    colors = None
    if isinstance(source, Cloud):
        source, colors = source.points + source.offset, source.colors
    rows, factor = np.asarray(source), 1.0 if meters is None else meters
    if rows.ndim != 2 or rows.shape[1] < 3 or not np.issubdtype(rows.dtype, np.number):
        raise ScanError(f"points must be numbers of shape [N, 3], not {rows.dtype} of {rows.shape}")
    if not len(rows):
        raise ScanError("there are no points")

    def read() -> Iterator[Rows]:
        for start in range(0, len(rows), CHUNK):
            chunk = slice(start, start + CHUNK)
            points = rows[chunk, :3] * np.float64(factor)
            yield _drop_broken(points if colors is None else np.c_[points, colors[chunk]])

    sample = _drop_broken(rows[:: max(len(rows) // _SAMPLE, 1), :3] * np.float64(factor))
    offset = find_offset(sample) if len(sample) else np.zeros(3)
    return PointStream(read, offset, 3 if colors is None else 6)


def _map_array(path: Path) -> np.ndarray:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise ScanError(f"{path}: not an array of numbers ({error})") from error


def _open_las(path: Path, meters: float | None) -> PointStream:
    try:
        with open_bounded(path, math.inf) as file, open_las(file) as reader:
            header = reader.header
            corners, count = np.stack([header.mins, header.maxs]), header.point_count
            stated, height_factor = find_las_units(header)
            first = next((chunk.rows for chunk in iterate_las(reader)), np.zeros((0, 3)))
    except MissingExtraError:
        raise
    except Exception as error:  # laspy raises every kind of error on broken bytes
        raise ScanError(f"{path}: not readable as LAS ({error})") from error
    if not count:
        raise ScanError(f"{path}: there are no points")
    # Colors have 16 bits, or 8 in files of many writers; 0 is room for colors.
    largest = float(first[:, 3:].max(initial=0.0))
    columns, scale = 6 if largest else 3, 1.0 if largest <= _MAX_BYTE else _MAX_BYTE / _MAX_SHORT
    lengths = (meters or stated or 1.0) * np.array([1.0, 1.0, height_factor])
    factors = np.array([*lengths, scale, scale, scale])[:columns]

    def read() -> Iterator[Rows]:
        with open_bounded(path, math.inf) as file, open_las(file) as reader:
            for chunk in iterate_las(reader):
                yield _drop_broken(chunk.rows[:, :columns] * factors)

    return PointStream(read, find_offset(corners * lengths), columns)


def _drop_broken(points: Rows) -> Float[np.ndarray, "M columns"]:
    is_finite = np.isfinite(points[:, :3]).all(axis=1)
    return points if is_finite.all() else points[is_finite]


def fill_buckets(
    stream: PointStream, folder: Path, config: TilesConfig, progress: Progress = silent
) -> Counter[Place]:
    """Write the points of each tile and its halo into a file of its own, in single precision from its corner.

    Memory is that of a chunk, however many points there are; the disk needs 12 bytes a point, and the halo's share.
    Returns how many points lie in each tile itself.
    """
    counts: Counter[Place] = Counter()
    for number, points in enumerate(stream.chunks()):
        points[:, :3] -= stream.offset
        points = points[(np.abs(points[:, :2]) < MOST_PLACE * config.tile).all(axis=1)]
        own = np.floor(points[:, :2] / config.tile).astype(np.int64)
        depth = points[:, :2] - own * config.tile
        is_near = {
            -1: depth <= config.width,
            0: np.ones(depth.shape, dtype=bool),
            1: depth >= config.tile - config.width,
        }
        for x, y in itertools.product((-1, 0, 1), repeat=2):
            chosen = np.flatnonzero(is_near[x][:, 0] & is_near[y][:, 1])
            places = own[chosen] + (x, y)
            _append(points[chosen], places, folder, config.tile, counts if (x, y) == (0, 0) else Counter())
        progress(f"points into tiles, chunk {number + 1}", 0.0)
    return counts


def read_bucket(path: Path, columns: int = 3) -> Float[np.ndarray, "N {columns}"]:
    """Return the points of a tile and its halo, relative to its corner [m]; their colors behind them in 6 columns."""
    return np.fromfile(path, dtype=np.float32).reshape(-1, columns).astype(np.float64)


def name_bucket(folder: Path, place: Place) -> Path:
    """Return the file of a tile's points."""
    return folder / f"{place[0]}_{place[1]}.f4"


def _append(
    points: Rows, places: Int[np.ndarray, "N 2"], folder: Path, tile: float, counts: Counter[Place]
) -> None:
    """Append points to the files of their tiles, and count them."""
    order = np.lexsort(places.T)  # stable: points stay in the order of the source
    points, places = points[order], places[order]
    cuts = np.flatnonzero((np.diff(places, axis=0) != 0).any(axis=1)) + 1
    for part, own in zip(np.split(points, cuts), np.split(places, cuts), strict=True):
        if len(part):
            column, row = own[0].tolist()
            part[:, :2] -= own * tile
            with name_bucket(folder, (column, row)).open("ab") as bucket:
                bucket.write(part.astype(np.float32).tobytes())
            counts[column, row] += len(part)
