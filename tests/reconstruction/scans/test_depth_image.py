"""Depth images, written by Pillow and NumPy: the geometry of the camera, colors, poses, refusals."""

from pathlib import Path

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.depth_image import Intrinsics, load_depth_image

Image = pytest.importorskip("PIL.Image", reason="the extra `formats` is not installed")

CAMERA = Intrinsics(fx=100.0, fy=50.0, cx=2.0, cy=1.0)
DEPTH = np.array(
    [[0, 1000, 2000, 1000, 1000], [1000, 1000, 1000, 1000, 1500], [3000, 0, 1000, 1000, 1000]], np.uint16
)
PICTURE = np.random.default_rng(0).integers(0, 256, (3, 5, 3)).astype(np.uint8)


def save(path: Path, pixels: np.ndarray) -> Path:
    if path.suffix == ".npy":
        np.save(path, pixels)
    else:
        Image.fromarray(pixels).save(path)
    return path


def expected(depth: np.ndarray) -> np.ndarray:
    """Return the points by the pinhole formula, pixel after pixel: ahead, left, up."""
    rows = [
        (z, -(u - 2.0) / 100.0 * z, -(v - 1.0) / 50.0 * z)
        for v, row in enumerate(depth / 1000)
        for u, z in enumerate(row)
        if z
    ]
    return np.array(rows)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.npy"])
def test_every_pixel_with_a_depth_is_a_point(tmp_path: Path, name: str) -> None:
    cloud = load_depth_image(save(tmp_path / name, DEPTH), CAMERA)
    np.testing.assert_allclose(cloud.points, expected(DEPTH))
    np.testing.assert_array_equal(cloud.viewpoints, np.zeros((1, 3)))
    np.testing.assert_array_equal(cloud.seen_from, np.zeros(13))
    assert cloud.colors is None


def test_floating_point_numbers_are_meters(tmp_path: Path) -> None:
    meters = DEPTH / np.float32(1000)
    meters[0, 0] = np.nan
    for name in ("a.tif", "a.npy"):
        cloud = load_depth_image(save(tmp_path / name, meters), CAMERA)
        np.testing.assert_allclose(cloud.points, expected(DEPTH), atol=1e-6)
    cloud = load_depth_image(save(tmp_path / "b.npy", meters), CAMERA, depth_scale=2.0, max_depth=2.0)
    assert cloud.num_points == 10


def test_colors_come_from_the_aligned_picture(tmp_path: Path) -> None:
    color = save(tmp_path / "rgb.png", PICTURE)
    cloud = load_depth_image(save(tmp_path / "a.png", DEPTH), CAMERA, color=color)
    np.testing.assert_array_equal(cloud.colors, PICTURE[DEPTH > 0])


def test_a_pose_places_the_camera_in_the_world(tmp_path: Path) -> None:
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # level, looking along x
    pose[:3, 3] = [5_000.0, 1.0, 1.5]
    cloud = load_depth_image(save(tmp_path / "a.png", DEPTH), CAMERA, pose=pose)
    np.testing.assert_allclose(cloud.viewpoints + cloud.offset, pose[None, :3, 3])
    np.testing.assert_allclose(cloud.points - cloud.viewpoints, expected(DEPTH), atol=1e-9)
    assert cloud.offset[0] == 5_001.0


@pytest.mark.parametrize(
    ("pixels", "options", "reason"),
    [
        (DEPTH.astype(np.uint8), {}, "not one channel of 16 bits"),
        (DEPTH * 0, {}, "0 of 15 pixels"),
        (DEPTH, {"depth_scale": 0.0}, "depth_scale"),
        (DEPTH, {"pose": np.eye(3)}, "4 x 4"),
        (DEPTH, {"pose": np.diag([1.0, 1, -1, 1])}, "rigid"),
        (DEPTH, {"max_bytes": 100.0}, "limit"),
        (np.array([["a", "b", "c"]]), {}, "one channel"),
    ],
)
def test_what_is_no_depth_image_is_refused(
    tmp_path: Path, pixels: np.ndarray, options: dict, reason: str
) -> None:
    path = save(tmp_path / ("a.npy" if pixels.dtype.kind == "U" else "a.png"), pixels)
    with pytest.raises(ScanError, match=rf"{path.name}: .*{reason}"):
        load_depth_image(path, CAMERA, **options)


def test_broken_files_are_named(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", DEPTH)
    (tmp_path / "cut.png").write_bytes(path.read_bytes()[:60])
    for name in ("cut.png", "absent.png", "a.jpg"):
        with pytest.raises(ScanError, match=name):
            load_depth_image(tmp_path / name, CAMERA)
    with pytest.raises(ScanError, match=r"rgb\.png: has 4 x 3 pixels, the depth image 5 x 3"):
        load_depth_image(path, CAMERA, color=save(tmp_path / "rgb.png", PICTURE[:, :4]))
    with pytest.raises(ScanError, match=r"cut\.png"):
        load_depth_image(path, CAMERA, color=tmp_path / "cut.png")


@pytest.mark.parametrize("values", [(0.0, 1, 0, 0), (1, 1, np.nan, 0)])
def test_intrinsics_are_checked(values: tuple[float, float, float, float]) -> None:
    with pytest.raises(ScanError, match=r"focal lengths|intrinsics"):
        Intrinsics(*values)
