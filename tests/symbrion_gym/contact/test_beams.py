"""Beams of a scan against contact geometry: rooms whose walls grow outwards, inwards, or stand in the way."""

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import RayMesh
from symbrion_gym._src.contact.visibility import find_beams, measure_visibility

SIZE = np.array([4.0, 4.0, 3.0])
ROOM = trimesh.creation.box(SIZE)
CENTER = np.zeros((1, 3))


def make_box(low, high) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def make_walls(thickness: float) -> list[trimesh.Trimesh]:
    """Return six slabs that grow outwards from the sides of the room; inwards where `thickness` is negative."""
    walls = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            inner, outer = side * SIZE[axis] / 2, side * (SIZE[axis] / 2 + thickness)
            low, high = -SIZE / 2, SIZE / 2
            low[axis], high[axis] = min(inner, outer), max(inner, outer)
            walls.append(make_box(low, high))
    return walls


def sample(count: int = 3000) -> np.ndarray:
    return np.asarray(trimesh.sample.sample_surface(ROOM, count, seed=3)[0])


@pytest.mark.parametrize(
    ("thickness", "beams", "free_space"), [(0.2, 1.0, 0.0), (-0.5, 0.0, 0.2), (None, 0.0, 0.0)]
)
def test_walls_may_grow_away_from_the_scanner_only(thickness, beams, free_space):
    walls = [] if thickness is None else make_walls(thickness)
    seen = measure_visibility(sample(), CENTER, None, walls, ROOM)
    assert (seen.beams_contact, seen.beams_surface) == (beams, 1.0)
    assert seen.free_space == pytest.approx(free_space, abs=0.1 if free_space else 0.0)


@pytest.mark.parametrize(("depth", "share"), [(0.04, 1.0), (0.06, 0.0)])
def test_a_beam_ends_within_five_centimeters(depth, share):
    points = np.array([[2.0, 0.0, 0.0], [2.0, 0.1, 0.0]])
    wall = [make_box([2.0 - depth, -2, -1.5], [2.2, 2, 1.5])]
    seen = measure_visibility(points, CENTER, None, wall, ROOM)
    assert seen.beams_contact == share


def test_a_scanner_inside_a_piece_sees_nothing():
    pieces = [*make_walls(0.2), make_box([-0.5] * 3, [0.5] * 3)]
    seen = measure_visibility(sample(), CENTER, None, pieces, ROOM)
    assert seen.beams_contact == 0.0
    assert seen.free_space > 0.1


def test_height_field_is_solid_below():
    ground = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    points = np.asarray(trimesh.sample.sample_surface(ground, 500, seed=1)[0])
    viewpoint = np.array([2.0, 2.0, 1.0])
    for height, share in ((0.0, 1.0), (1.5, 0.0)):
        field = HeightField(np.full((5, 5), height), np.array([0.0, 0.0]), np.array([4.0, 4.0]))
        seen = measure_visibility(points, viewpoint, None, field, ground)
        assert seen.beams_contact == share
        assert (seen.free_space > 0.5) == (height > 1.0)


def test_unknown_viewpoint_is_the_nearest_that_sees():
    wall = make_box([-0.01, -1, -1], [0.01, 1, 1])
    target = make_box([0.5, -1, -1], [0.6, 1, 1])
    viewpoints = np.array([[-0.3, 0.0, 0.0], [0.3, 3.0, 0.0]])
    points = np.array([[0.5, 0.0, 0.0], [-0.01, 0.2, 0.0]])
    beams = find_beams(points, viewpoints, None, RayMesh([wall, target]))
    assert np.array_equal(beams.origins, viewpoints[[1, 0]])
    told = find_beams(points, viewpoints, np.array([0, 1]), RayMesh([wall, target]))
    assert np.array_equal(told.origins, viewpoints)


def test_many_readings_are_a_fixed_sample():
    points = sample(30_000)
    first = measure_visibility(points, CENTER, None, make_walls(-0.04), ROOM)
    again = measure_visibility(points, CENTER, None, make_walls(-0.04)[::-1], ROOM)
    assert first == again
    assert len(find_beams(points, CENTER, None, RayMesh([ROOM])).ranges) == 20_000


def test_place_in_the_world_does_not_matter():
    shift = np.array([3e5, -2e5, 100.0])
    pieces, room = make_walls(0.2), ROOM.copy()
    for mesh in (*pieces, room):
        mesh.apply_translation(shift)
    seen = measure_visibility(sample() + shift, CENTER + shift, None, pieces, room)
    assert (seen.beams_contact, seen.beams_surface, seen.free_space) == (1.0, 1.0, 0.0)


def test_without_beams_there_are_no_shares():
    assert measure_visibility(sample(), np.zeros((0, 3)), None, make_walls(0.2), ROOM) is None
    assert measure_visibility(CENTER, CENTER, None, make_walls(0.2), ROOM) is None


def test_rays_hit_the_first_triangle_from_either_side():
    rays = RayMesh([make_box([1, -1, -1], [2, 1, 1])])
    origins = np.array([[0.0, 0, 0], [1.5, 0, 0], [0, 0, 0]])
    directions = np.array([[1.0, 0, 0], [1, 0, 0], [-1, 0, 0]])
    assert rays.cast(origins, directions) == pytest.approx([1.0, 0.5, np.inf])
    assert rays.cast(origins, 2 * directions, reach=0.4) == pytest.approx([np.inf, 0.25, np.inf])
    assert np.isinf(RayMesh([]).cast(origins, directions)).all()
    lone = trimesh.Trimesh([[1.0, -1, -1], [1, 1, -1], [1, 0, 1]], [[0, 1, 2]], process=False)
    assert RayMesh([lone]).cast(origins, directions) == pytest.approx([1.0, np.inf, np.inf])
    assert len(rays.cast(origins[:0], directions[:0])) == 0
