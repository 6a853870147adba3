"""Read the points of text files: columns, ESRI ASCII grids, Wavefront .obj, legacy .vtk."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from reconstruction._src.base.bounded_read import BoundedFile, DamagedError
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.frames import RawPoints

_COLOR_NAMES = (point_rows.COLORS, ("r", "g", "b"))  # Titles of the columns of a color
_COLOR_COLUMNS = {6: (3, 4, 5), 7: (4, 5, 6)}
"""Colors without titles: x y z r g b; x y z intensity r g b (.pts)."""
_VTK_TYPES = {
    "float": ">f4",
    "double": ">f8",
    "int": ">i4",
    "long": ">i8",
    "short": ">i2",
    "unsigned_char": ">u1",
}
_COLORED_VERTEX = 7  # Words of a line `v x y z r g b`
_MOST_NAMES = 9  # In the header of a grid


def read_text(file: BoundedFile) -> RawPoints:
    """Read columns separated by blanks, commas or semicolons; `#` begins a comment, the first row may hold names.

    Columns are colors where their names say so (r, g, b or red, green, blue), and without names where there are 6
    or 7 columns whose last three hold only whole numbers from 0 to 255. A first line of one number, the count of
    the rows as in .pts, is skipped. A first word ncols begins an ESRI ASCII grid.
    """
    point_rows.check_num_points(file, file.num_lines)
    lines = point_rows.read_lines(file)
    contents = (pair for pair in enumerate(lines, start=1) if pair[1].split("#")[0].strip())
    number, first = next(contents, (0, ""))
    if file.suffix == ".pts" and len(first.split()) == 1:
        number, first = next(contents, (0, ""))
    if not number:
        raise ScanError("holds no line with numbers")
    head = first.split("#")[0].strip()
    if head.lower().startswith("ncols"):
        return _read_grid(file, itertools.chain([first], lines))
    delimiter = "," if "," in head else ";" if ";" in head else None
    words = [word.strip().strip('"').lower() for word in head.split(delimiter)]
    if len(words) < 3:
        raise ScanError(f"line {number} has {len(words)} columns, x y z are needed: {head[:60]!r}")
    columns, has_names = _find_columns(words)
    if not has_names:
        lines = itertools.chain([first], lines)
    values = point_rows.read_text_rows(file, lines, columns, delimiter)
    last = values[:, 3:]
    if not has_names and not ((last >= 0) & (last <= 255) & (last == np.floor(last))).all():
        values = values[:, :3]
    return point_rows.split_colors(values)


def _read_grid(file: BoundedFile, lines: Iterable[str]) -> RawPoints:
    """Read the middles of the cells that have data, row after row from the north."""
    head, words = {"nodata_value": "-9999"}, _split(lines)
    word = next(words)
    while len(head) < _MOST_NAMES and not _is_number(word):
        head[word.lower()], word = next(words, ""), next(words, "nan")
    try:
        columns, rows = (point_rows.parse_count(head[name]) for name in ("ncols", "nrows"))
        cell = float(head["cellsize"])
        x, y = (float(head.get(f"{a}llcenter") or float(head[f"{a}llcorner"]) + cell / 2) for a in "xy")
    except KeyError as error:
        raise ScanError(f"the header of the grid lacks {error}; add it") from error
    point_rows.check_num_points(file, columns * rows)
    z = np.fromiter(itertools.islice(map(float, itertools.chain([word], words)), columns * rows), float)
    if len(z) < columns * rows or next(words, "") or not cell > 0.0:
        raise DamagedError(f"its data are no grid of {columns} x {rows} cells of {cell}")
    east, north = x + cell * np.arange(columns), y + cell * np.arange(rows)[::-1]
    points = np.stack([np.tile(east, rows), np.repeat(north, columns), z], axis=1)
    return RawPoints(points[z != float(head["nodata_value"])], up="z")


def _find_columns(words: list[str]) -> tuple[list[int], bool]:
    """Return the columns of x, y, z and the color, where there is one, and whether these words are titles."""
    if any(_is_number(word) for word in words):
        colors = _COLOR_COLUMNS.get(len(words), ())
        is_color = all(words[column].isdigit() for column in colors)
        return [0, 1, 2, *(colors if is_color else ())], False
    if not {"x", "y", "z"} <= set(words):
        return [0, 1, 2], True
    names = next((names for names in _COLOR_NAMES if {*names} <= set(words)), ())
    return [words.index(name) for name in ("x", "y", "z", *names)], True


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def read_obj(file: BoundedFile) -> RawPoints:
    """Read the vertices (lines `v x y z`, or `v x y z r g b`) of a Wavefront file."""
    vertices = (line for line in point_rows.read_lines(file) if line.startswith(("v ", "v\t")))
    first = next(vertices, "")
    columns = range(1, 7 if len(first.split()) == _COLORED_VERTEX else 4)
    values = point_rows.read_text_rows(file, itertools.chain([first], vertices), columns)
    if not len(values):
        raise ScanError("the .obj file has no vertices")
    return point_rows.split_colors(values)


def has_obj_faces(file: BoundedFile) -> bool:
    """Return whether a Wavefront file has a face (a line `f ...`)."""
    return any(line.startswith(("f ", "f\t")) for line in point_rows.read_lines(file))


def read_vtk(file: BoundedFile) -> RawPoints:
    """Read the POINTS of a legacy .vtk file, ASCII or binary, of any kind of data set."""
    head = [point_rows.read_header_line(file) for _ in range(3)]
    if not head[0].startswith("# vtk DataFile"):
        raise ScanError("no legacy .vtk file: it does not begin with '# vtk DataFile'")
    form = head[2].upper()
    if form not in ("ASCII", "BINARY"):
        raise ScanError(f"the third line of the .vtk file is {head[2][:40]!r}, not ASCII or BINARY")
    words = [""]
    while words[0] != "POINTS":
        words = [*point_rows.read_header_line(file).split(), "", "", ""]
    count, kind = point_rows.parse_count(words[1]), words[2].lower()
    if kind not in _VTK_TYPES:
        raise ScanError(f"the .vtk file has POINTS of type {kind!r}; known are {', '.join(_VTK_TYPES)}")
    if form == "BINARY":
        record = np.dtype([(axis, _VTK_TYPES[kind]) for axis in "xyz"])
        return point_rows.read_records(file, record, count)
    point_rows.check_num_points(file, count)
    values = np.fromiter(itertools.islice(map(float, _split(point_rows.read_lines(file))), 3 * count), float)
    if len(values) < 3 * count:
        raise DamagedError(f"the .vtk file promises {count} points, but ends after {len(values)} numbers")
    return RawPoints(values.reshape(-1, 3))


def _split(lines: Iterable[str]) -> Iterator[str]:
    """Yield the words of lines."""
    return (word for line in lines for word in line.split())
