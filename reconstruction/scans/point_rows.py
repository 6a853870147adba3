"""Rows of a file, text or binary records, as points: read piece by piece into room that was checked before."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from io import TextIOWrapper

import numpy as np

from reconstruction.errors import ScanError
from reconstruction.files.bounded_read import BoundedFile, UnreadableFileError, check_size
from reconstruction.scans.scan import Array

_MAX_LINE = 1 << 20
"""Longest line of a text file and largest record of a binary one [characters, bytes]: no point has more fields."""
_MAX_HEADER = 1 << 20
"""Longest text before binary data [bytes]: what is read of it takes many times that in memory."""
_BLOCK = 50_000
"""Lines that are parsed at once, where they are short."""
_BLOCK_TEXT = 1 << 22
"""Characters that are parsed at once: as many numbers take twenty times that in memory."""


def make_room(file: BoundedFile, count: int) -> Array:
    """Return an empty array for so many points, if the file's limit allows."""
    check_size(24 * count, file.max_bytes)
    return np.empty((count, 3))


def read_lines(file: BoundedFile) -> Iterator[str]:
    """Yield the lines of text from here on; a byte order mark is allowed, binary data is refused."""
    text = TextIOWrapper(file.stream, encoding="utf-8-sig")
    try:
        while line := text.readline(_MAX_LINE):
            if len(line) == _MAX_LINE or "\0" in line:
                raise ScanError("holds binary data, not lines of text")
            yield line
    except UnicodeDecodeError as error:
        raise ScanError(f"holds binary data, not text: {error}") from error


def read_header_line(file: BoundedFile) -> str:
    """Return the next line of the text that stands before binary data, without blanks around it."""
    if file.stream.tell() > _MAX_HEADER:
        raise ScanError(f"the header is longer than {_MAX_HEADER} bytes")
    line = file.stream.readline(_MAX_LINE)
    if not line.endswith(b"\n"):
        raise UnreadableFileError("ends before its data, or has no header")
    return line.decode("latin1").strip()


def take_block(lines: Iterator[str]) -> list[str]:
    """Return the next lines, as many as may be parsed at once; none at the end."""
    block, num_characters = [], 0
    while len(block) < _BLOCK and num_characters < _BLOCK_TEXT and (line := next(lines, "")):
        block.append(line)
        num_characters += len(line)
    return block


def read_text_rows(
    file: BoundedFile,
    lines: Iterable[str],
    columns: Sequence[int],
    delimiter: str | None = None,
    comments: str | None = "#",
) -> Array:
    """Read three columns of numbers, `[N, 3]`, one row a line; blank lines are passed over.

    Args:
        file: where the lines come from.
        lines: the text.
        columns: which three.
        delimiter: between columns; blanks unless given.
        comments: what begins a comment.
    """
    points, filled, remaining = make_room(file, file.num_lines), 0, iter(lines)
    while block := take_block(remaining):
        try:
            with warnings.catch_warnings(action="ignore"):  # a block of comments alone
                rows = np.loadtxt(block, delimiter=delimiter, comments=comments, usecols=columns, ndmin=2)
        except ValueError as error:
            raise ScanError(f"not three columns of numbers: {error}, counted from row {filled}") from error
        points[filled : filled + len(rows)] = rows
        filled += len(rows)
    return points[:filled]


def read_records(file: BoundedFile, record: np.dtype, count: int) -> Array:
    """Read binary records with the fields x, y, z as points `[N, 3]`."""
    if count * record.itemsize > file.num_left or record.itemsize > _MAX_LINE:
        raise ScanError(
            f"the header promises {count} points of {record.itemsize} bytes, but {file.num_left} bytes follow"
        )
    points, step = make_room(file, count), max(_MAX_LINE // record.itemsize, 1)
    for first in range(0, count, step):
        num_rows = min(step, count - first)
        rows = np.frombuffer(file.read_exactly(num_rows * record.itemsize), record)
        for axis, name in enumerate("xyz"):
            points[first : first + num_rows, axis] = rows[name]
    return points


def parse_count(word: str) -> int:
    """Return a number of things from a header; refuse what is no whole number from 0 on."""
    if not (word.isascii() and word.isdigit() and len(word) < 20):
        raise ScanError(f"the header has {word[:40]!r} where a number belongs")
    return int(word)
