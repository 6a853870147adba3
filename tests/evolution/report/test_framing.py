"""Pictures show the scene and the route, not what trails far off."""

import dataclasses

import numpy as np
import trimesh

from benchmarks.material.driving_scenes import make_furnished_room, make_terrain
from evolution._src.report.raster import find_frame


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


def test_a_short_route_in_a_large_scene_is_framed_closely():
    terrain = make_terrain(0, size=40.0, spacing=0.5, roughness=0.3)
    route = terrain.find_route(start=(20.0, 20.0), goal=(22.0, 20.0))
    frame = find_frame(terrain, route)
    low, high = frame.min(axis=0), frame.max(axis=0)
    assert 5.0 < high[0] - low[0] < 8.0
    for end in (route.start, route.goal):
        assert (low[:2] <= end[:2]).all()
        assert (high[:2] >= end[:2]).all()
