"""Triangles in pixels: the nearest is seen, none from behind, no gap between neighbors; what a picture frames."""

import dataclasses

import numpy as np
import pytest
import trimesh

from benchmarks.material.driving_scenes import make_furnished_room, make_terrain
from evolution._src.report.raster import find_frame, find_outlines, make_view, rasterize

CORNERS = np.asarray(trimesh.creation.box((2, 2, 2)).vertices)
ABOVE = make_view(CORNERS, 90.0, -90.0, 100)


def make_square(size: float, z: float) -> np.ndarray:
    """Return two triangles that look up."""
    a, b, c, d = ([x, y, z] for x, y in ((-size, -size), (size, -size), (size, size), (-size, size)))
    return np.array([[a, b, c], [a, c, d]])


def test_a_square_covers_its_area() -> None:
    pixels = rasterize(make_square(0.5, 0.0), ABOVE)
    side = (pixels.face >= 0).sum() ** 0.5
    assert side == pytest.approx(ABOVE.scale, abs=1)  # a square of 1 m
    assert set(np.unique(pixels.face)) == {-1, 0, 1}
    assert pixels.height[pixels.face >= 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_the_nearest_is_seen(order: int) -> None:
    low, high = make_square(0.8, 0.0), make_square(0.3, 0.5)
    pixels = rasterize(np.concatenate([low, high][::order]), ABOVE)
    middle = pixels.height[ABOVE.height // 2, ABOVE.width // 2]
    assert middle == pytest.approx(0.5)
    assert np.sort(np.unique(np.round(pixels.height, 6)))[1:] == pytest.approx([0.0, 0.5])


def test_what_is_seen_from_behind_is_left_out() -> None:
    ceiling = make_square(0.5, 0.5)[:, ::-1]
    assert (rasterize(ceiling, ABOVE).face == -1).all()
    assert (rasterize(ceiling, ABOVE, is_culled=False).face >= 0).any()


def test_points_return_from_their_pixels() -> None:
    view = make_view(CORNERS, 35.0, 120.0, 300)
    sphere = trimesh.creation.icosphere(subdivisions=4)
    pixels = rasterize(np.asarray(sphere.triangles), view)
    rows, columns = np.nonzero(pixels.face >= 0)
    points = view.find_points(columns, rows, pixels.height[rows, columns])
    assert np.linalg.norm(points, axis=1) == pytest.approx(1.0, abs=5e-3)
    again = view.project(points)
    assert again[:, 0] == pytest.approx(columns + 0.5)
    assert again[:, 1] == pytest.approx(rows + 0.5)


def test_neighbors_leave_no_gap() -> None:
    fine = trimesh.creation.icosphere(subdivisions=5)
    covered = rasterize(np.asarray(fine.triangles), ABOVE).face >= 0
    for row in covered:
        seen = np.flatnonzero(row)
        assert len(seen) == 0 or len(seen) == np.ptp(seen) + 1


def test_outlines_are_where_labels_change() -> None:
    labels = np.zeros((3, 4), dtype=np.int64)
    labels[:, 2:] = 1
    assert np.array_equal(np.flatnonzero(find_outlines(labels)), [1, 5, 9])


def test_a_scene_without_flaps_is_shown_whole():
    room = make_furnished_room()
    np.testing.assert_array_equal(find_frame(room), room.surface.vertices)


def test_a_far_flap_is_cut_off():
    terrain = make_terrain(0, size=4.0)
    flap = trimesh.Trimesh([[2, 2, 0], [90, 2, 30], [90, 3, 30]], [[0, 1, 2]])
    arena = dataclasses.replace(terrain, surface=trimesh.util.concatenate([terrain.surface, flap]))
    frame = find_frame(arena)
    assert np.ptp(frame, axis=0).max() < 5.0
    assert len(frame) > len(terrain.surface.vertices) - 10


@pytest.mark.slow
def test_a_short_route_in_a_large_scene_is_framed_closely():
    terrain = make_terrain(0, size=40.0, spacing=0.5, roughness=0.3)
    route = terrain.find_route(start=(20.0, 20.0), goal=(22.0, 20.0))
    frame = find_frame(terrain, route)
    low, high = frame.min(axis=0), frame.max(axis=0)
    assert 5.0 < high[0] - low[0] < 8.0
    for end in (route.start, route.goal):
        assert (low[:2] <= end[:2]).all()
        assert (high[:2] >= end[:2]).all()
    stopped = dataclasses.replace(route, path=route.path[:2], goal=(30.0, 20.0, 0.0))
    assert find_frame(terrain, stopped)[:, 0].max() > 30.0
