"""Read the points of .las and .laz files (ASPRS LAS 1.0 to 1.4) by laspy, an optional dependency."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, UInt16

from reconstruction._src.base.bounded_read import BoundedFile
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.scans import point_rows
from reconstruction._src.scans.point_rows import RawPoints, as_colors

if TYPE_CHECKING:
    import laspy

_CHUNK = 1_000_000  # Points unpacked at once: 30 to 70 MB
_MAGIC = b"LASF"
_OLD_HEADER_BYTES, _HEADER_BYTES = 227, 375  # Bytes of the header of LAS 1.0 to 1.2, and of LAS 1.4
_RECORD_BYTES, _EXTENDED_BYTES = 54, 60
"""Bytes of the header of a variable length record, and of an extended one."""
_PACKED = 0x80  # Bit of the point format that says that the points are compressed
_NOISE_CLASSES = (7, 18)  # LAS 1.4, table 17: low point (noise), high noise
_MODEL_TYPE, _LENGTH_UNIT, _HEIGHT_UNIT = 1024, 3076, 4099
"""Keys of GeoTIFF 1.0: GTModelTypeGeoKey, ProjLinearUnitsGeoKey, VerticalUnitsGeoKey."""
_DEGREES = 2  # Value of GTModelTypeGeoKey for longitude and latitude
_GEO_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
"""Values of the keys of units -> meters: meter, international foot, US survey foot."""
_WKT_UNIT = re.compile(r'(?:LENGTHUNIT|UNIT)\["[^"]*"\s*,\s*([0-9.eE+-]+)')


def read_las(file: BoundedFile) -> RawPoints:
    """Read x, y, z and colors; points that the file calls noise or withheld are left out.

    The unit is that of the file's coordinate system, where it has one (GeoTIFF keys or WKT).
    """
    require_extras(f"a {file.suffix} file", "formats")
    import laspy

    _check_counts(file)
    backend = laspy.LazBackend.Lazrs  # one chunk after the other: the parallel one trusts the chunks' sizes
    with laspy.open(file.stream, closefd=False, laz_backend=backend) as reader:  # type: ignore[arg-type]
        header = reader.header
        count, size = header.point_count, header.point_format.size
        point_rows.check_num_points(file, count)
        if not header.are_points_compressed and count * size > file.size:
            raise ScanError(f"the header promises {count} points of {size} bytes in {file.size} bytes")
        meters, height_factor = find_las_units(header)
        points = point_rows.allocate_points(file, count)
        has_colors = "red" in set(header.point_format.dimension_names)
        colors = np.empty((count, 3), np.uint16) if has_colors else None
        num_read = num_kept = 0
        for chunk in reader.chunk_iterator(_CHUNK):
            chosen = _select_usable(chunk)
            num_read, start, num_kept = num_read + len(chosen), num_kept, num_kept + int(chosen.sum())
            for axis, name in enumerate("xyz"):
                points[start:num_kept, axis] = np.asarray(chunk[name])[chosen]
            if colors is not None:
                colors[start:num_kept] = _find_colors(chunk)[chosen]
    if num_read != count:
        raise ScanError(f"the header promises {count} points, the data hold {num_read}")
    points[:, 2] *= height_factor
    return RawPoints(
        points[:num_kept],
        None if colors is None else as_colors(colors[:num_kept]),
        meters=meters,
        up="z",
        num_ignored=num_read - num_kept,
    )


def _check_counts(file: BoundedFile) -> None:
    """Refuse counts that cannot be true, before laspy and lazrs take memory and hours for them."""
    head = file.read_exactly(min(_HEADER_BYTES, file.size))
    if len(head) < _OLD_HEADER_BYTES or head[:4] != _MAGIC:
        raise ScanError("no .las file: it does not begin with 'LASF' and a header")
    points_at, num_records = struct.unpack_from("<II", head, 96)
    promises = [("records", num_records * _RECORD_BYTES)]
    if head[25] >= 4 and len(head) == _HEADER_BYTES:
        promises.append(("extended records", struct.unpack_from("<I", head, 243)[0] * _EXTENDED_BYTES))
    is_packed = bool(head[104] & _PACKED)
    if is_packed and file.size >= points_at + 8:
        file.stream.seek(points_at)
        (table_at,) = struct.unpack("<q", file.read_exactly(8))
        if table_at == -1 and file.size >= 8:  # written to a stream: the place stands at the end
            file.stream.seek(file.size - 8)
            (table_at,) = struct.unpack("<q", file.read_exactly(8))
        if not 0 < table_at <= file.size - 8:
            raise ScanError("the table of its chunks lies outside the file")
        file.stream.seek(table_at + 4)
        promises.append(("chunks", struct.unpack("<I", file.read_exactly(4))[0]))
    for name, size in promises:
        if size > file.size:
            raise ScanError(f"the header promises {name} of {size} bytes in {file.size} bytes")
    file.stream.seek(0)


def _select_usable(chunk: Any) -> Bool[np.ndarray, " N"]:
    """Return which points are neither withheld nor noise."""
    is_usable = ~np.isin(np.asarray(chunk["classification"]), _NOISE_CLASSES)
    return is_usable & ~np.asarray(chunk["withheld"]).astype(bool)


def _find_colors(chunk: Any) -> UInt16[np.ndarray, "N 3"]:
    return np.stack([np.asarray(chunk[name]) for name in point_rows.COLORS], axis=1)


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
    if text:
        return _find_wkt_units(text)
    lengths, heights = _GEO_UNITS.get(keys.get(_LENGTH_UNIT, 0)), _GEO_UNITS.get(keys.get(_HEIGHT_UNIT, 0))
    return lengths, 1.0 if lengths is None or heights is None else heights / lengths


def _find_wkt_units(text: str) -> tuple[float | None, float]:
    """Return the units of a coordinate system in well-known text, as `find_las_units` does."""
    horizontal, _, vertical = text.partition("VERT")
    lengths, heights = _find_last_unit(horizontal), _find_last_unit(vertical)
    return lengths, 1.0 if lengths is None or heights is None else heights / lengths


def _find_last_unit(text: str) -> float | None:
    """Return the last unit of a text, which is that of its coordinates: units of its parts come before."""
    factors = [float(word) for word in _WKT_UNIT.findall(text)]
    return factors[-1] if factors and 1e-3 <= factors[-1] <= 1e3 else None
