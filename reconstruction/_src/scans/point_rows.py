"""Rows of a file, lines of text or binary records, as points: read in blocks into memory that was checked before."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from io import TextIOWrapper

import numpy as np
from jaxtyping import Float, Num, Shaped, UInt8, UInt32

from reconstruction._src.base.bounded_read import BoundedFile, UnreadableFileError, check_size
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.raw_points import RawPoints, as_colors

COLORS = ("red", "green", "blue")
"""Names of the columns of a point's color."""
_POINT_BYTES = 3 * np.dtype(np.float64).itemsize
_MAX_LINE = 1 << 20
"""Longest line of a text file and largest record of a binary one [characters, bytes]: no point has more fields."""
_MAX_HEADER = 1 << 20
"""Longest text before binary data [bytes]: parsed, it takes many times that in memory."""
_BLOCK_LINES = 50_000
"""Lines that are parsed at once, where they are short: larger blocks are no faster."""
_BLOCK_CHARACTERS = 1 << 22
"""Characters that are parsed at once: as many numbers take twenty times that in memory."""
_MAX_DIGITS = 19
"""Digits of the largest 64-bit number: no file has more points."""


def check_num_points(file: BoundedFile, num_points: int) -> None:
    """Check that the file's limit allows for an array of this many points."""
    check_size(_POINT_BYTES * num_points, file.max_bytes)


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
        raise UnreadableFileError("ends before its data, or has no header")
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
    points, num_read, remaining = np.empty((file.num_lines, len(columns))), 0, iter(lines)
    while block := next_block(remaining):
        try:
            with warnings.catch_warnings(action="ignore"):  # a block of comments alone
                rows = np.loadtxt(block, delimiter=delimiter, comments=comments, usecols=columns, ndmin=2)
        except ValueError as error:
            raise ScanError(f"not three columns of numbers: {error}, counted from row {num_read}") from error
        points[num_read : num_read + len(rows)] = rows
        num_read += len(rows)
    return points[:num_read]


def read_records(file: BoundedFile, record: np.dtype, num_records: int) -> RawPoints:
    """Read binary records with the fields x, y, z as points, and their colors.

    Colors are the fields red, green and blue, or the field rgb: a whole number 0xRRGGBB.
    """
    if num_records * record.itemsize > file.num_left or record.itemsize > _MAX_LINE:
        raise ScanError(
            f"the header promises {num_records} points of {record.itemsize} bytes, "
            f"but {file.num_left} bytes follow"
        )
    points, step = allocate_points(file, num_records), max(_MAX_LINE // record.itemsize, 1)
    has_colors = {*COLORS} <= set(record.names or ()) or "rgb" in (record.names or ())
    colors = np.empty((num_records, 3), _find_color_type(record)) if has_colors else None
    for first in range(0, num_records, step):
        num_rows = min(step, num_records - first)
        rows = np.frombuffer(file.read_exactly(num_rows * record.itemsize), record)
        for axis, name in enumerate("xyz"):
            points[first : first + num_rows, axis] = rows[name]
        if colors is not None:
            colors[first : first + num_rows] = _find_colors(rows)
    return RawPoints(points, None if colors is None else as_colors(colors))


def unpack_rgb(packed: UInt32[np.ndarray, " N"]) -> UInt8[np.ndarray, "N 3"]:
    """Return red, green and blue of whole numbers 0xRRGGBB."""
    return np.stack([(packed >> shift) & 0xFF for shift in (16, 8, 0)], axis=1).astype(np.uint8)


def _find_color_type(record: np.dtype) -> np.dtype:
    """Return the type of the colors of a record in memory: their own, where it takes no more than four bytes."""
    kind = record["red"] if "red" in (record.names or ()) else np.dtype(np.uint8)
    return kind.newbyteorder("=") if kind.itemsize <= 4 else np.dtype(np.float32)


def _find_colors(rows: Shaped[np.ndarray, " N"]) -> Num[np.ndarray, "N 3"]:
    if "rgb" in (rows.dtype.names or ()):
        return unpack_rgb(rows["rgb"])
    return np.stack([rows[name] for name in COLORS], axis=1)


def parse_count(word: str) -> int:
    """Return the whole number from 0 on that a word of a header is."""
    if not (word.isascii() and word.isdigit() and len(word) <= _MAX_DIGITS):
        raise ScanError(f"the header has {word[:40]!r} where a number belongs")
    return int(word)
