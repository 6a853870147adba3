"""Arenas of the kind "mixed": primitives for rays and contact, in their folder and in exports."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from reconstruction._src.surfaces.primitives.find import Primitives
from reconstruction._src.surfaces.primitives.primitive import Primitive
from symbrion_gym._src.arenas.primitives import compute_beam_cost, pays
from symbrion_gym._src.arenas.spec import CONTACT_GROUP, SURFACE_GROUP


@pytest.fixture(scope="module")
def arena() -> sg.Arena:
    """Return a ball on a floor, with noise."""
    floor = trimesh.creation.box((2.0, 2.0, 0.5)).apply_translation((0.0, 0.0, -0.25))
    ball = trimesh.creation.icosphere(3, 0.3).apply_translation((0.2, 0.1, 0.1))
    solid = trimesh.boolean.union([floor, ball])
    vertices, faces = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, 0.25)[:2]
    mesh = trimesh.Trimesh(vertices, faces)
    mesh.merge_vertices()
    mesh.vertices = mesh.vertices + np.random.default_rng(0).normal(0, 0.001, mesh.vertices.shape)
    return sg.make_arena(mesh, kind="mixed", cache=False, name="ball")


def test_the_cost_of_a_flat_surface_is_known() -> None:
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    assert compute_beam_cost(flat, Primitives([], 0.004)) > 0


def cast(arena: sg.Arena, group: int, origins: np.ndarray) -> np.ndarray:
    """Return how far down each ray falls on the geoms of a group [m]."""
    model = arena.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = (np.arange(6) == group).astype(np.uint8)
    geom = np.zeros((1, 1), np.int32)
    down = np.array([0.0, 0.0, -1.0])
    return np.array([mujoco.mj_ray(model, data, place, down, groups, 1, -1, geom) for place in origins])


@pytest.mark.slow
def test_rays_and_contact_meet_primitives_where_the_surface_was(arena: sg.Arena) -> None:
    assert arena.primitives is not None
    kinds = {one.kind for one in arena.primitives.shapes}
    assert {"sphere", "box"} <= kinds
    types = [geom.type for geom in arena.spec().worldbody.geoms if geom.group == CONTACT_GROUP]
    assert mujoco.mjtGeom.mjGEOM_SPHERE in types
    rng = np.random.default_rng(1)
    origins = np.column_stack([rng.uniform(-0.9, 0.9, (200, 2)), np.ones(200)])
    squared = ((origins[:, :2] - [0.2, 0.1]) ** 2).sum(axis=1)
    height = np.where(squared < 0.3**2 - 0.1**2, 0.1 + np.sqrt(np.maximum(0.3**2 - squared, 0.0)), 0.0)
    is_clear = np.abs(squared - (0.3**2 - 0.1**2)) > 0.01
    for group in (SURFACE_GROUP, CONTACT_GROUP):
        error = np.abs(1.0 - cast(arena, group, origins) - height)[is_clear]
        assert error.max() < 0.006
        assert error.mean() < 0.002
    assert arena.quality.mean < 0.003


@pytest.mark.slow
def test_it_is_saved_loaded_and_opened_by_mujoco(arena: sg.Arena, tmp_path: Path) -> None:
    arena.save(tmp_path / "ball")
    again = sg.Arena.load(tmp_path / "ball")
    assert again.kind == "mixed"
    assert arena.primitives is not None
    assert again.primitives is not None
    for one, other in zip(arena.primitives.shapes, again.primitives.shapes, strict=True):
        assert one.kind == other.kind
        np.testing.assert_array_equal(one.half_sizes, other.half_sizes)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "ball" / "arena.xml"))
    assert model.ngeom == arena.spec().compile().ngeom


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("tolerance",), 0.0, "tolerance of primitives is 0.0"),
        (("shapes", 0, "kind"), "cone", "kind"),
        (("shapes", 0, "half_sizes"), [0.0, 1.0, 1.0], "lengths above 0"),
        (("shapes", 0, "axes"), [[2.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], "a rotation is needed"),
    ],
)
def test_a_damaged_folder_is_refused(
    arena: sg.Arena, tmp_path: Path, path: tuple, value: object, message: str
) -> None:
    arena.save(tmp_path / "ball")
    about = json.loads((tmp_path / "ball" / "arena.json").read_text())
    place = about["primitives"]
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    (tmp_path / "ball" / "arena.json").write_text(json.dumps(about))
    with pytest.raises(sg.ArenaError, match=message):
        sg.Arena.load(tmp_path / "ball")


@pytest.mark.slow
def test_kind_and_primitives_go_together(arena: sg.Arena) -> None:
    with pytest.raises(sg.ArenaError, match="'mixed' has primitives"):
        replace(arena, primitives=None)
    with pytest.raises(sg.ArenaError, match="'mixed' has primitives"):
        replace(sg.load_arena("gsrm"), primitives=arena.primitives)


@pytest.mark.slow
def test_a_mixed_arena_of_a_colored_scan_says_where_its_colors_are(caplog: pytest.LogCaptureFixture) -> None:
    box = trimesh.creation.box((1.0, 1.0, 0.2))
    plain = sg.make_arena(box, kind="mixed", cache=False)
    assert "colors" not in " ".join(plain.provenance["warnings"])
    box.visual.vertex_colors = np.tile([200, 30, 30, 255], (len(box.vertices), 1))
    arena = sg.make_arena(box, kind="mixed", cache=False)
    assert "kind 'mixed' without its colors" in caplog.text
    assert arena.texture is not None


NONE = Primitives([], 0.004)


def make_ground(extent: float = 2.0) -> trimesh.Trimesh:
    """Return rough ground of 2 m x 2 m."""
    box = trimesh.creation.box((extent, extent, 0.2)).subdivide_to_size(0.1)
    ground = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] > 0.5])
    ground.vertices[:, 2] += np.random.default_rng(0).normal(0, 0.001, len(ground.vertices))
    return ground


def make_floor(half: float) -> Primitives:
    plane = Primitive("plane", np.array([0.0, 0.0, 0.098]), np.eye(3), np.array([half, half, 0.002]))
    return NONE._replace(shapes=[plane])


def test_cost_is_the_same_at_any_scale():
    ground = make_ground()
    larger = ground.copy().apply_scale(10.0)
    assert compute_beam_cost(larger, NONE) == pytest.approx(compute_beam_cost(ground, NONE), rel=0.02)


def test_a_rectangle_pays_where_it_replaces_most_triangles():
    ground = make_ground()
    assert compute_beam_cost(ground, make_floor(0.95)) < 0.5 * compute_beam_cost(ground, NONE)
    assert pays(ground, make_floor(0.95))
    assert not pays(ground, make_floor(0.2))
    assert pays(ground, NONE)
