"""Exports of arenas with colors."""

import mujoco
import numpy as np
import pytest
import trimesh

import symbrion_gym as sg


@pytest.fixture(scope="module")
def arena():
    return sg.Arena.from_course(sg.Course(color_pattern="checker"))


def test_the_mjcf_has_the_texture_of_the_arena(arena, tmp_path):
    arena.export(tmp_path, to="mjcf")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arena.xml"))
    own = arena.spec().compile()
    assert np.array_equal(model.tex_data, own.tex_data)
    places = [m.mesh_texcoord[m.mesh_facetexcoord.ravel()] for m in (model, own)]
    assert places[0] == pytest.approx(places[1], abs=1e-6)
    assert model.ngeom == own.ngeom


@pytest.mark.parametrize("to", ["obj", "urdf"])
def test_the_obj_has_colors_and_a_texture(arena, to, tmp_path):
    arena.export(tmp_path, to=to)
    read = trimesh.load_mesh(tmp_path / "surface.obj", process=False)
    assert isinstance(read.visual, trimesh.visual.TextureVisuals)
    assert np.array_equal(np.asarray(read.visual.material.image.convert("RGB")), arena.texture.image)
    assert len((tmp_path / "surface.obj").read_text().splitlines()[2].split()) == 7


def test_usd_has_vertex_colors(arena, tmp_path):
    usd = pytest.importorskip("pxr.Usd")
    arena.export(tmp_path, to="usd")
    stage = usd.Stage.Open(str(tmp_path / "arena.usda"))
    prim = stage.GetPrimAtPath("/arena/surface")
    shown = np.array(prim.GetAttribute("primvars:displayColor").Get())
    assert shown == pytest.approx(np.asarray(arena.surface.visual.vertex_colors)[:, :3] / 255, abs=1e-6)
