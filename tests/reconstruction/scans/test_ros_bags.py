"""Recordings of ROS 1 and 2: the largest cloud of them."""

from pathlib import Path

import numpy as np
import pytest

import reconstruction as rc
from reconstruction import ScanError

pytest.importorskip("rosbags")
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

POINTS = np.random.default_rng(0).uniform(-5.0, 5.0, (60, 3)).astype("<f4")
COLORS = np.random.default_rng(1).integers(0, 256, (60, 3))
CLOUD = "sensor_msgs/msg/PointCloud2"


def make(store, points=POINTS, height=1, padding=0, big=False):
    """Return a message with an intensity, a color, and bytes of padding after each row."""
    types, order = store.types, ">" if big else "<"
    record = np.dtype(
        [("x", f"{order}f4"), ("i", "u1"), ("y", f"{order}f4"), ("z", f"{order}f8"), ("rgb", f"{order}u4")]
    )
    rows = np.zeros(len(points), record)
    for k, name in enumerate("xyz"):
        rows[name] = points[:, k]
    rows["rgb"] = COLORS[: len(points)] @ [1 << 16, 1 << 8, 1]
    numbers = {
        "f4": 7,
        "f8": 8,
        "u1": 2,
        "u4": 7,
    }  # colors are written as if they were floating point numbers
    fields = [
        types["sensor_msgs/msg/PointField"](name, int(kind[1]), numbers[kind[0].str[1:]], 1)
        for name, kind in (record.fields or {}).items()
    ]
    width = len(points) // height
    data = np.frombuffer(rows.tobytes(), np.uint8).reshape(height, -1)
    data = np.pad(data, ((0, 0), (0, padding)))
    time = types["builtin_interfaces/msg/Time"](0, 0)
    header = types["std_msgs/msg/Header"]
    stamped = header(0, time, "laser") if "seq" in header.__dataclass_fields__ else header(time, "laser")
    step = data.shape[1]
    return types[CLOUD](stamped, height, width, fields, big, record.itemsize, step, data.reshape(-1), True)


def write_first(path: Path, *clouds) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as writer:
        topic = writer.add_connection("/points", CLOUD, typestore=store)
        text = writer.add_connection("/said", "std_msgs/msg/String", typestore=store)
        said = store.types["std_msgs/msg/String"]("x" * 9999)
        writer.write(text, 1, store.serialize_ros1(said, "std_msgs/msg/String"))
        for k, options in enumerate(clouds):
            writer.write(topic, k + 2, store.serialize_ros1(make(store, **options), CLOUD))
    return path


def write_second(folder: Path, *clouds) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/points", CLOUD, typestore=store)
        for k, options in enumerate(clouds):
            writer.write(topic, k + 1, store.serialize_cdr(make(store, **options), CLOUD))
    return next(folder.glob("*.mcap"))


@pytest.mark.parametrize("options", [{}, {"height": 6, "padding": 5}, {"big": True}])
def test_the_largest_cloud_is_read_with_its_colors(tmp_path: Path, options: dict) -> None:
    small = {"points": POINTS[:20] + 1.0}
    for path in (
        write_first(tmp_path / "a.bag", small, options, small),
        write_second(tmp_path / "a", small, options, small),
    ):
        cloud = rc.load_cloud(path)
        np.testing.assert_array_equal(cloud.points, POINTS.astype(float))
        np.testing.assert_array_equal(cloud.colors, COLORS)


def test_what_holds_no_cloud_or_is_damaged_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScanError, match="no topic of it has clouds"):
        rc.load_cloud(write_first(tmp_path / "empty.bag"))
    for path in (write_first(tmp_path / "a.bag", {}), write_second(tmp_path / "a", {})):
        content, cut = path.read_bytes(), path.with_name(f"cut{path.suffix}")
        for part in (content[:-300], content[: len(content) // 2], content[:40], b"#ROSBAG V2.0\n"):
            cut.write_bytes(part)
            with pytest.raises(ScanError, match=cut.name):
                rc.load_cloud(cut)
        with pytest.raises(ScanError, match="limit"):
            rc.load_cloud(path, max_bytes=500)
    (tmp_path / "a.db3").write_bytes(b"SQLite")
    with pytest.raises(ScanError, match="ros2 bag convert"):
        rc.load_cloud(tmp_path / "a.db3")
