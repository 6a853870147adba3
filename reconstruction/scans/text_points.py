"""Points out of text: columns, Wavefront .obj, legacy .vtk."""

from __future__ import annotations

import io
import re

import numpy as np

from reconstruction.errors import ScanError
from reconstruction.scans.scan import Array

_VTK_TYPES = {
    "float": ">f4",
    "double": ">f8",
    "int": ">i4",
    "long": ">i8",
    "short": ">i2",
    "unsigned_char": ">u1",
}
_VTK_POINTS = re.compile(rb"^\s*POINTS\s+(\S+)\s+(\S+)[ \t]*\r?\n", re.MULTILINE)


def read_text(data: bytes) -> Array:
    """Read columns parted by blanks, commas or semicolons; `#` begins a comment, names may stand first."""
    text = decode(data)
    lines = text.splitlines()
    first = next((i for i, line in enumerate(lines) if line.split("#")[0].strip()), None)
    if first is None:
        raise ScanError("holds no line with numbers")
    head = lines[first].split("#")[0].strip()
    delimiter = "," if "," in head else ";" if ";" in head else None
    words = [word.strip().strip('"').lower() for word in head.split(delimiter)]
    columns, skip = [0, 1, 2], first
    if not any(_is_number(word) for word in words):
        skip = first + 1
        if {"x", "y", "z"} <= set(words):
            columns = [words.index(name) for name in "xyz"]
    if len(words) < 3:
        raise ScanError(f"line {first + 1} has {len(words)} columns, x y z are needed: {head[:60]!r}")
    try:
        return np.loadtxt(io.StringIO(text), delimiter=delimiter, usecols=columns, skiprows=skip, ndmin=2)
    except ValueError as error:
        raise ScanError(f"not three columns of numbers: {error}") from error


def read_obj(data: bytes) -> Array:
    """Read the vertices (lines `v x y z`) of a Wavefront file."""
    rows = [line.split()[1:4] for line in decode(data).splitlines() if line.startswith(("v ", "v\t"))]
    if not rows:
        raise ScanError("the .obj file has no vertices")
    if any(len(row) != 3 for row in rows):
        raise ScanError("the .obj file has vertices with fewer than three coordinates")
    return np.array(rows, dtype=np.float64)


def read_vtk(data: bytes) -> Array:
    """Read the POINTS of a legacy .vtk file, ASCII or binary, of any kind of data set."""
    if not data.startswith(b"# vtk DataFile"):
        raise ScanError("no legacy .vtk file: it does not begin with '# vtk DataFile'")
    lines = data.split(b"\n", 3)
    form = lines[2].strip().upper() if len(lines) > 2 else b""
    found = _VTK_POINTS.search(data)
    if form not in (b"ASCII", b"BINARY") or found is None:
        raise ScanError("the .vtk file has no third line ASCII or BINARY, or no POINTS")
    number, kind = found.group(1).decode("latin1"), found.group(2).decode("latin1").lower()
    if not number.isdigit() or kind not in _VTK_TYPES:
        raise ScanError(
            f"the .vtk file has 'POINTS {number} {kind}'; known types are {', '.join(_VTK_TYPES)}"
        )
    count, body = 3 * int(number), data[found.end() :]
    if count > len(body):
        raise ScanError(f"the .vtk file promises {number} points in {len(body)} bytes")
    if form == b"BINARY":
        dtype = np.dtype(_VTK_TYPES[kind])
        if count * dtype.itemsize > len(body):
            raise ScanError(
                f"the .vtk file promises {number} points, but ends after {len(body)} bytes of them"
            )
        return np.frombuffer(body, dtype, count).reshape(-1, 3).astype(np.float64)
    words = body.split(None, count)[:count]
    if len(words) < count:
        raise ScanError(f"the .vtk file promises {number} points, but ends after {len(words)} numbers")
    return np.array(words).astype(np.float64).reshape(-1, 3)


def decode(data: bytes) -> str:
    """Decode a text file; a byte order mark is allowed, binary data is refused."""
    if b"\0" in data[:4096]:
        raise ScanError("holds binary data, not text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScanError(f"holds binary data, not text: {error}") from error


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
