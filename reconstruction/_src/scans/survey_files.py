"""Files of surveyors' scanners, read by optional libraries: .las and .laz (ASPRS LAS 1.0 to 1.4) by laspy, .e57
(ASTM E2807) by pye57.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from reconstruction._src.base.bounded_read import BoundedFile, DamagedError, check_size
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.geometry.pose import to_rotation
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.frames import RawPoints, as_colors

if TYPE_CHECKING:
    import laspy
    import pye57

CHUNK = 1_000_000  # Points unpacked at once: 30 to 70 MB
_MAGIC = b"LASF"
_OLD_HEADER_BYTES, _HEADER_BYTES = 227, 375  # Bytes of the header of LAS 1.0 to 1.2, and of LAS 1.4
_RECORD_BYTES, _EXTENDED_BYTES = 54, 60  # Of the header of a variable length record, and of an extended one
_PACKED = 0x80  # Bit of the point format that says that the points are compressed
_NO_GROUND = (5, 7, 9, 13, 14, 15, 16, 18)
"""Classes that a robot on the ground neither drives on nor meets (LAS 1.4, table 17): high vegetation, noise, water,
wires and their towers, high noise. Buildings stay, as walls."""
_UNCLASSIFIED = 1  # The highest class that says nothing
_ECHOES = 0.01
"""Share of points of pulses that came back more than once, above which a scan saw through vegetation."""
_MODEL_TYPE, _LENGTH_UNIT, _HEIGHT_UNIT = 1024, 3076, 4099  # GeoTIFF 1.0: model type, units of length, height
_DEGREES = 2  # Value of GTModelTypeGeoKey for longitude and latitude
_COORDINATE_SYSTEM = {2112, 34735}  # Records that hold one: well-known text, GeoTIFF keys
_GEO_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}  # Their values -> m: meter, foot, US survey foot
_WKT_UNIT = re.compile(r'(?:LENGTHUNIT|UNIT)\["[^"]*"\s*,\s*([0-9.eE+-]+)')

_E57_HEADER, _PAGE, _CHECKSUM = 48, 1024, 4
"""Bytes of the header of an .e57 file, of each of its pages, and of the checksum at the end of a page."""
_ENCODING = re.compile(rb"""encoding\s*=\s*["'](?!utf-8["'])""", re.IGNORECASE)
_AXES = {"cartesian": ("X", "Y", "Z"), "spherical": ("Range", "Azimuth", "Elevation")}
"""Endings of the names of the coordinates in an .e57 file; with InvalidState: 0 where a point can be used."""
_COLORS = ("colorRed", "colorGreen", "colorBlue")
_ROTATION_TOLERANCE = 1e-3  # How far the length of a quaternion may be from 1


def read_las(file: BoundedFile, classes: Sequence[int] | None = None) -> RawPoints:
    """Read x, y, z and colors of some classes (None: all that a robot on the ground meets), without withheld points.

    Unit and axis are those of the file's coordinate system, where it has one (GeoTIFF keys or WKT).
    """
    with open_las(file) as reader:
        header = reader.header
        count, size = header.point_count, header.point_format.size
        points = point_rows.allocate_points(file, count)
        if not header.are_points_compressed and count * size > file.size:
            raise DamagedError(f"the header promises {count} points of {size} bytes in {file.size} bytes")
        meters, height_factor = find_las_units(header)
        records = [*header.vlrs, *(header.evlrs or [])]
        is_on_map = any(record.record_id in _COORDINATE_SYSTEM for record in records)
        colors = np.empty((count, 3), np.uint16) if _has_colors(header) else None
        num_read = num_kept = num_echoes = 0
        has_classes = classes is not None
        for chunk in iterate_las(reader, classes):
            chosen = slice(num_kept, num_kept + len(chunk.rows))
            num_read, num_kept = num_read + chunk.num_read, chosen.stop
            num_echoes, has_classes = num_echoes + chunk.num_echoes, has_classes or chunk.has_classes
            points[chosen] = chunk.rows[:, :3]
            if colors is not None:
                colors[chosen] = chunk.rows[:, 3:]
    if num_read != count:
        raise DamagedError(f"the header promises {count} points, the data hold {num_read}")
    if classes is not None and num_read and not num_kept:
        raise ScanError(f"no point is of class {', '.join(map(str, classes))}; give other classes, or none")
    points[:, 2] *= height_factor
    return RawPoints(
        points[:num_kept],
        None if colors is None else as_colors(colors[:num_kept]),
        meters=meters,
        up="z" if is_on_map else None,
        num_ignored=num_read - num_kept,
        has_cover=not has_classes and num_echoes > _ECHOES * num_read,
    )


@contextmanager
def open_las(file: BoundedFile) -> Iterator[laspy.LasReader]:
    """Open a file whose counts can be true."""
    require_extras(f"a {file.suffix} file", "formats")
    import laspy

    _check_counts(file)
    backend = laspy.LazBackend.Lazrs  # one chunk after the other: the parallel one trusts the chunks' sizes
    with laspy.open(file.stream, closefd=False, laz_backend=backend) as reader:  # type: ignore[arg-type]
        yield reader


def _has_colors(header: laspy.LasHeader) -> bool:
    return {*point_rows.COLORS} <= set(header.point_format.dimension_names)


class LasChunk(NamedTuple):
    """Points of a file that are read at once."""

    rows: Float[np.ndarray, "N C"]  # x, y, z (red, green, blue) of those of some classes, not withheld
    num_read: int  # all
    num_echoes: int  # of pulses that came back more than once
    has_classes: bool  # whether any is said to be something


def iterate_las(reader: laspy.LasReader, classes: Sequence[int] | None = None) -> Iterator[LasChunk]:
    """Yield the points of a file, a chunk at a time."""
    names = ("x", "y", "z", *(point_rows.COLORS if _has_colors(reader.header) else ()))
    for chunk in reader.chunk_iterator(CHUNK):
        kinds = np.asarray(chunk["classification"])
        is_unusable = np.isin(kinds, _NO_GROUND) if classes is None else ~np.isin(kinds, classes)
        is_unusable |= np.asarray(chunk["withheld"]).astype(bool)
        columns = [np.asarray(chunk[name], dtype=np.float64)[~is_unusable] for name in names]
        num_echoes = int((np.asarray(chunk["number_of_returns"]) > 1).sum())
        yield LasChunk(np.stack(columns, axis=1), len(kinds), num_echoes, bool((kinds > _UNCLASSIFIED).any()))


def _check_counts(file: BoundedFile) -> None:
    """Refuse counts that cannot be true, before laspy and lazrs take memory and hours for them."""
    head = file.read_exactly(min(_HEADER_BYTES, file.size))
    if len(head) < _OLD_HEADER_BYTES or head[:4] != _MAGIC:
        raise ScanError("no .las file: it does not begin with 'LASF' and a header")
    points_at, num_records = struct.unpack_from("<II", head, 96)
    promises = [("records", num_records * _RECORD_BYTES)]
    if head[25] >= 4 and len(head) == _HEADER_BYTES:
        promises.append(("extended records", struct.unpack_from("<I", head, 243)[0] * _EXTENDED_BYTES))
    if head[104] & _PACKED and file.size >= points_at + 8:
        file.stream.seek(points_at)
        (table_at,) = struct.unpack("<q", file.read_exactly(8))
        if table_at == -1:  # written to a stream: the place stands at the end
            file.stream.seek(file.size - 8)
            (table_at,) = struct.unpack("<q", file.read_exactly(8))
        if not 0 < table_at <= file.size - 8:
            raise DamagedError("the table of its chunks lies outside the file")
        file.stream.seek(table_at + 4)
        promises.append(("chunks", struct.unpack("<I", file.read_exactly(4))[0]))
    for name, size in promises:
        if size > file.size:
            raise DamagedError(f"the header promises {name} of {size} bytes in {file.size} bytes")
    file.stream.seek(0)


def find_las_units(header: laspy.LasHeader) -> tuple[float | None, float]:
    """Return the meters of a unit of x and y, or None, and how many of them a unit of z has."""
    keys: dict[int, int] = {}
    text = ""
    for record in [*header.vlrs, *(header.evlrs or [])]:
        keys |= {key.id: key.value_offset for key in getattr(record, "geo_keys", ())}
        text = getattr(record, "string", "") or text
    if keys.get(_MODEL_TYPE) == _DEGREES or text.lstrip().startswith(("GEOGCS", "GEOGCRS", "GEODCRS")):
        raise ScanError(
            "its coordinates are degrees of longitude and latitude; project them to meters first: "
            'pdal translate IN OUT reprojection --filters.reprojection.out_srs="EPSG:..."'
        )
    horizontal, _, vertical = text.partition("VERT")
    if text:
        lengths, heights = _find_last_unit(horizontal), _find_last_unit(vertical)
    else:
        lengths, heights = (_GEO_UNITS.get(keys.get(key, 0)) for key in (_LENGTH_UNIT, _HEIGHT_UNIT))
    return lengths, 1.0 if lengths is None or heights is None else heights / lengths


def _find_last_unit(text: str) -> float | None:
    """Return the last unit of well-known text, which is that of its coordinates: units of its parts come before."""
    factors = [float(word) for word in _WKT_UNIT.findall(text)]
    return factors[-1] if factors and 1e-3 <= factors[-1] <= 1e3 else None


class _Pose(NamedTuple):
    """Where the sensor of a scan stood, and whether that is the frame of the file."""

    rotation: Float[np.ndarray, "3 3"]
    translation: Float[np.ndarray, " 3"]
    is_identity: bool


def read_e57(path: Path, max_bytes: float) -> RawPoints:
    """Read all scans of a file in their common frame; colors stand only where every scan has them.

    A scan's pose is also the position of its sensor. Files of one merged cloud have no pose or the
    identity: the origin is believed only of one scan among others that have another.
    """
    require_extras("an .e57 file", "formats")
    import pye57

    _refuse_document_type(path)
    file = pye57.E57(str(path))
    try:
        headers = [file.get_header(index) for index in range(file.scan_count)]
        check_size(point_rows.POINT_BYTES * sum(header.point_count for header in headers), max_bytes)
        poses = [_find_pose(header) for header in headers]
        has_poses = len(poses) > 1 and sum(pose.is_identity for pose in poses) <= 1
        scans = [_read_scan(file, *pair, has_poses) for pair in zip(headers, poses, strict=True)]
    finally:
        file.close()
    if not scans:
        raise ScanError("the .e57 file holds no scans; pictures alone make no cloud")
    num_ignored = sum(scan.num_ignored for scan in scans)
    scans = [scan for scan in scans if len(scan.points)] or scans[:1]
    viewpoints = [scan.viewpoints for scan in scans if scan.viewpoints is not None]
    colors = [scan.colors for scan in scans if scan.colors is not None]
    counts = [len(scan.points) for scan in scans]
    return RawPoints(
        np.concatenate([scan.points for scan in scans]),
        as_colors(np.concatenate(colors)) if len(colors) == len(scans) else None,
        np.concatenate(viewpoints) if viewpoints else None,
        np.repeat(np.arange(len(scans)), counts) if len(viewpoints) == len(scans) else None,
        meters=1.0,
        num_ignored=num_ignored,
    )


def _refuse_document_type(path: Path) -> None:
    """Refuse a file whose XML is more than that of ASTM E2807: a document type names files and addresses to be read."""
    with path.open("rb") as file:
        header = file.read(_E57_HEADER)
        if len(header) < _E57_HEADER:
            raise DamagedError(f"an .e57 file has a header of {_E57_HEADER} bytes, this one {len(header)}")
        offset, length, page = struct.unpack("<QQQ", header[24:])
        is_in_page = page == _PAGE and offset % _PAGE < _PAGE - _CHECKSUM
        if not is_in_page or offset + length > path.stat().st_size:
            raise DamagedError(f"its header names pages of {page} bytes, {length} bytes of XML at {offset}")
        file.seek(offset)
        first = _PAGE - offset % _PAGE
        data = file.read(first + (length // (_PAGE - _CHECKSUM) + 1) * _PAGE)
    begins = [0, *range(first, len(data), _PAGE)]
    ends = [first, *(begin + _PAGE for begin in begins[1:])]
    xml = b"".join(data[begin : end - _CHECKSUM] for begin, end in zip(begins, ends, strict=True))[:length]
    is_utf8 = xml.startswith((b"<", b"\xef\xbb\xbf<")) and b"\0" not in xml
    if not is_utf8 or _ENCODING.search(xml[: xml.find(b"?>") + 1]) or b"<!DOCTYPE" in xml:
        raise ScanError("its XML has a document type, or is not UTF-8; export it anew")


def _read_scan(file: pye57.E57, header: Any, pose: _Pose, has_poses: bool) -> RawPoints:
    """Return a scan, turned and moved by its pose, its colors in their own range."""
    fields = {*header.point_fields}
    kinds = [kind for kind, ends in _AXES.items() if {kind + end for end in ends} <= fields]
    if not kinds:
        raise ScanError(f"the .e57 file has points of {', '.join(sorted(fields)) or 'no fields'}, not x y z")
    kind = kinds[0]
    has_colors, has_state = {*_COLORS} <= fields, f"{kind}InvalidState" in fields
    names = (
        [kind + end for end in _AXES[kind]] + [*_COLORS] * has_colors + [f"{kind}InvalidState"] * has_state
    )
    columns = _read_columns(file, header, names)
    if kind == "spherical":
        columns[:3] = to_cartesian(columns[:3])
    points = columns[:3].T
    is_usable = columns[-1] == 0 if has_state else np.ones(len(points), bool)
    return RawPoints(
        points[is_usable] @ pose.rotation.T + pose.translation,
        columns[3:6].T[is_usable] if has_colors else None,
        None if pose.is_identity and not has_poses else pose.translation[None],
        num_ignored=int((~is_usable).sum()),
    )


def to_cartesian(polar: Float[np.ndarray, "3 N"]) -> Float[np.ndarray, "3 N"]:
    """Return range, azimuth and elevation as x, y, z (ASTM E2807, 8.4.4)."""
    distance, azimuth, elevation = polar
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)])


def _read_columns(file: pye57.E57, header: Any, names: Sequence[str]) -> Float[np.ndarray, "C N"]:
    """Return fields of a scan's points, one a row."""
    from pye57 import libe57  # pyright: ignore[reportAttributeAccessIssue]

    count = header.point_count
    columns = np.zeros((len(names), max(count, 1)))
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in zip(names, columns, strict=True):
        buffers.append(libe57.SourceDestBuffer(file.image_file, name, column, len(column), True, True))
    reader = header.points.reader(buffers)
    num_read = int(reader.read()) if count else 0
    if num_read != count:
        raise DamagedError(f"the .e57 file promises {count} points, the data hold {num_read}")
    reader.close()
    return columns[:, :count]


def _find_pose(header: Any) -> _Pose:
    """Return where the sensor of a scan stood: the identity where the file does not say."""
    values: dict[str, Shaped[np.ndarray, " C"]] = {}
    for group, names, default in (("rotation", "wxyz", [1.0, 0, 0, 0]), ("translation", "xyz", [0.0, 0, 0])):
        is_known = header.has_pose() and header["pose"].isDefined(group)
        part = [header["pose"][group][name].value() for name in names] if is_known else default
        values[group] = np.array(part, dtype=np.float64)
    rotation, translation = values["rotation"], values["translation"]
    length = np.linalg.norm(rotation)
    if not np.isfinite(translation).all() or not abs(length - 1) < _ROTATION_TOLERANCE:
        raise ScanError(f"the .e57 file has a scan of pose {rotation.tolist()}, {translation.tolist()}")
    matrix = to_rotation(rotation[None] / length)[0]
    return _Pose(matrix, translation, bool(np.array_equal(matrix, np.eye(3)) and not translation.any()))
