"""Rows of a file, lines of text or binary records, as points: read in blocks into memory that was checked before."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from io import TextIOWrapper

import numpy as np
from jaxtyping import Float, UInt8, UInt32
from numpy.typing import ArrayLike

from reconstruction._src.base.bounded_read import BoundedFile, DamagedError, check_size
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.scans.frames import RawPoints, as_colors

FLATNESS = 1e-6
"""A cloud thinner than this share of its length in two directions is a line: far below the noise of any scanner, and
above the rounding errors of single precision."""
MIN_UNITS = _MIN_POINTS = 4  # A tetrahedron: fewer points span no closed surface
_MAX_COORDINATE = 1e100  # No length; and products of three larger coordinates overflow
_SAME_PLACE = 1e-12  # Extent over coordinates below which rounding errors are all there is of a cloud


def check_points(points: ArrayLike) -> Float[np.ndarray, "N 3"]:
    """Return points of any real number type in any memory order as a contiguous float64 array."""
    try:
        array = np.asarray(points)
        if array.dtype.kind not in "fiu":
            raise TypeError(f"values are {array.dtype}")
    except (TypeError, ValueError) as error:
        raise ReconstructionError(f"points must be real numbers of the shape [N, 3]: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise ReconstructionError(f"points must have the shape [N, 3], got {list(array.shape)}")
    if len(array) < _MIN_POINTS:
        raise ReconstructionError(f"a surface needs at least {_MIN_POINTS} points, got {len(array)}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        is_finite = np.isfinite(array).all(axis=1)
        raise ReconstructionError(
            f"{int((~is_finite).sum())} of {len(array)} points hold NaN or infinity (the first at row "
            f"{int(np.argmin(is_finite))}); drop them: points[np.isfinite(points).all(axis=1)]"
        )
    _check_extent(array)
    return array


def check_number(points: Float[np.ndarray, "N 3"], units: int) -> None:
    """Refuse more units than there are distinct points."""
    distinct = len(points)
    if units <= distinct and len(np.unique(points[:, 0])) < units:
        distinct = len(np.unique(points, axis=0))
    if units > distinct:
        raise ReconstructionError(
            f"{units} units are more than the {distinct} distinct points; ask for at most {distinct}, "
            "better for a tenth"
        )


def _check_extent(points: Float[np.ndarray, "N 3"]) -> None:
    """Refuse clouds that lie in one place or on one line, and coordinates that would overflow."""
    axes = np.ascontiguousarray(points.T)  # rows as long as the cloud: several times as fast
    extent = np.ptp(axes, axis=1).max()
    magnitude = np.abs(axes).max()
    if not np.isfinite(extent) or magnitude > _MAX_COORDINATE:
        raise ReconstructionError(f"coordinates up to {magnitude:.3g} are too large; what is their unit?")
    if extent <= _SAME_PLACE * magnitude or extent == 0:
        raise ReconstructionError(f"all {len(points)} points lie in one place, {points[0].tolist()}")
    centered = (axes - axes.mean(axis=1, keepdims=True)) / extent
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(centered @ centered.T), 0))
    if values[1] <= FLATNESS * values[2]:
        raise ReconstructionError(f"all {len(points)} points lie on one line, they hold no surface")


def check_seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ReconstructionError(f"seed must be a whole number from 0 on, got {seed!r}")
    return int(seed)


COLORS = ("red", "green", "blue")  # Names of the columns of a point's color
POINT_BYTES = 3 * np.dtype(np.float64).itemsize
_MAX_LINE = 1 << 20  # Longest line of text or binary record [characters, bytes]
_MAX_HEADER = 1 << 20  # Longest text before binary data [bytes]: parsed, it takes many times that in memory
_BLOCK_LINES = 50_000  # Lines that are parsed at once, where they are short: larger blocks are no faster
_SHOWN = 60  # Characters of a line that an error shows
_BLOCK_CHARACTERS = 1 << 22  # Characters parsed at once: as many numbers take twenty times that in memory
_MAX_DIGITS = 19  # Digits of the largest 64-bit number: no file has more points


def check_num_points(file: BoundedFile, num_points: int) -> None:
    """Check that the file's limit allows for an array of this many points."""
    check_size(POINT_BYTES * num_points, file.max_bytes)


def allocate_points(file: BoundedFile, num_points: int) -> Float[np.ndarray, "N 3"]:
    """Return an uninitialized array for this many points, if the file's limit allows."""
    check_num_points(file, num_points)
    return np.empty((num_points, 3))


def read_lines(file: BoundedFile) -> Iterator[str]:
    """Yield the lines of text from here on; a byte order mark is skipped."""
    text = TextIOWrapper(file.stream, encoding="utf-8-sig")
    try:
        while line := text.readline(_MAX_LINE):
            if len(line) == _MAX_LINE or "\0" in line:
                raise ScanError("holds binary data, not lines of text")
            yield line
    except UnicodeDecodeError as error:
        raise ScanError(f"holds binary data, not text: {error}") from error


def read_header_line(file: BoundedFile) -> str:
    """Return the next line of the text before binary data, without surrounding blanks."""
    if file.stream.tell() > _MAX_HEADER:
        raise ScanError(f"the header is longer than {_MAX_HEADER} bytes")
    line = file.stream.readline(_MAX_LINE)
    if not line.endswith(b"\n"):
        raise DamagedError("ends before its data, or has no header")
    return line.decode("latin1").strip()


def next_block(lines: Iterator[str]) -> list[str]:
    """Return the next lines, as many as are parsed at once; none at the end."""
    block, num_characters = [], 0
    while len(block) < _BLOCK_LINES and num_characters < _BLOCK_CHARACTERS and (line := next(lines, "")):
        block.append(line)
        num_characters += len(line)
    return block


def read_text_rows(
    file: BoundedFile,
    lines: Iterable[str],
    columns: Sequence[int],
    delimiter: str | None = None,
    comments: str | None = "#",
) -> Float[np.ndarray, "N C"]:
    """Read columns of numbers, one row a line; blank lines are skipped."""
    check_num_points(file, file.num_lines)
    values, num_read, remaining = np.empty((file.num_lines, len(columns))), 0, iter(lines)
    parse = partial(np.loadtxt, delimiter=delimiter, comments=comments, usecols=columns, ndmin=2)
    while block := next_block(remaining):
        with warnings.catch_warnings(action="ignore"):  # a block of comments alone
            try:
                rows = parse(block)
            except ValueError:
                _refuse_odd_row(block, parse, num_read)
                raise
        values[num_read : num_read + len(rows)] = rows
        num_read += len(rows)
    return values[:num_read]


def _refuse_odd_row(
    lines: Sequence[str], parse: Callable[[Sequence[str]], np.ndarray], num_before: int
) -> None:
    """Raise an error that shows the first line that is not a row of numbers."""
    for number, line in enumerate(lines, num_before + 1):
        try:
            parse([line])
        except ValueError as error:
            raise ScanError(f"row {number} is not numbers: {line.strip()[:_SHOWN]!r}") from error


def split_colors(values: Float[np.ndarray, "N C"]) -> RawPoints:
    """Return rows x, y, z, or x, y, z, red, green, blue, as points."""
    colors = as_colors(values[:, 3:]) if values.shape[1] > 3 else None
    return RawPoints(np.ascontiguousarray(values[:, :3]), colors)


def read_records(file: BoundedFile, record: np.dtype, num_records: int) -> RawPoints:
    """Read binary records with the fields x, y, z as points, and their colors.

    Colors are the fields red, green and blue, or the field rgb: a whole number 0xRRGGBB.
    """
    if num_records * record.itemsize > file.num_left or record.itemsize > _MAX_LINE:
        raise DamagedError(f"promises {num_records} x {record.itemsize} bytes, {file.num_left} follow")
    names = record.names or ()
    points, step = allocate_points(file, num_records), max(_MAX_LINE // record.itemsize, 1)
    colors = None
    if "rgb" in names or {*COLORS} <= set(names):
        kind = record["red"] if "red" in names else np.dtype(np.uint8)
        # In memory a color takes no more than four bytes
        colors = np.empty((num_records, 3), kind.newbyteorder("=") if kind.itemsize <= 4 else np.float32)
    for first in range(0, num_records, step):
        chosen = slice(first, min(first + step, num_records))
        rows = np.frombuffer(file.read_exactly((chosen.stop - first) * record.itemsize), record)
        for axis, name in enumerate("xyz"):
            points[chosen, axis] = rows[name]
        if colors is not None:
            colors[chosen] = (
                unpack_rgb(rows["rgb"])
                if "rgb" in names
                else np.stack([rows[name] for name in COLORS], axis=1)
            )
    return RawPoints(points, None if colors is None else as_colors(colors))


def unpack_rgb(packed: UInt32[np.ndarray, " N"]) -> UInt8[np.ndarray, "N 3"]:
    """Return red, green and blue of whole numbers 0xRRGGBB."""
    return np.stack([(packed >> shift) & 0xFF for shift in (16, 8, 0)], axis=1).astype(np.uint8)


def parse_count(word: str) -> int:
    """Return the whole number from 0 on that a word of a header is."""
    if not (word.isascii() and word.isdigit() and len(word) <= _MAX_DIGITS):
        raise ScanError(f"the header has {word[:40]!r} where a number belongs")
    return int(word)
