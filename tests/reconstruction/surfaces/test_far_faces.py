"""Faces far from every reading: cut off where nobody saw a surface, kept where readings are only sparse."""

import numpy as np
import pytest
import trimesh
from constants import with_constants

from reconstruction._src.surfaces import far_faces
from reconstruction._src.surfaces.far_faces import cut_far_faces, find_far_faces
from reconstruction._src.surfaces.quality import measure_quality


def make_floor(num: int, size: float = 4.0) -> trimesh.Trimesh:
    """Return a flat square of two triangles a cell, on z = 0."""
    corner = (np.arange(num - 1)[:, None] * num + np.arange(num - 1)).ravel()
    first = np.stack([corner, corner + 1, corner + num], axis=1)
    second = np.stack([corner + 1, corner + num + 1, corner + num], axis=1)
    return trimesh.Trimesh(read_floor(num, size), np.concatenate([first, second]), process=False)


def add_bridge(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the mesh with a face that rises from its rim to a place 3 m above."""
    low = np.flatnonzero((mesh.vertices[:, 0] == -2) & (np.abs(mesh.vertices[:, 1]) == 2))
    vertices = np.concatenate([mesh.vertices, [[-5.0, 0.0, 3.0]]])
    return trimesh.Trimesh(vertices, [*mesh.faces, [low[0], low[1], len(vertices) - 1]], process=False)


def read_floor(num: int = 81, size: float = 4.0) -> np.ndarray:
    side = np.linspace(-size / 2, size / 2, num)
    return np.stack([*np.meshgrid(side, side), np.zeros((num, num))], axis=-1).reshape(-1, 3)


def test_a_face_in_the_air_is_cut_off_and_the_floor_is_kept() -> None:
    mesh = add_bridge(make_floor(9))
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    is_far = find_far_faces(vertices, faces, read_floor())
    assert np.flatnonzero(is_far).tolist() == [len(faces) - 1]
    cut = cut_far_faces(vertices, faces, read_floor())
    area = mesh.area_faces[-1]
    assert (cut.num_faces, len(cut.vertices)) == (1, 81)
    assert cut.area == pytest.approx(area)
    assert cut.share == pytest.approx(area / (16 + area))


@pytest.mark.parametrize(("read", "is_far"), [(1, True), (2, True), (3, False)])
def test_a_face_is_far_where_half_of_its_samples_are(read: int, is_far: bool) -> None:
    corners = np.array([[0.0, 0.0, 0.0], [12.0, 0.0, 0.0], [0.0, 12.0, 0.0]])
    middle = corners.mean(axis=0)
    samples = np.array([middle, *(middle + corners) / 2])
    patch = 0.02 * np.stack(np.meshgrid(*2 * [np.arange(-8, 9)], [0]), axis=-1).reshape(-1, 3)
    points = np.concatenate([place + patch for place in samples[:read]])
    assert find_far_faces(corners, np.array([[0, 1, 2]]), points).tolist() == [is_far]


def test_nothing_is_cut_where_everything_was_read() -> None:
    mesh = make_floor(9)
    cut = cut_far_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), read_floor())
    assert cut.num_faces == 0
    assert np.array_equal(cut.faces, mesh.faces)


def test_coarse_faces_beside_dense_readings_are_kept() -> None:
    body = trimesh.creation.icosahedron()
    points = trimesh.creation.icosphere(6, 1.0).vertices  # 0.2 m off the middles of the faces, 0.04 m apart
    assert not find_far_faces(np.asarray(body.vertices), np.asarray(body.faces), np.asarray(points)).any()


def test_a_floor_read_in_sparse_lines_is_kept() -> None:
    along, across = np.linspace(-2, 2, 161), np.linspace(-2, 2, 11)  # 25 mm along lines 400 mm apart
    lines = np.stack([*np.meshgrid(along, across), np.zeros((11, 161))], axis=-1).reshape(-1, 3)
    mesh = make_floor(17)
    assert not find_far_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), lines).any()


def test_a_hole_in_a_floor_is_bridged_in_its_plane_up_to_a_limit() -> None:
    points = read_floor(161)
    mesh = make_floor(33)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    for radius, is_cut in ((0.15, False), (1.0, True)):
        seen = points[np.linalg.norm(points[:, :2], axis=1) > radius]
        assert find_far_faces(vertices, faces, seen).any() == is_cut


def test_what_the_scanner_looked_through_is_cut_sooner() -> None:
    wall = make_floor(17)
    wall.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    pane = trimesh.Trimesh(
        [[-1.0, -0.3, -0.3], [-1.0, 0.3, -0.3], [-1.0, 0.0, 0.4]], [[0, 1, 2]], process=False
    )
    mesh = trimesh.util.concatenate([wall, pane])
    assert isinstance(mesh, trimesh.Trimesh)
    points = read_floor(81) @ np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]).T
    rim = np.asarray(pane.vertices)
    between = np.concatenate(
        [rim + share * (np.roll(rim, 1, axis=0) - rim) for share in np.arange(100) / 100]
    )
    points = np.concatenate([points, between])
    viewpoint, seen_from = np.array([[-4.0, 0.0, 0.0]]), np.zeros(len(points), dtype=np.int64)
    arguments = np.asarray(mesh.vertices), np.asarray(mesh.faces), points
    with with_constants(far_faces, reach=50.0, plane_reach=50.0, seen_reach=0.5):
        assert not find_far_faces(*arguments).any()
        is_far = find_far_faces(*arguments, viewpoint, seen_from)
    assert np.flatnonzero(is_far).tolist() == [len(mesh.faces) - 1]


def test_the_rest_is_a_manifold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the six faces around a vertex two opposite ones go: two fans are left, each gets a vertex of its own."""
    mesh = make_floor(5)
    around = np.flatnonzero((mesh.faces == 12).any(axis=1))
    directions = mesh.triangles_center[around, :2]
    order = around[np.argsort(np.arctan2(directions[:, 1], directions[:, 0]))]
    is_far = np.isin(np.arange(len(mesh.faces)), order[[0, 3]])
    monkeypatch.setattr(far_faces, "find_far_faces", lambda *_arguments: is_far)
    cut = cut_far_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), read_floor())
    rest = trimesh.Trimesh(cut.vertices, cut.faces, process=False)
    assert cut.num_faces == 2
    assert measure_quality(rest).topology.is_manifold
    assert len(cut.vertices) == 26


def test_few_readings_are_no_ground_to_cut() -> None:
    mesh = add_bridge(make_floor(5))
    assert not find_far_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), np.zeros((10, 3))).any()


def test_readings_around_a_few_open_places_tell_as_much_as_all():
    floor, readings = make_floor(21, size=2.0), read_floor(201, size=2.0)
    readings = readings[np.linalg.norm(readings - [0.05, 0.05, 0.0], axis=1) > 0.12]  # goes on beyond the gap
    for pool, expected in ((far_faces._POOL, 0), (10**9, 0), (1, 2)):
        with with_constants(far_faces, pool=pool):
            assert find_far_faces(floor.vertices, floor.faces, readings).sum() == expected
