"""Recordings of ROS, read by `rosbags`: the largest cloud (sensor_msgs/PointCloud2) of a .bag or an .mcap."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from reconstruction._src.base.bounded_read import check_size
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.scans.frames import RawPoints, as_colors
from reconstruction._src.scans.point_rows import POINT_BYTES, unpack_rgb

_CLOUD = "sensor_msgs/msg/PointCloud2"
_TYPES = (None, "i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")  # of PointField.datatype
_COLORS = ("rgb", "rgba")  # Fields with a color as the four bytes of a number, 0xRRGGBB


def read_bag(path: Path, max_bytes: float) -> RawPoints:
    """Read the last of the largest clouds, in its own frame: the whole of a map that grows, or one sweep.

    Messages are read by the definition that ROS has of them, never by one that the file brings.
    """
    require_extras("a recording of ROS", "formats")
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    is_first = path.suffix.lower() == ".bag"
    largest = b""
    with (rosbag1 if is_first else rosbag2).Reader(path) as reader:
        clouds = [each for each in reader.connections if each.msgtype == _CLOUD]
        for _, _, data in reader.messages(clouds) if clouds else ():
            largest = data if len(data) >= len(largest) else largest
    if not largest:
        raise ScanError(f"no topic of it has clouds ({_CLOUD})")
    store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
    read = store.deserialize_ros1 if is_first else store.deserialize_cdr
    return _read_cloud(read(largest, _CLOUD), max_bytes)


def _read_cloud(cloud: Any, max_bytes: float) -> RawPoints:
    check_size(POINT_BYTES * cloud.width * cloud.height, max_bytes)
    fields = {each.name: each for each in cloud.fields}
    missing = [name for name in "xyz" if name not in fields]
    if missing or any(not 0 < each.datatype < len(_TYPES) for each in fields.values()):
        raise ScanError(f"its clouds have the fields {', '.join(fields)}, x y z of known types are needed")
    names = [name for name in ("x", "y", "z", *_COLORS) if name in fields]
    order = ">" if cloud.is_bigendian else "<"
    kinds = [order + str("u4" if name in _COLORS else _TYPES[fields[name].datatype]) for name in names]
    offsets = [fields[name].offset for name in names]
    record = np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": cloud.point_step})
    held = np.asarray(cloud.data, np.uint8)[: cloud.height * cloud.row_step]
    used = held.reshape(cloud.height, cloud.row_step)[:, : cloud.width * cloud.point_step]
    points = np.ascontiguousarray(used).reshape(-1).view(record)
    colors = [as_colors(unpack_rgb(points[name].astype(np.uint32))) for name in names if name in _COLORS]
    places = np.stack([points[name].astype(float) for name in "xyz"], axis=1)
    return RawPoints(places, *colors[:1], meters=1.0)
