"""Arenas: built, measured, kept, loaded, compiled."""

import json
import pickle

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scanned_surface import cut_irregular, make_scanned_surface

import reconstruction as rc
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import load_arena, make_arena
from symbrion_gym._src.arenas.spec import CONTACT_GROUP
from symbrion_gym._src.contact.quality import measure_arena
from symbrion_gym._src.errors import ArenaError

SLANTED_PIT = [(-3, 0), (-1.7, 0), (-0.7, 0.25), (-0.3, 0.25), (-0.1, 0), (0.15, 0), (0.3, 0.25), (0.7, 0.25)]
SLANTED_PIT += [(1.7, 0), (3, 0)]


def turn(mesh, yaw):
    return mesh.apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))


@pytest.fixture(scope="module")
def scanned():
    return make_scanned_surface(Course().profile(), num_vertices=1500, noise=0.002)


@pytest.fixture(scope="module")
def arena(scanned):
    return make_arena(scanned, cache=False, name="scanned")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("num_vertices", "is_grid", "yaw"), [(2200, False, np.radians(20)), (800, False, 0.35), (7000, True, 0.0)]
)
def test_the_course_is_met_in_any_direction(num_vertices, is_grid, yaw):
    mesh = make_scanned_surface(Course().profile(), num_vertices=num_vertices, is_grid=is_grid)
    mesh = cut_irregular(mesh, yaw) if yaw else mesh
    truth = turn(Course().surface(), yaw)
    arena = make_arena(mesh, cache=False)
    quality = measure_arena(arena.pieces, truth, region=mesh)
    mean, p95 = (0.002, 0.010) if num_vertices == 800 else (0.001, 0.0035)
    assert quality.mean <= mean
    assert quality.p95 <= p95
    assert quality.num_pieces <= 16


@pytest.mark.slow
def test_the_pit_floor_is_not_filled_in(arena):
    model = arena.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    group = np.zeros(6, dtype=np.uint8)
    group[CONTACT_GROUP] = 1
    for x in (-0.15, 0.0, 0.15):
        for y in (-0.8, 0.0, 0.8):
            hit = np.zeros(1, dtype=np.int32)
            distance = mujoco.mj_ray(
                model, data, np.array([x, y, 2.0]), np.array([0, 0, -1.0]), group, 1, -1, hit
            )
            assert 2.0 - distance == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize("name", ["truth", "simple", "stairs"])
def test_named_arenas_compile(name):
    arena = load_arena(name)
    assert arena.course is not None
    assert arena.quality.max == 0.0
    model = arena.spec().compile()
    assert (model.geom_type[model.geom_group == CONTACT_GROUP] == mujoco.mjtGeom.mjGEOM_BOX).all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hfield", "prisms"])
def test_other_kinds_of_contact(kind):
    mesh = make_scanned_surface(Course().profile(), num_vertices=300)
    arena = make_arena(mesh, kind=kind, accuracy=0.003, cache=False)
    # Along vertical lines, away from walls: there a coarse mesh has chamfers, and boxes have edges.
    quality = measure_arena(arena.pieces, mesh) if arena.pieces else arena.quality
    assert quality.mean < 0.004
    model = arena.spec().compile()
    assert (model.geom_group == CONTACT_GROUP).sum() == max(len(arena.pieces), 1)


def test_a_saved_arena_is_the_same_and_opens_in_mujoco(arena, tmp_path):
    folder = tmp_path / "a"
    arena.save(folder)
    arena.save(folder)
    loaded = load_arena(folder)
    assert (loaded.name, loaded.course, loaded.quality) == (arena.name, arena.course, arena.quality)
    assert loaded.provenance == arena.provenance
    np.testing.assert_allclose(loaded.surface.vertices, arena.surface.vertices, atol=0.51e-4)
    for mine, theirs in zip(arena.pieces, loaded.pieces, strict=True):
        np.testing.assert_allclose(theirs.vertices, mine.vertices, atol=1e-6)
    model = mujoco.MjModel.from_xml_path(str(folder / "arena.xml"))
    assert model.ngeom == len(arena.pieces) + 1
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_the_friction_of_a_scan_is_an_assumption(arena, tmp_path):
    assert (arena.course, arena.friction, arena.friction_source) == (None, 0.7, "assumed")
    arena.save(tmp_path / "a")
    about = tmp_path / "a" / "arena.json"
    assert json.loads(about.read_text())["friction_source"] == "assumed"
    assert Arena.load(tmp_path / "a").friction_source == "assumed"
    about.write_text(about.read_text().replace('"assumed"', '"guessed"'))
    with pytest.raises(ArenaError, match="friction_source is 'guessed'"):
        Arena.load(tmp_path / "a")


@pytest.mark.slow
def test_a_reconstruction_takes_no_course(tmp_path):
    made = rc.reconstruct(Course().surface().vertices.repeat(20, axis=0), units=20, seed=0)
    with pytest.raises(ArenaError, match="course is the truth behind a scan"):
        make_arena(made, course=Course())


def test_an_arena_goes_through_pickle(arena):
    copy = pickle.loads(pickle.dumps(arena))
    assert copy.spec().compile().ngeom == arena.spec().compile().ngeom


BROKEN = {
    "seed": st.integers(0, 10_000),
    "damage": st.sampled_from(["holes", "flips", "noise", "doubles", "nan", "spikes"]),
}


@pytest.mark.slow
@settings(max_examples=4, deadline=None, derandomize=True)
@given(**BROKEN)
def test_broken_meshes_give_an_arena_or_an_arena_error(seed, damage):
    check_broken_mesh(seed, damage)


def check_broken_mesh(seed, damage):
    generator = np.random.default_rng(seed)
    mesh = make_scanned_surface(Course(pit=0.3).profile(), num_vertices=60, seed=seed)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    chosen = generator.random(len(faces)) < generator.uniform(0.05, 0.7)
    if damage == "holes":
        faces = faces[~chosen]
    elif damage == "flips":
        faces[chosen] = faces[chosen][:, ::-1]
    elif damage == "noise":
        vertices += generator.normal(scale=0.03, size=vertices.shape)
    elif damage == "doubles":
        faces = np.concatenate([faces, faces[chosen], faces[chosen][:, [0, 0, 1]]])
    elif damage == "nan":
        vertices[generator.random(len(vertices)) < 0.1] = np.nan
    else:
        vertices[generator.integers(len(vertices))] *= generator.uniform(-5, 5)
    try:
        arena = make_arena(trimesh.Trimesh(vertices, faces, process=False), cache=False)
    except ArenaError:
        return
    assert arena.pieces
    arena.spec().compile()


def test_name_is_the_packages_own_beside_a_folder_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gsrm").mkdir()
    assert load_arena("gsrm").name == "gsrm"
    with pytest.raises(ArenaError, match=r"holds no arena\.json"):
        load_arena("./gsrm")
