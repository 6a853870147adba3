"""Arenas with colors: atlas, texture, folder, model."""

import mujoco
import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from reconstruction._src.scans.cloud import Cloud
from symbrion_gym._src.arenas.texture import SurfaceTexture, iterate_texels, make_atlas, paint_texture
from symbrion_gym._src.errors import ArenaError


def make_ground(rows: int = 5) -> trimesh.Trimesh:
    x, y = np.meshgrid(np.linspace(0, 2, rows), np.linspace(0, 1, rows))
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.05 * np.sin(3 * x.ravel())])
    i = np.arange(rows * (rows - 1)).reshape(rows - 1, rows)[:, :-1].ravel()
    faces = np.concatenate(
        [np.column_stack([i, i + 1, i + rows + 1]), np.column_stack([i, i + rows + 1, i + rows])]
    )
    return trimesh.Trimesh(vertices, faces, process=False)


def paint(places):
    places = np.asarray(places)
    return np.column_stack([0.2 + 0.3 * places[:, 0], 0.5 + 0.4 * places[:, 1], 0.9 - 0.4 * places[:, 0]])


def make_cloud(num: int = 20_000) -> Cloud:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0, 2, num), rng.uniform(0, 1, num), np.zeros(num)])
    points[:, 2] = 0.05 * np.sin(3 * points[:, 0])
    return Cloud(points, np.round(255 * paint(points)).astype(np.uint8))


def make_colored_arena() -> sg.Arena:
    return sg.color_arena(sg.make_arena(make_ground(), cache=False), make_cloud())


def sample(mesh, num=500):
    rng = np.random.default_rng(1)
    face = rng.integers(0, len(mesh.faces), num)
    weights = rng.dirichlet(np.ones(3), num)
    return face, weights, np.einsum("nk,nki->ni", weights, np.asarray(mesh.triangles)[face])


def test_cells_never_overlap_and_all_triangles_have_a_place():
    mesh = trimesh.creation.icosphere(2)
    mesh.apply_scale([3.0, 1.0, 0.2])
    atlas = make_atlas(np.asarray(mesh.triangles), 0.02)
    used = np.zeros((atlas.height, atlas.width), int)
    places = {
        (*corner, size) for corner, size in zip(atlas.corner.tolist(), atlas.size.tolist(), strict=True)
    }
    for column, row, size in places:
        used[row : row + size, column : column + size] += 1
    assert used.max() == 1
    halves = {(*corner, half) for corner, half in zip(atlas.corner.tolist(), atlas.is_lower, strict=True)}
    assert len(halves) == len(mesh.faces)


def test_a_texel_shows_the_place_that_its_corners_say():
    mesh = make_ground()
    triangles = np.asarray(mesh.triangles)
    atlas = make_atlas(triangles, 0.02)
    uv = atlas.compute_uv()
    for at, face, places in iterate_texels(atlas, triangles):
        center = np.column_stack([(at[:, 0] + 0.5) / atlas.width, 1 - (at[:, 1] + 0.5) / atlas.height])
        weights = trimesh.triangles.points_to_barycentric(triangles[face], places)
        inside = (weights > 0).all(axis=1)
        assert inside.any()
        assert np.einsum("nk,nki->ni", weights, uv[face])[inside] == pytest.approx(center[inside], abs=1e-9)


def test_a_painted_texture_has_the_colors_everywhere():
    mesh = make_ground()
    face, _, places = sample(mesh)
    found = paint_texture(mesh, paint, texel=0.02).find_colors(mesh, face, places)
    assert found == pytest.approx(paint(places), abs=0.01)


def test_a_colored_arena_survives_its_folder(tmp_path):
    arena = make_colored_arena()
    arena.save(tmp_path / "a")
    read = sg.Arena.load(tmp_path / "a")
    assert read.texture is not None
    assert arena.texture is not None
    assert np.array_equal(read.texture.image, arena.texture.image)
    assert np.array_equal(read.texture.uv, arena.texture.uv)
    assert np.array_equal(read.surface.visual.vertex_colors, arena.surface.visual.vertex_colors)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "a" / "arena.xml"))
    assert model.ntex == 1
    read.save(tmp_path / "b")
    for name in ("surface.obj", "surface.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_model_in_memory_and_that_of_the_folder_have_the_same_texture(tmp_path):
    arena = make_colored_arena()
    arena.save(tmp_path)
    memory = arena.spec().compile()
    file = mujoco.MjModel.from_xml_path(str(tmp_path / "arena.xml"))
    assert np.array_equal(memory.tex_data, file.tex_data)
    faces = [model.mesh_texcoord[model.mesh_facetexcoord.ravel()] for model in (memory, file)]
    assert faces[0] == pytest.approx(faces[1], abs=1e-6)


@pytest.mark.slow
def test_a_mesh_with_colors_becomes_an_arena_with_colors():
    mesh = make_ground(30)
    mesh.visual.vertex_colors = np.column_stack(
        [np.round(255 * paint(mesh.vertices)), np.full(len(mesh.vertices), 255)]
    ).astype(np.uint8)
    arena = sg.make_arena(mesh, cache=False)
    _, _, places = sample(arena.surface)
    assert np.sqrt(np.mean((arena.find_colors(places) - paint(places)) ** 2)) < 0.02


@pytest.mark.parametrize(
    ("image", "uv", "word"),
    [
        (np.zeros((4, 4, 4), np.uint8), np.zeros((12, 3, 2)), "bytes"),
        (np.zeros((4, 4, 3), np.uint8), np.zeros((11, 3, 2)), "12 faces"),
        (np.zeros((4, 4, 3), np.uint8), np.full((12, 3, 2), 2.0), "0 to 1"),
    ],
)
def test_a_texture_of_another_surface_is_refused(image, uv, word):
    arena = sg.make_arena(trimesh.creation.box(), cache=False)
    with pytest.raises(ArenaError, match=word):
        sg.Arena("a", arena.pieces, arena.surface, arena.quality, texture=SurfaceTexture(image, uv))


def test_what_has_no_colors_is_refused():
    arena = sg.make_arena(make_ground(), cache=False)
    with pytest.raises(ArenaError, match="no colors"):
        arena.find_colors(np.zeros((1, 3)))
    with pytest.raises(ArenaError, match="colored points"):
        sg.color_arena(arena, Cloud(np.eye(3)))
