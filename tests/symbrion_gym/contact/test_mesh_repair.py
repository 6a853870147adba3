"""Bad meshes are mended or refused."""

import zipfile

import numpy as np
import pytest
import trimesh

from symbrion_gym.arenas.course import Course
from symbrion_gym.arenas.scanned_surface import make_scanned_surface
from symbrion_gym.contact import mesh_repair
from symbrion_gym.contact.mesh_repair import load_surface, repair_mesh
from symbrion_gym.errors import ArenaError


@pytest.fixture(scope="module")
def terrain():
    return make_scanned_surface(Course().profile(), num_vertices=600)


def test_flipped_faces_are_turned_up(terrain):
    is_flipped = np.random.default_rng(0).random(len(terrain.faces)) < 0.5
    faces = np.where(is_flipped[:, None], terrain.faces[:, ::-1], terrain.faces)
    repaired = repair_mesh(trimesh.Trimesh(terrain.vertices, faces, process=False))
    assert repaired.is_winding_consistent
    assert repaired.area_faces @ repaired.face_normals[:, 2] > 0.9 * repair_mesh(terrain).area * 0.9


def test_a_closed_body_is_turned_outwards():
    box = trimesh.creation.box((1, 1, 1))
    inside_out = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
    assert repair_mesh(inside_out).volume == pytest.approx(1.0)


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
    with pytest.raises(ArenaError, match=words):
        repair_mesh(trimesh.Trimesh(vertices, faces, process=False))


def test_files_that_are_no_meshes(tmp_path):
    with pytest.raises(ArenaError, match="no mesh file"):
        load_surface(tmp_path / "absent.ply")
    (tmp_path / "bad.ply").write_text("not a mesh")
    with pytest.raises(ArenaError, match=r"bad\.ply"):
        load_surface(tmp_path / "bad.ply")


def test_a_packed_mesh_is_unpacked_within_the_limit(tmp_path, monkeypatch):
    box = trimesh.creation.box().export(file_type="obj")
    with zipfile.ZipFile(tmp_path / "box.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("box.obj", box + "#" + " " * 1_000_000)
    assert len(load_surface(tmp_path / "box.zip").faces) == 12
    monkeypatch.setattr(mesh_repair, "MAX_BYTES", 1e5)
    with pytest.raises(ArenaError, match=r"box\.zip: .*limit"):
        load_surface(tmp_path / "box.zip")
