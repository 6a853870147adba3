"""Cropping and thinning: clouds keep what belongs to their points, arrays are treated as before."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.selection import crop, find_crop_box, find_sparse_points, thin

POINTS = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [5.0, 0.0, 0.0], [5.1, 0.0, 0.0]])
CLOUD = Cloud(
    POINTS,
    np.array([[0, 0, 0], [30, 30, 30], [60, 60, 60], [200, 0, 0], [100, 0, 0]], np.uint8),
    np.array([[0.0, 0.0, 1.0], [5.0, 0.0, 1.0]]),
    np.array([1, 0, 1, 1, 0]),
    np.array([1000.0, 0.0, 0.0]),
)
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def room(seed: int = 0) -> np.ndarray:
    """Walls of 4 x 3 x 2.5 m."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([0, 0, 0], [4, 3, 2.5], (20_000, 3))
    face = rng.integers(0, 6, len(points))
    points[np.arange(len(points)), face % 3] = np.array([4, 3, 2.5])[face % 3] * (face // 3)
    return points


def test_a_cropped_cloud_keeps_what_belongs_to_its_points() -> None:
    cloud = crop(CLOUD, BOX)
    np.testing.assert_array_equal(cloud.points, POINTS[:3])
    np.testing.assert_array_equal(cloud.seen_from, [1, 0, 1])
    np.testing.assert_array_equal(cloud.colors, CLOUD.colors[:3])
    np.testing.assert_array_equal(cloud.offset, CLOUD.offset)


def test_a_thinned_cloud_has_mean_colors_and_the_most_frequent_viewpoint() -> None:
    cloud = thin(CLOUD, 1.0)
    np.testing.assert_allclose(cloud.points[:, 0], [0.1, 5.05])
    np.testing.assert_array_equal(cloud.colors[:, 0], [30, 150])
    np.testing.assert_array_equal(cloud.seen_from, [1, 0])  # of the second pair, equally frequent, the first
    np.testing.assert_array_equal(thin(Cloud(POINTS), 1.0).points, cloud.points)


def test_arrays_are_treated_as_clouds_are() -> None:
    np.testing.assert_array_equal(crop(POINTS, BOX), crop(Cloud(POINTS), BOX).points)
    points = room()
    np.testing.assert_array_equal(thin(points, 0.1), thin(Cloud(points), 0.1).points)
    assert thin(np.empty((0, 3)), 0.1).shape == (0, 3)
    edges = np.array([[0, 0, 0], [0.5, 0.5, 1.04], [2, 0, 0], [0, -1, 0.0]])
    np.testing.assert_array_equal(crop(edges, [[0, 0, 0], [1, 1, 1]]), edges[:2])
    np.testing.assert_array_equal(crop(edges, [[0, 0, 0], [1, 1, 1]], margin=0), edges[:1])
    for bad in (np.ones(3), np.ones((3, 2)), [["a", "b", "c"]]):
        with pytest.raises(ScanError, match="points"):
            thin(bad, 0.1)


def test_isolated_points_are_found_and_a_surface_is_not() -> None:
    rng = np.random.default_rng(0)
    surface = np.c_[rng.uniform(0, 2, (20000, 2)), np.zeros(20000)]
    isolated = np.c_[rng.uniform(0, 2, (100, 2)), rng.uniform(0.3, 2, 100)]
    is_sparse = find_sparse_points(np.concatenate([surface, isolated]))
    assert is_sparse[:20000].mean() < 0.01
    assert is_sparse[20000:].mean() > 0.97


@pytest.mark.parametrize("box", [BOX[::-1], BOX[:1], np.full((2, 3), np.nan)])
def test_what_is_no_box_is_refused(box: np.ndarray) -> None:
    with pytest.raises(ScanError, match="box must be"):
        crop(CLOUD, box)


@pytest.mark.parametrize("voxel", [0.0, -1.0, np.nan, np.inf, 1e-21])
def test_what_is_no_voxel_is_refused(voxel: float) -> None:
    with pytest.raises(ScanError, match=r"voxel must be above 0|too small"):
        thin(CLOUD, voxel)


@pytest.mark.parametrize("stray", [[[50.0, 0, 0]], [[1e6, 0, 0], [0, -3e5, 7.0]], [[1e12, 1e12, -1e12]], []])
def test_the_box_leaves_strays_out(stray: list[list[float]]) -> None:
    points = room()
    box = find_crop_box(np.concatenate([points, np.reshape(stray, (-1, 3))]))
    np.testing.assert_allclose(box, [points.min(axis=0), points.max(axis=0)])


def test_the_box_keeps_a_second_room_and_drops_a_glimpse_through_the_window() -> None:
    points = room()
    second = points[:4000] + np.array([8.0, 0, 0])
    glimpse = points[:20] * 0.2 + np.array([0, 15.0, 0])
    box = find_crop_box(Cloud(np.concatenate([points, second, glimpse])))
    np.testing.assert_allclose(box[1], [12.0, 3.0, 2.5], atol=0.01)


def test_the_box_of_few_points_is_all_of_them() -> None:
    np.testing.assert_array_equal(find_crop_box(POINTS), [POINTS.min(axis=0), POINTS.max(axis=0)])
    np.testing.assert_array_equal(find_crop_box(np.ones((5, 3))), np.ones((2, 3)))
    with pytest.raises(ScanError, match="no points"):
        find_crop_box(np.empty((0, 3)))
