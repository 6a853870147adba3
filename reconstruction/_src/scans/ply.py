"""Read and write the points of a .ply file (Stanford polygons): ascii and binary of both byte orders.

References:
    Turk (1994), The PLY polygon file format.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.bounded_read import BoundedFile
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.point_rows import COLORS, RawPoints, as_colors

_NUMBERS = {
    "char": "i1",
    "short": "i2",
    "int": "i4",
    "int8": "i1",
    "int16": "i2",
    "int32": "i4",
    "int64": "i8",
}
_TYPES = {
    **_NUMBERS,
    **{f"u{name}": f"u{kind[1]}" for name, kind in _NUMBERS.items()},
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_STRUCTS = {
    "i1": "b",
    "i2": "h",
    "i4": "i",
    "i8": "q",
    "u1": "B",
    "u2": "H",
    "u4": "I",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}
_MAX_VALUES = 10_000_000
"""Values and lists that are read from binary rows with lists, one after the other: one to three seconds a million."""
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class _Property(NamedTuple):
    """A value of an element, or a list of values with its length before it (`length_type`)."""

    name: str
    type: str
    length_type: str | None = None

    @property
    def size(self) -> int:
        """Bytes of one value."""
        return int(self.type[1:])


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
    missing = [name for name in "xyz" if name not in [one.name for one in vertex.properties]]
    if missing:
        raise ScanError(f"the vertices of the .ply file have no {', '.join(missing)}")
    if any(one.length_type for one in vertex.properties if one.name in "xyz"):
        raise ScanError("the coordinates in the .ply file are lists")
    if not byte_order:
        return _read_ascii(file, before, vertex)
    _check_num_values([*before, vertex])
    for element in before:
        _skip(file, element, byte_order)
    if vertex.has_lists:
        return RawPoints(_collect(file, vertex, _iterate_rows(file, vertex, byte_order)))
    names, types = zip(*((one.name, byte_order + one.type) for one in vertex.properties), strict=True)
    return point_rows.read_records(file, np.dtype(list(zip(names, types, strict=True))), vertex.num_rows)


def write_ply(file: BinaryIO, points: Float[np.ndarray, "N 3"]) -> None:
    """Write points `[N, 3]` in double precision, little-endian."""
    properties = "".join(f"property double {name}\n" for name in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}end_header\n"
    file.write(header.encode())
    file.write(np.ascontiguousarray(points, dtype="<f8").tobytes())


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


def find_num_faces(file: BoundedFile) -> int:
    """Return how many faces the header of a .ply file promises."""
    _, elements = _read_header(file)
    return sum(element.num_rows for element in elements if element.name == "face")


def _read_ascii(file: BoundedFile, before: list[_Element], vertex: _Element) -> RawPoints:
    num_lines = sum(element.num_rows for element in (*before, vertex) if element.properties)
    if num_lines > file.num_lines:
        raise ScanError(f"the .ply header promises {num_lines} rows in {file.num_lines} lines")
    lines = (line for line in point_rows.read_lines(file) if not line.isspace())
    for element in before:
        if element.properties:
            next(itertools.islice(lines, element.num_rows, element.num_rows), None)
    rows = itertools.islice(lines, vertex.num_rows)
    colors = None
    if vertex.has_lists:
        points = _collect(file, vertex, _parse_rows(rows, vertex))
    else:
        names = [one.name for one in vertex.properties]
        wanted = ["x", "y", "z", *(COLORS if {*COLORS} <= set(names) else ())]
        values = point_rows.read_text_rows(file, rows, [names.index(name) for name in wanted], comments=None)
        points = np.ascontiguousarray(values[:, :3])
        colors = as_colors(values[:, 3:]) if len(wanted) > 3 else None
    if len(points) != vertex.num_rows:
        raise ScanError(f"the .ply header promises {vertex.num_rows} vertices, the data hold {len(points)}")
    return RawPoints(points, colors)


def _check_num_values(elements: list[_Element]) -> None:
    """Refuse what would take hours: rows that differ in length are read one after the other."""
    count = sum(one.num_rows * len(one.properties) for one in elements if one.has_lists)
    if count > _MAX_VALUES:
        raise ScanError(
            f"the .ply header promises {count} values in rows with lists, up to the vertices; {_MAX_VALUES} are "
            "read at most: write the vertices first, and without lists"
        )


def _skip(file: BoundedFile, element: _Element, byte_order: str) -> None:
    """Move on to the end of an element."""
    if element.has_lists:
        for _ in _iterate_rows(file, element, byte_order):
            pass
        return
    size = element.num_rows * sum(one.size for one in element.properties)
    _skip_bytes(file, size)


def _skip_bytes(file: BoundedFile, size: int) -> None:
    if size > file.num_left:
        raise ScanError(f"the .ply header promises {size} bytes where {file.num_left} are left")
    file.stream.seek(size, 1)


def _iterate_rows(file: BoundedFile, element: _Element, byte_order: str) -> Iterator[dict[str, float]]:
    """Yield the single values of binary rows whose lists differ in length."""
    properties = [
        (
            one.name,
            struct.Struct(byte_order + _STRUCTS[one.length_type or one.type]),
            one.length_type,
            one.size,
        )
        for one in element.properties
    ]
    for _ in range(element.num_rows):
        row = {}
        for name, kind, length_type, size in properties:
            (value,) = kind.unpack(file.read_exactly(kind.size))
            if length_type is None:
                row[name] = float(value)
            elif not 0 <= value < math.inf:
                raise ScanError(f"the .ply file has a list {name} of {value} values")
            elif value:
                _skip_bytes(file, int(value) * size)
        yield row


def _parse_rows(lines: Iterator[str], element: _Element) -> Iterator[dict[str, float]]:
    """Yield the single values of ascii rows with lists in them."""
    for line in lines:
        row, words = {}, iter(line.split())
        try:
            for one in element.properties:
                value = next(words)
                if one.length_type is None:
                    row[one.name] = float(value)
                else:
                    length = point_rows.parse_count(value)
                    next(itertools.islice(words, length, length), None)
        except (StopIteration, ValueError) as error:
            raise ScanError(
                f"the .ply file has a row {line[:60]!r} that is not as its header says"
            ) from error
        yield row


def _collect(
    file: BoundedFile, vertex: _Element, rows: Iterator[dict[str, float]]
) -> Float[np.ndarray, "N 3"]:
    if vertex.num_rows > file.size:
        raise ScanError(f"the .ply header promises {vertex.num_rows} vertices in {file.size} bytes")
    points, num_read = point_rows.allocate_points(file, vertex.num_rows), 0
    for row in rows:
        points[num_read] = row["x"], row["y"], row["z"]
        num_read += 1
    return points[:num_read]
