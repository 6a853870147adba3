"""Read the points of text files: columns, Wavefront .obj, legacy .vtk."""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float

from reconstruction.errors import ScanError
from reconstruction.files.bounded_read import BoundedFile
from reconstruction.scans import point_rows

_VTK_TYPES = {
    "float": ">f4",
    "double": ">f8",
    "int": ">i4",
    "long": ">i8",
    "short": ">i2",
    "unsigned_char": ">u1",
}
_MIN_POINT_BYTES = 6
"""Three digits and three blanks."""


def read_text(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    """Read columns separated by blanks, commas or semicolons; `#` begins a comment, the first row may hold names.

    Raises:
        ScanError: no numbers, or fewer than three columns of them.
        UnreadableFileError: the file exceeds its limit.
    """
    point_rows.check_num_points(file, file.num_lines)
    lines = point_rows.read_lines(file)
    numbered = enumerate(lines, start=1)
    number, first = next(((i, line) for i, line in numbered if line.split("#")[0].strip()), (0, ""))
    if not number:
        raise ScanError("holds no line with numbers")
    head = first.split("#")[0].strip()
    delimiter = "," if "," in head else ";" if ";" in head else None
    words = [word.strip().strip('"').lower() for word in head.split(delimiter)]
    if len(words) < 3:
        raise ScanError(f"line {number} has {len(words)} columns, x y z are needed: {head[:60]!r}")
    columns = [0, 1, 2]
    if any(_is_number(word) for word in words):
        lines = itertools.chain([first], lines)
    elif {"x", "y", "z"} <= set(words):
        columns = [words.index(name) for name in "xyz"]
    return point_rows.read_text_rows(file, lines, columns, delimiter)


def read_obj(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    """Read the vertices (lines `v x y z`) of a Wavefront file.

    Raises:
        ScanError: no vertices, or damaged ones.
        UnreadableFileError: the file exceeds its limit.
    """
    vertices = (line for line in point_rows.read_lines(file) if line.startswith(("v ", "v\t")))
    points = point_rows.read_text_rows(file, vertices, (1, 2, 3))
    if not len(points):
        raise ScanError("the .obj file has no vertices")
    return points


def read_vtk(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    """Read the POINTS of a legacy .vtk file, ASCII or binary, of any kind of data set.

    Raises:
        ScanError: the header is incomplete or contradicts the data.
        UnreadableFileError: the file ends before its data, or exceeds its limit.
    """
    head = [point_rows.read_header_line(file) for _ in range(3)]
    if not head[0].startswith("# vtk DataFile"):
        raise ScanError("no legacy .vtk file: it does not begin with '# vtk DataFile'")
    form = head[2].upper()
    if form not in ("ASCII", "BINARY"):
        raise ScanError(f"the third line of the .vtk file is {head[2][:40]!r}, not ASCII or BINARY")
    words = ["", "", ""]
    while words[0] != "POINTS":
        words = [*point_rows.read_header_line(file).split(), "", "", ""]
    count, kind = point_rows.parse_count(words[1]), words[2].lower()
    if kind not in _VTK_TYPES:
        raise ScanError(f"the .vtk file has POINTS of type {kind!r}; known are {', '.join(_VTK_TYPES)}")
    if form == "BINARY":
        value = _VTK_TYPES[kind]
        return point_rows.read_records(file, np.dtype([("x", value), ("y", value), ("z", value)]), count)
    if _MIN_POINT_BYTES * count > file.num_left + 1:
        raise ScanError(f"the .vtk file promises {count} points in {file.num_left} bytes")
    return _read_numbers(file, count)


def _read_numbers(file: BoundedFile, count: int) -> Float[np.ndarray, "N 3"]:
    """Read points whose numbers are in lines of any length."""
    points, num_read, lines = point_rows.allocate_points(file, count), 0, point_rows.read_lines(file)
    flat = points.reshape(-1)
    while num_read < len(flat):
        words = " ".join(point_rows.next_block(lines)).split()[: len(flat) - num_read]
        if not words:
            raise ScanError(f"the .vtk file promises {count} points, but ends after {num_read} numbers")
        flat[num_read : num_read + len(words)] = np.array(words, dtype=np.float64)
        num_read += len(words)
    return points


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
