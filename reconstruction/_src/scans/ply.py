"""Read and write the points of a .ply file (Stanford polygons): ascii and binary of both byte orders.

References:
    Turk (1994), The PLY polygon file format.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO, NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.bounded_read import BoundedFile
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.frames import RawPoints

_CODES = {
    "char int8": "b",
    "uchar uint8": "B",
    "short int16": "h",
    "ushort uint16": "H",
    "int int32": "i",
    "uint uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float float32": "f",
    "double float64": "d",
}
_TYPES = {name: code for names, code in _CODES.items() for name in names.split()}
"""Type in a header -> its code in `struct` and NumPy."""
_MAX_VALUES = 10_000_000
"""Values and lists that are read from rows with lists, one after the other: one to three seconds a million."""
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class _Property(NamedTuple):
    """A value of an element, or a list of values with its length before it (`length_type`)."""

    name: str
    type: str
    length_type: str | None = None


class _Element(NamedTuple):
    """Rows of the same properties."""

    name: str
    num_rows: int
    properties: list[_Property]

    @property
    def has_lists(self) -> bool:
        """Whether rows differ in length."""
        return any(one.length_type for one in self.properties)


def read_ply(file: BoundedFile) -> RawPoints:
    """Read x, y, z and the colors of the element `vertex`.

    Numbers in text keep all their digits, whatever their type says.
    """
    byte_order, elements = _read_header(file)
    names = [element.name for element in elements]
    if "vertex" not in names:
        raise ScanError("the .ply file has no element vertex")
    before, vertex = elements[: names.index("vertex")], elements[names.index("vertex")]
    missing = {"x", "y", "z"} - {one.name for one in vertex.properties if not one.length_type}
    if missing:
        raise ScanError(f"the vertices of the .ply file have no single {', '.join(sorted(missing))}")
    count = sum(one.num_rows * len(one.properties) for one in (*before, vertex) if one.has_lists)
    if count > _MAX_VALUES:
        raise ScanError(
            f"the .ply header promises {count} values in rows with lists, up to the vertices; {_MAX_VALUES} are "
            "read at most: write the vertices first, and without lists"
        )
    if not byte_order:
        return _read_ascii(file, before, vertex)
    for element in before:
        if element.has_lists:
            _read_lists(file, element, *_make_binary_reader(file, byte_order))
        else:
            size = sum(struct.calcsize(f"={one.type}") for one in element.properties)
            _skip_bytes(file, element.num_rows * size)
    if vertex.has_lists:
        return RawPoints(_read_lists(file, vertex, *_make_binary_reader(file, byte_order)))
    record = np.dtype([(one.name, byte_order + one.type) for one in vertex.properties])
    return point_rows.read_records(file, record, vertex.num_rows)


def write_ply(file: BinaryIO, points: Float[np.ndarray, "N 3"]) -> None:
    """Write points `[N, 3]` in double precision, little-endian."""
    properties = "".join(f"property double {name}\n" for name in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}end_header\n"
    file.write(header.encode())
    file.write(np.ascontiguousarray(points, dtype="<f8").tobytes())


def find_num_faces(file: BoundedFile) -> int:
    """Return how many faces the header of a .ply file promises."""
    _, elements = _read_header(file)
    return sum(element.num_rows for element in elements if element.name == "face")


def _read_header(file: BoundedFile) -> tuple[str, list[_Element]]:
    """Return the byte order ("" for ascii) and the elements in the order of the file."""
    if point_rows.read_header_line(file) != "ply":
        raise ScanError("no .ply file: it does not begin with 'ply'")
    byte_order, elements = None, []
    while (words := point_rows.read_header_line(file).split()) != ["end_header"]:
        match words:
            case ["format", form, "1.0"] if form in _FORMATS:
                byte_order = _FORMATS[form]
            case ["element", name, count]:
                elements.append(_Element(name, point_rows.parse_count(count), []))
            case ["property", "list", length_type, kind, name] if elements:
                elements[-1].properties.append(_Property(name, _find_type(kind), _find_type(length_type)))
            case ["property", kind, name] if elements:
                elements[-1].properties.append(_Property(name, _find_type(kind)))
            case [] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise ScanError(f"the .ply header has the line {' '.join(words)[:60]!r}")
    if byte_order is None:
        raise ScanError("the .ply header has no line format")
    return byte_order, elements


def _find_type(name: str) -> str:
    if name not in _TYPES:
        raise ScanError(f"the .ply header has the type {name[:40]!r}; there are: {', '.join(_TYPES)}")
    return _TYPES[name]


def _read_ascii(file: BoundedFile, before: list[_Element], vertex: _Element) -> RawPoints:
    num_skipped = sum(element.num_rows for element in before if element.properties)
    if num_skipped + vertex.num_rows > file.num_lines:
        raise ScanError(
            f"the .ply header promises {num_skipped + vertex.num_rows} rows in {file.num_lines} lines"
        )
    lines = (line for line in point_rows.read_lines(file) if not line.isspace())
    rows = itertools.islice(lines, num_skipped, num_skipped + vertex.num_rows)
    if vertex.has_lists:
        words = (word for line in rows for word in line.split())
        return RawPoints(
            _read_lists(file, vertex, lambda kind: float(next(words)), _make_word_skipper(words))
        )
    names = [one.name for one in vertex.properties]
    wanted = [*"xyz", *(point_rows.COLORS if {*point_rows.COLORS} <= set(names) else ())]
    values = point_rows.read_text_rows(file, rows, [names.index(name) for name in wanted], comments=None)
    if len(values) != vertex.num_rows:
        raise ScanError(f"the .ply header promises {vertex.num_rows} vertices, the data hold {len(values)}")
    return point_rows.split_colors(values)


_Take = Callable[[str], float]  # Returns the next value, of a type
_Skip = Callable[[str, int], None]  # Moves on by a number of values of a type


def _make_binary_reader(file: BoundedFile, byte_order: str) -> tuple[_Take, _Skip]:
    kinds = {code: struct.Struct(byte_order + code) for code in _CODES.values()}
    return (
        lambda kind: kinds[kind].unpack(file.read_exactly(kinds[kind].size))[0],
        lambda kind, count: _skip_bytes(file, count * kinds[kind].size),
    )


def _make_word_skipper(words: Iterator[str]) -> _Skip:
    return lambda kind, count: next(itertools.islice(words, count, count), None)


def _skip_bytes(file: BoundedFile, size: int) -> None:
    if size > file.num_left:
        raise ScanError(f"the .ply header promises {size} bytes where {file.num_left} are left")
    file.stream.seek(size, 1)


def _read_lists(file: BoundedFile, element: _Element, take: _Take, skip: _Skip) -> Float[np.ndarray, "N 3"]:
    """Read rows whose lists differ in length, value by value; return x, y, z, where the element has them."""
    if element.num_rows > file.size:
        raise ScanError(f"the .ply header promises {element.num_rows} rows in {file.size} bytes")
    places = [{"x": 0, "y": 1, "z": 2}.get(one.name, 3) for one in element.properties]
    points, row = point_rows.allocate_points(file, element.num_rows), np.zeros(4)
    try:
        for number in range(element.num_rows):
            for one, place in zip(element.properties, places, strict=True):
                value = take(one.length_type or one.type)
                if one.length_type is None:
                    row[place] = value
                elif not 0 <= value < math.inf:
                    raise ScanError(f"the .ply file has a list {one.name} of {value} values")
                else:
                    skip(one.type, int(value))
            points[number] = row[:3]
    except (StopIteration, ValueError) as error:
        if isinstance(error, ScanError):
            raise
        raise ScanError(f"the .ply file ends or has no number in row {number} of {element.name}") from error
    return points
