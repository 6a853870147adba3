"""Read the points of a .pcd file (Point Cloud Library): ascii, binary, binary_compressed; colors and viewpoint.

VIEWPOINT says where the sensor stood in the frame of the points, and how it was turned: the points stay as they are,
as in PCL's own estimation of normals. Writers that do not know it state the origin without rotation.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.bounded_read import BoundedFile, check_size
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.frames import RawPoints, as_colors

_NEEDED = ("FIELDS", "SIZE", "TYPE", "WIDTH", "HEIGHT", "POINTS", "DATA")
_MIN_NUMBER_BYTES = 2  # A number in text takes a digit and a blank, at least
_UNKNOWN_VIEWPOINT = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
_PADDING = "_"  # Name of fields that hold nothing: any number of bytes, none too
_COLOR_FIELDS = ("rgb", "rgba")  # Fields with a color as the four bytes of a number, 0xRRGGBB
_TYPES = {("F", 4), ("F", 8), *((kind, size) for kind in "IU" for size in (1, 2, 4, 8))}


class _Header(NamedTuple):
    """The contents of a header."""

    num_points: int  # `POINTS`
    num_columns: int  # values of one point
    columns: list[int]  # columns of x, y, z and the color, where there is one, among the values
    record: np.dtype  # x, y, z and rgb (a whole number) in one binary point
    # whether the text of an ascii file writes the color's bytes as a floating point number
    has_float_color: bool


def read_pcd(file: BoundedFile) -> RawPoints:
    """Read x, y, z, colors and viewpoint; the header is checked against the data before anything is allocated."""
    words: dict[str, list[str]] = {}
    while "DATA" not in words:
        line = point_rows.read_header_line(file)
        if line and not line.startswith("#"):
            words[line.split()[0].upper()] = line.split()[1:]
    missing = [name for name in _NEEDED if not words.get(name)]
    if missing:
        raise ScanError(f"the .pcd header lacks {', '.join(missing)}")
    if (data := words["DATA"][0].lower()) not in _READERS:
        raise ScanError(f"the .pcd file has DATA {data}; there are: {', '.join(_READERS)}")
    raw = _READERS[data](file, _check_header(words))
    return raw._replace(viewpoints=_find_viewpoint(words))


def _find_viewpoint(words: dict[str, list[str]]) -> Float[np.ndarray, "1 3"] | None:
    """Return the sensor's position, or None where VIEWPOINT does not tell it."""
    if not words.get("VIEWPOINT"):
        return None
    try:
        values = list(map(float, words["VIEWPOINT"]))
    except ValueError:
        values = []
    if len(values) != len(_UNKNOWN_VIEWPOINT) or not np.isfinite(values).all():
        text = " ".join(words["VIEWPOINT"])[:60]
        raise ScanError(f"VIEWPOINT is {text!r}, not position x y z and quaternion w x y z")
    return None if values == _UNKNOWN_VIEWPOINT else np.array([values[:3]])


def _check_header(words: dict[str, list[str]]) -> _Header:
    fields, kinds = words["FIELDS"], words["TYPE"]
    sizes = [point_rows.parse_count(word) for word in words["SIZE"]]
    repeats = [point_rows.parse_count(word) for word in words.get("COUNT", ["1"] * len(fields))]
    width, height, num_points = (
        point_rows.parse_count(words[name][0]) for name in ("WIDTH", "HEIGHT", "POINTS")
    )
    if not len(fields) == len(sizes) == len(repeats) == len(kinds):
        raise ScanError("FIELDS, SIZE, TYPE and COUNT of the .pcd header have different lengths")
    if width * height not in (0, num_points):  # some programs leave it at 0
        raise ScanError(f"the .pcd header promises {width} x {height} points, and {num_points}")
    for name, kind, size, repeat in zip(fields, kinds, sizes, repeats, strict=True):
        if name != _PADDING and ((kind, size) not in _TYPES or repeat < 1):
            raise ScanError(f"the .pcd header has {repeat} of type {kind}{size} in the field {name}")
    places = [fields.index(name) for name in "xyz" if name in fields]
    if len(places) != 3 or any(repeats[place] != 1 for place in places):
        raise ScanError(f"the .pcd file has the fields {' '.join(fields)}, single x y z are needed")
    types = [f"<{kinds[place].lower()}{sizes[place]}" for place in places]
    color = next((fields.index(name) for name in _COLOR_FIELDS if name in fields), None)
    has_color = color is not None and (sizes[color], repeats[color]) == (4, 1)
    if color is not None and has_color:
        places.append(color)
        types.append("<u4")
    columns = [0, *itertools.accumulate(repeats)]
    offsets = [0, *itertools.accumulate(size * repeat for size, repeat in zip(sizes, repeats, strict=True))]
    record = np.dtype(
        {
            "names": ["x", "y", "z", "rgb"][: len(places)],
            "formats": types,
            "offsets": [offsets[place] for place in places],
            "itemsize": min(offsets[-1], np.iinfo(np.int32).max),
        }
    )
    chosen = [columns[place] for place in places]
    return _Header(num_points, columns[-1], chosen, record, has_color and kinds[places[3]] == "F")


def _read_ascii(file: BoundedFile, header: _Header) -> RawPoints:
    if header.num_points * header.num_columns * _MIN_NUMBER_BYTES > file.num_left + 1:
        raise ScanError(f"the .pcd header promises {header.num_points} points in {file.num_left} bytes")
    lines = point_rows.read_lines(file)
    first = next(lines, "")
    if len(first.split()) != header.num_columns:
        raise ScanError(f"the .pcd header promises {header.num_columns} numbers a point: {first[:60]!r}")
    values = point_rows.read_text_rows(file, itertools.chain([first], lines), header.columns)
    if len(values) != header.num_points:
        raise ScanError(f"the .pcd header promises {header.num_points} points, the data hold {len(values)}")
    raw = point_rows.split_colors(values[:, :3])
    if len(header.columns) == 3:
        return raw
    packed = values[:, 3]  # the bytes of a color, written as a number
    if header.has_float_color:
        with np.errstate(over="ignore"):
            packed = packed.astype(np.float32).view(np.uint32)
    else:
        packed = np.where((packed >= 0) & (packed < 2.0**32), packed, 0).astype(np.uint32)
    return raw._replace(colors=as_colors(point_rows.unpack_rgb(packed)))


def _read_compressed(file: BoundedFile, header: _Header) -> RawPoints:
    import lzf  # C, and rarely needed

    count, size = header.num_points, header.record.itemsize
    num_packed, num_unpacked = np.frombuffer(file.read_exactly(8), "<u4").tolist()
    if num_unpacked != count * size:
        raise ScanError(f"the .pcd header promises {count * size} bytes, the compressed data {num_unpacked}")
    check_size(num_unpacked, file.max_bytes)
    unpacked = lzf.decompress(file.read_exactly(num_packed), num_unpacked)
    if unpacked is None or len(unpacked) != num_unpacked:
        raise ScanError(f"the compressed data of the .pcd file do not unpack to {num_unpacked} bytes")
    points = point_rows.allocate_points(file, count)
    columns = [  # first all values of one field, then all of the next
        np.frombuffer(unpacked, field[0], count, field[1] * count)
        for field in (header.record.fields or {}).values()
    ]
    points[:] = np.stack(columns[:3], axis=1)
    return RawPoints(points, as_colors(point_rows.unpack_rgb(columns[3])) if len(columns) > 3 else None)


_READERS = {
    "ascii": _read_ascii,
    "binary": lambda file, header: point_rows.read_records(file, header.record, header.num_points),
    "binary_compressed": _read_compressed,
}
