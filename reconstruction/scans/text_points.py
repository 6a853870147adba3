"""Points out of text: columns, Wavefront .obj, legacy .vtk."""

from __future__ import annotations

import itertools

import numpy as np

from reconstruction.errors import ScanError
from reconstruction.files.bounded_read import BoundedFile, check_size
from reconstruction.scans.point_rows import (
    make_room,
    parse_count,
    read_header_line,
    read_lines,
    read_records,
    read_text_rows,
    take_block,
)
from reconstruction.scans.scan import Array

_VTK_TYPES = {
    "float": ">f4",
    "double": ">f8",
    "int": ">i4",
    "long": ">i8",
    "short": ">i2",
    "unsigned_char": ">u1",
}


def read_text(file: BoundedFile) -> Array:
    """Read columns parted by blanks, commas or semicolons; `#` begins a comment, names may stand first."""
    check_size(24 * file.num_lines, file.max_bytes)
    lines = read_lines(file)
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
    return read_text_rows(file, lines, columns, delimiter)


def read_obj(file: BoundedFile) -> Array:
    """Read the vertices (lines `v x y z`) of a Wavefront file."""
    vertices = (line for line in read_lines(file) if line.startswith(("v ", "v\t")))
    points = read_text_rows(file, vertices, (1, 2, 3))
    if not len(points):
        raise ScanError("the .obj file has no vertices")
    return points


def read_vtk(file: BoundedFile) -> Array:
    """Read the POINTS of a legacy .vtk file, ASCII or binary, of any kind of data set."""
    head = [read_header_line(file) for _ in range(3)]
    if not head[0].startswith("# vtk DataFile"):
        raise ScanError("no legacy .vtk file: it does not begin with '# vtk DataFile'")
    form = head[2].upper()
    if form not in ("ASCII", "BINARY"):
        raise ScanError(f"the third line of the .vtk file is {head[2][:40]!r}, not ASCII or BINARY")
    words = ["", "", ""]
    while words[0] != "POINTS":
        words = [*read_header_line(file).split(), "", "", ""]
    count, kind = parse_count(words[1]), words[2].lower()
    if kind not in _VTK_TYPES:
        raise ScanError(f"the .vtk file has POINTS of type {kind!r}; known are {', '.join(_VTK_TYPES)}")
    if form == "BINARY":
        value = _VTK_TYPES[kind]
        return read_records(file, np.dtype([("x", value), ("y", value), ("z", value)]), count)
    if 6 * count > file.num_left + 1:  # a digit and a blank each
        raise ScanError(f"the .vtk file promises {count} points in {file.num_left} bytes")
    return _read_numbers(file, count)


def _read_numbers(file: BoundedFile, count: int) -> Array:
    """Read points whose numbers stand in lines of any length."""
    points, filled, lines = make_room(file, count), 0, read_lines(file)
    flat = points.reshape(-1)
    while filled < len(flat):
        words = " ".join(take_block(lines)).split()[: len(flat) - filled]
        if not words:
            raise ScanError(f"the .vtk file promises {count} points, but ends after {filled} numbers")
        flat[filled : filled + len(words)] = np.array(words, dtype=np.float64)
        filled += len(words)
    return points


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
