"""Mesh files that arenas are made of."""

import zipfile

import pytest
import trimesh

from symbrion_gym._src.arenas import surface_file
from symbrion_gym._src.arenas.surface_file import load_surface
from symbrion_gym._src.errors import ArenaError


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
    monkeypatch.setattr(surface_file, "MAX_BYTES", 1e5)
    with pytest.raises(ArenaError, match=r"box\.zip: .*limit"):
        load_surface(tmp_path / "box.zip")
