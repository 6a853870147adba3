"""Read the points of a .pcd file (Point Cloud Library): ascii, binary, binary_compressed."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from reconstruction.errors import ScanError
from reconstruction.files.bounded_read import BoundedFile, check_size
from reconstruction.scans import point_rows

_NEEDED = ("FIELDS", "SIZE", "TYPE", "WIDTH", "HEIGHT", "POINTS", "DATA")
_MIN_NUMBER_BYTES = 2
"""A number in text takes a digit and a blank, at least."""
_TYPES = {("F", 4), ("F", 8), *((kind, size) for kind in "IU" for size in (1, 2, 4, 8))}


class _Header(NamedTuple):
    """The contents of a header.

    Attributes:
        num_points: `POINTS`.
        num_columns: values of one point.
        num_bytes: bytes of one point.
        columns: columns of x, y, z among the values.
        offsets: offsets of x, y, z in a point [bytes].
        types: types of x, y, z.
        data: ascii, binary or binary_compressed.
    """

    num_points: int
    num_columns: int
    num_bytes: int
    columns: list[int]
    offsets: list[int]
    types: list[str]
    data: str


def read_pcd(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    """Read x, y, z; the header is checked against the data before anything is allocated.

    Raises:
        ScanError: the header is incomplete or contradicts itself or the data.
        UnreadableFileError: the file ends before its data, or exceeds its limit.
    """
    header = _read_header(file)
    if header.data == "ascii":
        return _read_ascii(file, header)
    if header.data == "binary_compressed":
        return _read_compressed(file, header)
    record = np.dtype(
        {
            "names": list("xyz"),
            "formats": header.types,
            "offsets": header.offsets,
            "itemsize": min(header.num_bytes, np.iinfo(np.int32).max),
        }
    )
    return point_rows.read_records(file, record, header.num_points)


def _read_header(file: BoundedFile) -> _Header:
    words: dict[str, list[str]] = {}
    while "DATA" not in words:
        line = point_rows.read_header_line(file)
        if line and not line.startswith("#"):
            words[line.split()[0].upper()] = line.split()[1:]
    missing = [name for name in _NEEDED if not words.get(name)]
    if missing:
        raise ScanError(f"the .pcd header lacks {', '.join(missing)}")
    return _check_header(words)


def _check_header(words: dict[str, list[str]]) -> _Header:
    fields, kinds, data = words["FIELDS"], words["TYPE"], words["DATA"][0]
    sizes = [point_rows.parse_count(word) for word in words["SIZE"]]
    repeats = [point_rows.parse_count(word) for word in words.get("COUNT", ["1"] * len(fields))]
    width, height, num_points = (
        point_rows.parse_count(words[name][0]) for name in ("WIDTH", "HEIGHT", "POINTS")
    )
    if not len(fields) == len(sizes) == len(repeats) == len(kinds):
        raise ScanError("FIELDS, SIZE, TYPE and COUNT of the .pcd header have different lengths")
    if width * height != num_points:
        raise ScanError(
            f"the .pcd header contradicts itself: width {width} x height {height} is not {num_points} points"
        )
    if not _TYPES.issuperset(zip(kinds, sizes, strict=True)) or min(repeats) < 1:
        raise ScanError("the .pcd header has a field of unknown type or size")
    places = [fields.index(name) for name in "xyz" if name in fields]
    if len(places) != 3 or any(repeats[place] != 1 for place in places):
        raise ScanError(f"the .pcd file has the fields {' '.join(fields)}, single x y z are needed")
    if data not in ("ascii", "binary", "binary_compressed"):
        raise ScanError(f"the .pcd file has DATA {data}; ascii, binary, binary_compressed are known")
    columns = [0, *itertools.accumulate(repeats)]
    offsets = [0, *itertools.accumulate(size * repeat for size, repeat in zip(sizes, repeats, strict=True))]
    return _Header(
        num_points,
        columns[-1],
        offsets[-1],
        [columns[place] for place in places],
        [offsets[place] for place in places],
        [f"<{kinds[place].lower()}{sizes[place]}" for place in places],
        data,
    )


def _read_ascii(file: BoundedFile, header: _Header) -> Float[np.ndarray, "N 3"]:
    if header.num_points * header.num_columns * _MIN_NUMBER_BYTES > file.num_left + 1:
        raise ScanError(
            f"the .pcd header promises {header.num_points} points of {header.num_columns} numbers "
            f"in {file.num_left} bytes"
        )
    lines = point_rows.read_lines(file)
    first = next(lines, "")
    if len(first.split()) != header.num_columns:
        raise ScanError(
            f"the .pcd header promises {header.num_columns} numbers a point, the first has {len(first.split())}"
        )
    points = point_rows.read_text_rows(file, itertools.chain([first], lines), header.columns)
    if len(points) != header.num_points:
        raise ScanError(f"the .pcd header promises {header.num_points} points, the data hold {len(points)}")
    return points


def _read_compressed(file: BoundedFile, header: _Header) -> Float[np.ndarray, "N 3"]:
    import lzf  # C, and rarely needed

    num_packed, num_unpacked = np.frombuffer(file.read_exactly(8), "<u4").tolist()
    if num_unpacked != header.num_points * header.num_bytes:
        raise ScanError(
            f"the .pcd header promises {header.num_points} points of {header.num_bytes} bytes, "
            f"the compressed data {num_unpacked} bytes"
        )
    check_size(num_unpacked, file.max_bytes)
    unpacked = lzf.decompress(file.read_exactly(num_packed), num_unpacked)
    if unpacked is None or len(unpacked) != num_unpacked:
        raise ScanError(f"the compressed data of the .pcd file do not unpack to {num_unpacked} bytes")
    points = point_rows.allocate_points(file, header.num_points)
    for axis in range(3):  # first all values of one field, then all of the next
        start = header.offsets[axis] * header.num_points
        points[:, axis] = np.frombuffer(unpacked, header.types[axis], header.num_points, start)
    return points
