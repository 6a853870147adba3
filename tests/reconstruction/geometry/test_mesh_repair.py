"""Bad meshes are mended or refused."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry import mesh_repair
from reconstruction._src.geometry.mesh_repair import repair_mesh, simplify


@pytest.fixture(scope="module")
def terrain() -> trimesh.Trimesh:
    """Random points of a ramp with waves, triangulated in plan, normals up."""
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0], [4, 2], (600, 2))
    faces = Delaunay(points).simplices
    corners = points[faces]
    (x1, y1), (x2, y2) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    heights = 0.2 * points[:, 0] + 0.1 * np.sin(3 * points[:, 1])
    faces = np.where((x1 * y2 < y1 * x2)[:, None], faces[:, ::-1], faces)
    return trimesh.Trimesh(np.column_stack([points, heights]), faces, process=False)


def test_flipped_faces_are_turned_up(terrain):
    is_flipped = np.random.default_rng(0).random(len(terrain.faces)) < 0.5
    faces = np.where(is_flipped[:, None], terrain.faces[:, ::-1], terrain.faces)
    repaired = repair_mesh(trimesh.Trimesh(terrain.vertices, faces, process=False))
    assert repaired.is_winding_consistent
    assert repaired.area_faces @ repaired.face_normals[:, 2] > 0.9 * repair_mesh(terrain).area * 0.9


def test_what_was_turned_to_who_saw_it_stays_so(terrain):
    is_back = (
        terrain.triangles_center[:, 0] < 1.0
    )  # joined to the rest: the rest is not turned with it, nor it back
    faces = np.where(is_back[:, None], terrain.faces[:, ::-1], terrain.faces)
    mesh = trimesh.Trimesh(terrain.vertices, faces, process=False)
    repaired = repair_mesh(mesh, keeps_winding=True)
    assert repaired.is_winding_consistent  # what is turned came apart
    assert len(repaired.faces) == len(faces)
    assert ((repaired.face_normals[:, 2] < 0) == (repaired.triangles_center[:, 0] < 1.0)).all()


def test_a_closed_body_and_a_room_are_as_they_are_wound():
    """A room wound inwards is one whether its file joins its vertices or not, with a ceiling larger than its floor."""
    box = trimesh.creation.box((4, 3, 2)).subdivide().subdivide()
    assert repair_mesh(box).volume == pytest.approx(24.0)
    inside = box.faces[:, ::-1]
    assert repair_mesh(trimesh.Trimesh(box.vertices, inside, process=False)).volume == pytest.approx(-24.0)
    middle = box.triangles_center
    inside = inside[~((middle[:, 2] < -0.9) & (middle[:, 0] < -1.0))]  # a part of the floor was not seen
    soup = trimesh.Trimesh(box.vertices[inside.ravel()], np.arange(inside.size).reshape(-1, 3), process=False)
    repaired = repair_mesh(soup)
    assert repaired.face_normals[repaired.triangles_center[:, 2] < -0.9, 2].min() > 0.9


def test_a_ceiling_apart_from_its_floor_looks_down():
    room = trimesh.creation.box((4, 3, 2)).subdivide().subdivide()
    room.invert()
    room.update_faces(np.abs(room.face_normals[:, 2]) > 0.9)  # no walls
    for seen, is_down in ((room, True), (trimesh.Trimesh(room.vertices, room.faces[:, ::-1]), False)):
        repaired = repair_mesh(seen)
        assert (repaired.face_normals[:, 2] > 0).all(where=repaired.triangles_center[:, 2] < 0)
        assert ((repaired.face_normals[:, 2] < 0) == is_down).all(where=repaired.triangles_center[:, 2] > 0)


@pytest.mark.parametrize("noise", [-1e-4, 1e-4])
def test_walls_apart_from_their_floor_are_as_they_are_wound_and_a_steep_bank_looks_up(noise):
    """A wall is hardly ever upright to the last digit, so up tells nothing of it."""
    room = trimesh.creation.box((4, 3, 2)).subdivide().subdivide()
    room.invert()
    normals = room.face_normals
    chosen = [np.flatnonzero(normals @ way > 0.9) for way in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))]
    walls = [room.submesh([faces])[0] for faces in chosen]
    for wall in walls:  # leans by the noise, inwards or outwards
        wall.vertices += np.outer(wall.vertices[:, 2] * noise, wall.face_normals[0])
    repaired = repair_mesh(trimesh.util.concatenate(walls))
    assert (np.einsum("fi,fi->f", repaired.face_normals, -repaired.triangles_center) > 0).all()
    bank = trimesh.Trimesh([(0, 0, 0), (0, 3, 0), (1, 0, 2), (1, 3, 2)], [(0, 1, 2), (1, 3, 2)])
    for faces in (bank.faces, bank.faces[:, ::-1]):
        assert (repair_mesh(trimesh.Trimesh(bank.vertices, faces)).face_normals[:, 2] > 0).all()


def test_a_closed_body_that_is_wound_at_random_looks_outwards():
    box = trimesh.creation.box((4, 3, 2)).subdivide().subdivide()
    is_flipped = np.random.default_rng(0).random(len(box.faces)) < 0.7
    faces = np.where(is_flipped[:, None], box.faces[:, ::-1], box.faces)
    assert repair_mesh(trimesh.Trimesh(box.vertices, faces, process=False)).volume == pytest.approx(24.0)


def test_of_parts_wound_at_random_an_open_wall_looks_outwards_and_a_room_around_the_rest_inwards():
    box = trimesh.creation.box((4, 3, 2)).subdivide().subdivide()
    box.update_faces(box.triangles_center[:, 0] > -1.9)  # a door or two
    rng = np.random.default_rng(0)
    table = trimesh.creation.box((1.0, 1.0, 0.5))
    above = table.copy().apply_translation([0.0, 0.0, 1.5])
    for parts, volume in (([box], 1), ([box, table], -1), ([box, above], 1)):
        mesh = trimesh.util.concatenate(parts)
        is_flipped = rng.random(len(mesh.faces)) < 0.5
        faces = np.where(is_flipped[:, None], mesh.faces[:, ::-1], mesh.faces)
        repaired = repair_mesh(trimesh.Trimesh(mesh.vertices, faces, process=False))
        shell = repaired.triangles_center[:, 2] < -0.9
        assert (np.sign(-repaired.face_normals[shell, 2]) == volume).all()


def test_useless_faces_go(terrain):
    vertices = np.concatenate([terrain.vertices, [[np.nan] * 3]])
    extra = [terrain.faces[:20, ::-1], terrain.faces[:20][:, [0, 0, 1]], [[0, 1, len(terrain.vertices)]]]
    repaired = repair_mesh(trimesh.Trimesh(vertices, np.concatenate([terrain.faces, *extra]), process=False))
    assert len(repaired.faces) == len(terrain.faces)
    assert np.isfinite(repaired.vertices).all()


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), dtype=int), "no faces"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "finite"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "flat"),
        ([[0, 0, 0], [1e6, 0, 0], [0, 1e6, 0]], [[0, 1, 2]], "units"),
    ],
)
def test_refusals_name_the_trouble(vertices, faces, words):
    with pytest.raises(ReconstructionError, match=words):
        repair_mesh(trimesh.Trimesh(vertices, faces, process=False))


def test_large_meshes_are_simplified_and_loose_specks_dropped(terrain, monkeypatch):
    monkeypatch.setattr(mesh_repair, "_MAX_FACES", 300)
    speck = trimesh.creation.box((0.01, 0.01, 0.01)).apply_translation([0, 0, 2])
    repaired = repair_mesh(terrain + speck)
    assert 200 < len(repaired.faces) <= 330
    assert repaired.bounds[1, 2] < 1.5
    assert repaired.area == pytest.approx(terrain.area, rel=0.05)


def test_simplifying_keeps_the_place(terrain):
    vertices, faces = simplify(np.array(terrain.vertices), np.array(terrain.faces), 200)
    assert len(faces) <= 220
    np.testing.assert_allclose(vertices.min(axis=0), terrain.bounds[0], atol=0.1)
    np.testing.assert_allclose(vertices.max(axis=0), terrain.bounds[1], atol=0.1)
