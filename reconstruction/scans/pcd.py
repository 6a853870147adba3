"""Points out of a .pcd file (Point Cloud Library): ascii, binary, binary_compressed."""

from __future__ import annotations

import io
import struct

import numpy as np

from reconstruction.errors import ScanError
from reconstruction.extras import require_extras
from reconstruction.scans.scan import Array


def read_pcd(data: bytes) -> Array:
    """Read x, y, z; the header is checked against the data before anything is allocated."""
    require_extras("reading a .pcd file", "scan")
    from pypcd4.pypcd4 import PointCloud  # slow to import, and rarely needed

    header, body = _split(data)
    count, row = _check_header(header, body)
    if header["DATA"][0] == "ascii":
        return _read_ascii(header, body, count)
    if header["DATA"][0] == "binary" and len(body) < count * row:
        raise ScanError(
            f"the .pcd header promises {count} points of {row} bytes, but only {len(body)} bytes follow"
        )
    if header["DATA"][0] == "binary_compressed":
        _check_compressed(body, count * row)
    try:
        points = PointCloud.from_fileobj(io.BufferedReader(io.BytesIO(data))).numpy(("x", "y", "z"))  # type: ignore[arg-type]
    except (RuntimeError, struct.error, AttributeError) as error:
        raise ScanError(f"not a readable .pcd file: {error}") from error
    if len(points) != count:
        raise ScanError(f"the .pcd header promises {count} points, the data hold {len(points)}")
    return points.astype(np.float64)


def _split(data: bytes) -> tuple[dict[str, list[str]], bytes]:
    at = data.find(b"\nDATA ")
    end = data.find(b"\n", at + 1)
    if at < 0 or end < 0:
        raise ScanError("the .pcd file has no line DATA followed by data")
    try:
        lines = data[:end].decode("ascii").splitlines()
    except UnicodeDecodeError as error:
        raise ScanError(f"the .pcd header is not text: {error}") from error
    words = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    return {line[0].upper(): line[1:] for line in words}, data[end + 1 :]


def _check_header(header: dict[str, list[str]], body: bytes) -> tuple[int, int]:
    """Return the number of points and the bytes of one."""
    missing = [
        name
        for name in ("FIELDS", "SIZE", "TYPE", "WIDTH", "HEIGHT", "POINTS", "DATA")
        if not header.get(name)
    ]
    if missing:
        raise ScanError(f"the .pcd header lacks {', '.join(missing)}")
    fields = header["FIELDS"]
    counts = header.get("COUNT", ["1"] * len(fields))
    try:
        width, height, points = (int(header[name][0]) for name in ("WIDTH", "HEIGHT", "POINTS"))
        sizes, repeats = [int(v) for v in header["SIZE"]], [int(v) for v in counts]
    except ValueError as error:
        raise ScanError(f"the .pcd header has text where a number belongs: {error}") from error
    if not len(fields) == len(sizes) == len(repeats) == len(header["TYPE"]):
        raise ScanError("FIELDS, SIZE, TYPE and COUNT of the .pcd header have different lengths")
    if not {"x", "y", "z"} <= set(fields):
        raise ScanError(f"the .pcd file has the fields {' '.join(fields)}, x y z are needed")
    if width * height != points or points < 0:
        raise ScanError(f"the .pcd header lies: width {width} x height {height} is not {points} points")
    known = {("F", 4), ("F", 8), *((kind, size) for kind in "IU" for size in (1, 2, 4, 8))}
    if any(pair not in known for pair in zip(header["TYPE"], sizes, strict=True)) or min(repeats) < 1:
        raise ScanError("the .pcd header has a field of unknown type or size")
    if header["DATA"][0] not in ("ascii", "binary", "binary_compressed"):
        raise ScanError(
            f"the .pcd file has DATA {header['DATA'][0]}; ascii, binary, binary_compressed are known"
        )
    return points, sum(size * repeat for size, repeat in zip(sizes, repeats, strict=True))


def _read_ascii(header: dict[str, list[str]], body: bytes, count: int) -> Array:
    repeats = [int(v) for v in header.get("COUNT", ["1"] * len(header["FIELDS"]))]
    starts = np.cumsum([0, *repeats])
    columns = [int(starts[header["FIELDS"].index(name)]) for name in "xyz"]
    if count * 2 * max(columns) > len(body):
        raise ScanError(f"the .pcd header promises {count} points in {len(body)} bytes")
    try:
        points = np.loadtxt(io.BytesIO(body), usecols=columns, ndmin=2)
    except ValueError as error:
        raise ScanError(f"the .pcd file holds other things than numbers: {error}") from error
    if len(points) != count:
        raise ScanError(f"the .pcd header promises {count} points, the data hold {len(points)}")
    return points


def _check_compressed(body: bytes, size: int) -> None:
    if len(body) < 8:
        raise ScanError("the .pcd file ends before its compressed data")
    packed, unpacked = struct.unpack("<II", body[:8])
    if unpacked != size or packed > len(body) - 8:
        raise ScanError(
            f"the .pcd file promises {size} bytes from {packed} compressed ones;"
            f" it says {unpacked} and holds {len(body) - 8}"
        )
