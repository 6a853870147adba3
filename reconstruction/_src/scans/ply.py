"""Read and write the points of a .ply file (Stanford polygons): ascii and binary of both byte orders.

References:
    Turk (1994), The PLY polygon file format.
"""

from __future__ import annotations

import itertools
import struct
from typing import BinaryIO, NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.bounded_read import BoundedFile, DamagedError
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
_MAX_VALUES = 10_000_000  # Values of rows with lists, read one after the other: 1 to 3 s a million
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class _Element(NamedTuple):
    """Rows of the same properties."""

    name: str
    num_rows: int
    types: dict[str, str]  # name of a property -> type of its values
    lists: dict[str, str]  # name of a property that is a list -> type of the length before its values


def read_ply(file: BoundedFile) -> RawPoints:
    """Read x, y, z and the colors of the element `vertex`.

    Numbers in text keep all their digits, whatever their type says.
    """
    byte_order, elements = _read_header(file)
    names = [element.name for element in elements]
    if "vertex" not in names:
        raise ScanError("the .ply file has no element vertex")
    before, vertex = elements[: names.index("vertex")], elements[names.index("vertex")]
    missing = {*"xyz"} - vertex.types.keys() | {*"xyz"} & vertex.lists.keys()
    if missing:
        raise ScanError(f"the vertices of the .ply file have no single {', '.join(sorted(missing))}")
    if {"opacity", "scale_0", "rot_0"} <= vertex.types.keys():
        raise ScanError(
            "Gaussian splats are no surface points; export a point cloud (`ns-export pointcloud`) or a mesh"
        )
    if not byte_order:
        return _read_ascii(file, sum(element.num_rows for element in before if element.types), vertex)
    count = sum(one.num_rows * len(one.types) for one in (*before, vertex) if one.lists)
    if count > _MAX_VALUES:
        raise ScanError(
            f"{count} values in rows with lists are too many; write the vertices first, without lists"
        )
    for element in before:
        size = element.num_rows * sum(struct.calcsize(f"={code}") for code in element.types.values())
        if element.lists:
            _read_lists(file, element, byte_order)
        elif size > file.num_left:
            raise DamagedError(f"the .ply header promises {size} bytes where {file.num_left} are left")
        else:
            file.stream.seek(size, 1)
    if vertex.lists:
        return RawPoints(_read_lists(file, vertex, byte_order))
    record = np.dtype([(name, byte_order + code) for name, code in vertex.types.items()])
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
                elements.append(_Element(name, point_rows.parse_count(count), {}, {}))
            case ["property", "list", length_type, kind, name] if elements and name not in elements[-1].types:
                elements[-1].types[name] = _find_type(kind)
                elements[-1].lists[name] = _find_type(length_type)
            case ["property", kind, name] if elements and name not in elements[-1].types:
                elements[-1].types[name] = _find_type(kind)
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


def _read_ascii(file: BoundedFile, num_skipped: int, vertex: _Element) -> RawPoints:
    num_rows = num_skipped + vertex.num_rows
    if num_rows > file.num_lines:
        raise DamagedError(f"the .ply header promises {num_rows} rows in {file.num_lines} lines")
    lines = (line for line in point_rows.read_lines(file) if not line.isspace())
    names = list(vertex.types)
    wanted = [*"xyz", *(point_rows.COLORS if {*point_rows.COLORS} <= {*names} else ())]
    columns = [names.index(name) for name in wanted]
    if any(names.index(name) < max(columns) for name in vertex.lists):
        raise ScanError("the vertices of the .ply file have lists before their coordinates; write them last")
    rows = itertools.islice(lines, num_skipped, num_rows)
    values = point_rows.read_text_rows(file, rows, columns, comments=None)
    if len(values) != vertex.num_rows:
        raise DamagedError(f"the .ply header promises {vertex.num_rows} vertices, {len(values)} follow")
    return point_rows.split_colors(values)


def _read_lists(file: BoundedFile, element: _Element, byte_order: str) -> Float[np.ndarray, "N 3"]:
    """Read binary rows with lists of any length, one after the other; return x, y, z, where the element has them."""
    kinds = {code: struct.Struct(byte_order + code) for code in _CODES.values()}
    if element.num_rows > file.num_left:
        raise DamagedError(f"the .ply header promises {element.num_rows} rows in {file.num_left} bytes")
    points = point_rows.allocate_points(file, element.num_rows)
    for row in range(element.num_rows):
        values: dict[str, float] = {}
        for name, code in element.types.items():
            kind = kinds[element.lists.get(name, code)]
            (values[name],) = kind.unpack(file.read_exactly(kind.size))
            if name in element.lists:
                file.read_exactly(int(values[name]) * kinds[code].size)
        points[row] = [values.get(axis, 0.0) for axis in "xyz"]
    return points
