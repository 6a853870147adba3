"""Clouds whose files say nothing: where the scanner stood, and which way is up."""

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import trimesh

import reconstruction as rc
from reconstruction._src.geometry.pose import make_rotation
from reconstruction._src.scans.frames import CAMERA_AXES, UP_AXES
from reconstruction._src.scans.sensor_frame import (
    find_tilt,
    find_up,
    find_upright,
    has_ground_below,
    is_seen_from_origin,
    may_look_down,
)

ROOM = [
    trimesh.creation.box([8.0, 6.0, 2.6], trimesh.transformations.translation_matrix([0, 0, 0.8])),
    trimesh.creation.box([0.4, 0.4, 1.5], trimesh.transformations.translation_matrix([1.5, 1.0, 0.25])),
    trimesh.creation.box([1.6, 0.8, 0.1], trimesh.transformations.translation_matrix([2.0, -1.0, 0.2])),
    trimesh.creation.box([0.5, 2.0, 2.0], trimesh.transformations.translation_matrix([-2.0, 0.0, 0.5])),
]


def cast(rays: np.ndarray) -> np.ndarray:
    """Return where rays from the origin first meet the room: the nearest of the entries into boxes by their slabs."""
    with np.errstate(divide="ignore"):
        inverse = 1.0 / rays
    reach = np.full(len(rays), np.inf)
    for k, box in enumerate(ROOM):
        ends = np.sort(np.stack([box.bounds[0] * inverse, box.bounds[1] * inverse]), axis=0)
        enters, leaves = ends[0].max(axis=1), ends[1].min(axis=1)
        reach = np.minimum(
            reach, leaves if k == 0 else np.where((enters > 0) & (enters < leaves), enters, np.inf)
        )
    return rays * reach[:, None]


def scan() -> np.ndarray:
    rays = np.random.default_rng(0).normal(size=(20_000, 3))
    return cast(rays / np.linalg.norm(rays, axis=1)[:, None])


def picture(roll: float, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the readings of a camera in its own frame, and the rotation from there to the room."""
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 160), np.linspace(-0.45, 0.45, 120))
    rays = np.stack([u.ravel(), v.ravel(), np.ones(u.size)], axis=1)
    rotation = make_rotation(roll, pitch, 0.3) @ CAMERA_AXES
    return cast(rays @ rotation.T) @ rotation, rotation


def test_a_scan_was_seen_from_the_origin_and_a_map_was_not() -> None:
    points = scan()
    assert is_seen_from_origin(points)
    assert has_ground_below(points)
    assert not has_ground_below(points + np.array([0.0, 0.0, 0.4]))  # 0.1 m over the floor
    surfaces = [trimesh.sample.sample_surface(box, 5_000, seed=k)[0] for k, box in enumerate(ROOM)]
    assert not is_seen_from_origin(np.concatenate(surfaces))
    assert not is_seen_from_origin(points[:500])  # too few to tell
    assert not is_seen_from_origin(
        points + np.array([3000.0, 0.0, 0.0])
    )  # where coordinates begin nobody stood


def test_terrain_over_the_origin_was_not_seen_from_there_nor_by_a_camera() -> None:
    rng = np.random.default_rng(1)
    tile = np.column_stack([rng.uniform(-4, 4, (20_000, 2)), rng.normal(5.0, 0.02, 20_000)])
    assert is_seen_from_origin(tile)
    assert not has_ground_below(tile)
    assert find_upright(tile) is None
    assert find_upright(scan()) is None  # looks all around


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.2, 0.4), (-0.4, 0.1), (0.1, -0.15), (0.0, 0.6)])
def test_the_floor_of_a_camera_becomes_level(roll: float, pitch: float) -> None:
    points, rotation = picture(roll, pitch)
    upright = find_upright(points)
    assert upright is not None
    np.testing.assert_allclose(upright @ upright.T, np.eye(3), atol=1e-12)
    up = upright @ rotation.T @ [0.0, 0.0, 1.0]
    assert np.degrees(np.arccos(up[2])) < 0.5


@pytest.mark.parametrize(
    "turn", [(-1.0, -1.0, 1.0), (1.0, -1.0, -1.0)], ids=["y up, z ahead", "y up, -z ahead"]
)
def test_other_frames_of_cameras_are_known(turn: tuple[float, float, float]) -> None:
    points, rotation = picture(0.1, 0.4)
    is_low = (points @ rotation.T)[:, 2] < 2.0  # no ceiling, which is a floor in the frame of another camera
    upright = find_upright(points[is_low] * turn)
    assert upright is not None
    assert np.degrees(np.arccos((upright @ (rotation.T @ [0.0, 0.0, 1.0] * turn))[2])) < 0.5
    assert np.linalg.det(upright) == pytest.approx(1.0)


def test_what_only_lies_ahead_or_shows_no_floor_is_no_camera_s() -> None:
    points, rotation = picture(0.0, 0.2)
    assert find_upright(20.0 * points) is None  # a valley
    height = (points @ rotation.T)[:, 2]
    is_wall = (height > -0.45) & ~((height > 0.1) & (height < 0.3))
    few = np.random.default_rng(0).random(len(points)) < 0.02
    assert find_upright(points[is_wall | few]) is None
    surfaces = trimesh.sample.sample_surface(trimesh.util.concatenate(ROOM), 20_000, seed=0)[0]
    assert find_upright(surfaces @ CAMERA_AXES + np.array([0.0, 0.0, 8.0])) is None  # a map before the origin


@pytest.mark.parametrize(("depth", "looks_down"), [(2.5, True), (3.0, False), (3.5, False)])
def test_a_camera_that_may_look_down_is_asked_about(tmp_path: Path, depth: float, looks_down: bool) -> None:
    """What stands out to the origin hangs below ground; what stands on it lies behind."""
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 160), np.linspace(-0.45, 0.45, 120))
    z = np.where((np.abs(u) < 0.15) & (np.abs(v - 0.1) < 0.15), depth, 3.0).ravel()
    points = np.stack([u.ravel() * z, v.ravel() * z, z], axis=1)
    assert may_look_down(points) == looks_down
    np.save(tmp_path / "seen.npy", points)
    with pytest.raises(rc.ScanError, match="give --up -z if so") if looks_down else nullcontext():
        assert rc.load_cloud(tmp_path / "seen.npy").points == pytest.approx(points)
    cloud = rc.load_cloud(tmp_path / "seen.npy", up="-z")
    assert cloud.viewpoints == pytest.approx(np.zeros((1, 3)))
    assert np.median(cloud.points[:, 2]) == pytest.approx(-3.0)


def test_walls_without_a_floor_are_not_turned_and_viewpoints_of_a_file_are(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    along, up, side = (
        rng.uniform(-3, 3, 40_000),
        rng.uniform(0, 2.5, 40_000),
        3.0 * rng.choice([-1, 1], 40_000),
    )
    is_long = rng.random(40_000) < 0.6
    walls = np.where(is_long[:, None], np.column_stack([along, side, up]), np.column_stack([side, along, up]))
    np.save(tmp_path / "walls.npy", walls)
    np.testing.assert_array_equal(rc.load_cloud(tmp_path / "walls.npy").points, walls)
    ground = np.column_stack([rng.uniform(-9, 9, (40_000, 2)), rng.normal(0.0, 0.02, 40_000)])
    matrix, seen = np.array(UP_AXES["y"], float), np.array([[1.0, 2.0, 1.5]])
    np.savez(tmp_path / "ground.npz", points=ground @ matrix, viewpoints=seen @ matrix)
    np.testing.assert_allclose(rc.load_cloud(tmp_path / "ground.npz").viewpoints, seen, atol=1e-12)


def test_a_file_is_read_so_and_options_and_known_viewpoints_are_left(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    points, _ = picture(0.2, 0.4)
    np.save(tmp_path / "camera.npy", points)
    np.save(tmp_path / "more.npy", np.append(points, np.zeros((1, 3)), axis=0))
    assert rc.load_cloud(tmp_path / "more.npy").num_points == len(points), "none where the scanner stood"
    cloud = rc.load_cloud(tmp_path / "camera.npy")
    assert "floor is level" in caplog.text
    assert "taken to have stood at the origin" in caplog.text
    np.testing.assert_array_equal(cloud.viewpoints, [[0.0, 0.0, 0.0]])
    lowest = cloud.points[:, 2] < cloud.points[:, 2].min() + 0.02
    assert lowest.sum() > 1000  # the floor, at 0.5 m below the camera
    np.testing.assert_allclose(cloud.points[:, 2].min(), -0.5, atol=0.02)
    given = rc.load_cloud(tmp_path / "camera.npy", up="-y")
    np.testing.assert_array_equal(given.points[:, 2], -points[:, 1])
    seen = rc.load_cloud(tmp_path / "camera.npy", viewpoints=[0.0, 0.0, 0.2])  # in the turned frame
    np.testing.assert_array_equal(seen.points, cloud.points)
    np.testing.assert_array_equal(seen.viewpoints, [[0.0, 0.0, 0.2]])
    known = rc.load_cloud(tmp_path / "camera.npy", up="z", viewpoints=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(known.points, points)
    np.testing.assert_array_equal(known.viewpoints, [[1.0, 2.0, 3.0]])


def test_a_depth_image_without_a_pose_is_turned_likewise(tmp_path: Path) -> None:
    points, _ = picture(0.2, 0.4)
    np.save(tmp_path / "depth.npy", points[:, 2].reshape(120, 160).astype(np.float32))
    cloud = rc.load_depth_image(tmp_path / "depth.npy", rc.Intrinsics(159 / 1.2, 119 / 0.9, 79.5, 59.5))
    assert abs(cloud.points[:, 2].min() + 0.5) < 0.02
    assert (cloud.points[:, 2] < -0.48).sum() > 1000  # the floor


@pytest.mark.parametrize("up", ["x", "y", "-y"])
def test_terrain_that_lies_along_another_axis_is_turned_and_a_room_is_not(tmp_path: Path, up: str) -> None:
    rng = np.random.default_rng(2)
    ground = np.column_stack([rng.uniform(-9, 9, (40_000, 2)), rng.normal(0.0, 0.02, 40_000)])
    trunks = np.column_stack(
        [rng.integers(-8, 8, (4_000, 2)) + 0.1 * rng.normal(size=(4_000, 2)), rng.uniform(0, 3, 4_000)]
    )
    level = np.concatenate([ground, trunks])
    np.save(tmp_path / "terrain.npy", level @ np.array(UP_AXES[up], float))
    np.testing.assert_allclose(rc.load_cloud(tmp_path / "terrain.npy").points, level, atol=1e-12)
    below = level * [1.0, 1.0, -1.0]  # z may be depth: nothing tells
    np.save(tmp_path / "below.npy", below)
    np.testing.assert_array_equal(rc.load_cloud(tmp_path / "below.npy").points, below)
    surfaces = [trimesh.sample.sample_surface(box, 5_000, seed=k)[0] for k, box in enumerate(ROOM)]
    np.save(tmp_path / "room.npy", np.concatenate(surfaces) @ np.array(UP_AXES[up], float))
    np.testing.assert_array_equal(rc.load_cloud(tmp_path / "room.npy").points, np.load(tmp_path / "room.npy"))


def test_a_tilted_room_becomes_level_and_a_hillside_or_a_room_on_its_side_is_left(tmp_path: Path) -> None:
    room = trimesh.sample.sample_surface(trimesh.util.concatenate(ROOM), 40_000, seed=0)[0]
    for roll, pitch in ((0.4, 0.2), (-0.3, -0.5), (0.0, 0.6)):
        np.save(tmp_path / "tilted.npy", room @ make_rotation(roll, pitch, 0.7).T)
        heights = rc.load_cloud(tmp_path / "tilted.npy").points[:, 2]
        assert np.mean(np.abs(heights - heights.min()) < 0.1) > 0.25  # the floor
    assert find_tilt(room) is None
    assert find_tilt(room @ make_rotation(0.1, 0.1, 0.0).T) is None  # a slope, perhaps
    assert find_tilt(room @ np.array(UP_AXES["y"]) @ make_rotation(0.0, 0.5, 0.0).T) is None
    hillside = np.random.default_rng(4).uniform([-9, -9, 0], [9, 9, 0.05], (40_000, 3))
    assert find_tilt(hillside @ make_rotation(0.0, 0.5, 0.0).T) is None


@pytest.mark.parametrize("up", ["x", "y", "-y", "z"])
def test_up_of_a_room_is_where_floors_lie_across_and_walls_along(up: str) -> None:
    """With as much of walls as of floor and table; the room stands at an angle to the other axes."""
    parts = [
        trimesh.creation.box(size, trimesh.transformations.translation_matrix(place))
        for size, place in (
            ((3, 2, 0.01), (0, 0, 0)),
            ((3, 0.01, 2), (0, 1, 1)),
            ((0.01, 2, 2), (-1.5, 0, 1)),
            ((1, 1, 0.05), (-1, 0.5, 0.7)),
        )
    ]
    room = trimesh.util.concatenate(parts)
    points = trimesh.sample.sample_surface(room, 40_000, seed=0)[0] @ make_rotation(yaw=0.4).T
    points += np.random.default_rng(0).normal(0.0, 0.002, points.shape)
    matrix = np.array(UP_AXES[up])
    assert find_up(points @ matrix) == (None if up == "z" else up)
    tilted = make_rotation(roll=0.3).T
    assert find_up(points @ tilted @ matrix) is None


def test_a_scanner_between_long_walls_is_not_turned(tmp_path: Path) -> None:
    """Its few level beams hardly meet the floor, so that most of what is flat looks sideways."""
    heading, rise = np.meshgrid(np.linspace(-np.pi, np.pi, 1800), np.deg2rad(np.linspace(-10, 10, 16)))
    rays = np.column_stack(
        [
            (np.cos(rise) * np.cos(heading)).ravel(),
            (np.cos(rise) * np.sin(heading)).ravel(),
            np.sin(rise).ravel(),
        ]
    )
    reach = 1.0 / np.maximum(np.abs(rays / [10.0, 1.5, 1.0]).max(axis=1), 1e-9)
    points = rays * reach[:, None]
    assert find_up(points) is None
    assert find_up(points + np.array([0.0, 90.0, 0.0])) in ("y", "-y")  # not seen from the origin
    np.save(tmp_path / "corridor.npy", points)
    np.testing.assert_array_equal(rc.load_cloud(tmp_path / "corridor.npy").points, points)


@pytest.mark.parametrize("up", ["x", "y", "-y"])
def test_up_of_a_landscape_is_where_it_is_flat(up: str) -> None:
    """With fewer level places than tell of a room; the front of a house stands upright and is as flat."""
    rng = np.random.default_rng(5)
    ground = np.column_stack([rng.uniform(-60, 60, (900, 2)), rng.normal(0.0, 0.2, 900)])
    trees = rng.uniform([-60, -60, 0], [60, 60, 9], (600, 3))
    landscape = np.concatenate([ground, trees])
    assert find_up(landscape) is None
    assert find_up(landscape @ np.array(UP_AXES[up])) == up
    heading, away = np.meshgrid(np.linspace(-np.pi, np.pi, 720), np.geomspace(3.0, 60.0, 32))
    seen = np.stack(
        [away * np.cos(heading), away * np.sin(heading), np.full(away.shape, -2.0)], axis=-1
    ).reshape(-1, 3)
    assert is_seen_from_origin(seen)
    assert find_up(seen @ np.array(UP_AXES[up])) == up
    assert find_up(0.3 * landscape @ np.array(UP_AXES[up])) is None
    assert find_up(landscape * [1.0, 1.0, 4.0] @ np.array(UP_AXES[up])) is None  # towers


def test_padding_of_a_pcd_file_is_skipped(tmp_path: Path) -> None:
    kinds = {
        "names": ["x", "y", "z", "a", "i"],
        "formats": ["<f4"] * 3 + ["u1", "<f4"],
        "offsets": [0, 4, 8, 12, 16],
    }
    rows = np.zeros(50, np.dtype({**kinds, "itemsize": 24}))
    for name in "xyz":
        rows[name] = np.random.default_rng(0).normal(size=50)
    header = (
        "VERSION 0.7\nFIELDS x y z _ i _ _\nSIZE 4 4 4 1 4 1 1\nTYPE F F F U F F U\nCOUNT 1 1 1 4 1 0 4\n"
        "WIDTH 50\nHEIGHT 1\nPOINTS 50\nDATA binary\n"
    )
    (tmp_path / "a.pcd").write_bytes(header.encode() + rows.tobytes())
    points = rc.load_cloud(tmp_path / "a.pcd").points
    np.testing.assert_array_equal(points, np.stack([rows[name] for name in "xyz"], axis=1))
    bad = header.replace("COUNT 1 1 1 4", "COUNT 1 1 1 0").replace("z _", "z i2")
    (tmp_path / "b.pcd").write_bytes(bad.encode())
    with pytest.raises(rc.ScanError, match="0 of type U1 in the field i2"):
        rc.load_cloud(tmp_path / "b.pcd")
