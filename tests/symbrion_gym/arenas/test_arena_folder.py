"""An arena's folder from a stranger: it loads whole, or is refused by the names of file and field."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import load_arena, make_arena
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError

sys.path.append(str(Path(__file__).parents[2] / "reconstruction"))
from evil_json import find_trouble, mutate

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {}\nf 1 2 3\nf 1 3 4\n"


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("arenas") / "pit"
    Arena.from_course(Course()).save(folder)
    return folder


@pytest.fixture
def folder(saved, tmp_path) -> Path:
    return Path(shutil.copytree(saved, tmp_path / "pit"))


@pytest.fixture
def hfield(tmp_path) -> Path:
    heights = np.add.outer(np.linspace(0.0, 0.1, 5), np.zeros(7))
    field = HeightField(heights, np.array([-1.0, -0.5]), np.array([1.0, 0.5]))
    exact = Arena.from_course(Course())
    Arena("field", [], field.as_mesh(), exact.quality, kind="hfield", height_field=field).save(
        tmp_path / "field"
    )
    return tmp_path / "field"


def edit(path: Path, **changes) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.slow
def test_every_field_of_a_description_is_checked(folder):
    path = folder / "arena.json"
    content = json.loads(path.read_text())
    content["provenance"] = {"source": "mesh"}
    troubles = find_trouble(mutate(content), path, lambda: Arena.load(folder).spec().compile(), ArenaError)
    assert not troubles, "\n".join(troubles)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"num_pieces": 4}, r"num_pieces is 4, but .*004\.obj is listed in files"),
        ({"num_pieces": 6}, r"num_pieces is 6, but .*005\.obj is not listed in files"),
        ({"num_pieces": 0}, "num_pieces is 0 and kind 'convex'"),
        ({"num_pieces": True}, "num_pieces: Expected `int`, got `bool`"),
        ({"quality": None}, "quality: Expected `object`, got `null`"),
        ({"friction": "0.7"}, "friction: Expected `float`, got `str`"),
        ({"friction": 6}, "friction is 6.0; a number from 0.001 to 5"),
        ({"kind": "jelly"}, "kind: Invalid enum value 'jelly'"),
        ({"kind": "hfield"}, "kind 'hfield'"),
        ({"course": {"kind": "moon"}}, r"course\.kind: there is no 'moon'"),
        ({"course": {"kind": "pit", "pit": "deep"}}, r"course\.pit: Expected `float`"),
        ({"name": "a\nb\x1b[2J"}, r"name is 'a\\nb\\x1b\[2J'; .*printable"),
        ({"format": 2, "kind": 7}, "of a newer release"),
    ],
)
def test_a_wrong_field_is_named(folder, changes, said):
    edit(folder / "arena.json", **changes)
    with pytest.raises(ArenaError, match=rf"arena\.json: .*{said}"):
        Arena.load(folder)


def test_no_ground_goes_missing(folder):
    (folder / "pieces" / "002.obj").unlink()
    with pytest.raises(ArenaError, match=r"002\.obj is missing"):
        Arena.load(folder)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "surface needs 4 vertices|closed solid"),
        (TRIANGLE.format("nan"), r"vertex 3 is \[0\.0, 0\.0, nan\]"),
        (TRIANGLE.format("1e30"), r"vertex 3 is \[0\.0, 0\.0, 1e\+30\]"),
        (TRIANGLE.format("one"), "could not convert"),
        (TRIANGLE.format("1 0 0"), "vertex '0 0 1 0 0' has 5 entries"),
        (TRIANGLE.format("1") + "f 1 2 3 4\n", "face '1 2 3 4' has 4 entries"),
        (TRIANGLE.format("1") + "f 1 2 9\n", "a face names a vertex that is not there"),
        (TRIANGLE.format("1") + "f 1 2 -1\n", "a face names a vertex that is not there"),
        (TRIANGLE.format("1") + "f 1/1 2/2 3/3\n", "invalid literal"),
        ("\xff\x00", "codec|vertices|closed"),
    ],
)
@pytest.mark.parametrize("name", ["surface.obj", "pieces/001.obj"])
def test_a_wrong_mesh_is_named(folder, name, text, said):
    (folder / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(ArenaError, match=rf"{Path(name).name}: .*({said})") as refusal:
        Arena.load(folder)
    assert str(refusal.value).isprintable()


def test_flat_and_open_pieces_are_refused(folder):
    box = trimesh.creation.box((1.0, 1.0, 0.0))
    box.export(folder / "pieces" / "001.obj")
    with pytest.raises(ArenaError, match=r"001\.obj: the piece is flat"):
        Arena.load(folder)
    (folder / "pieces" / "001.obj").write_text(TRIANGLE.format(1))
    with pytest.raises(ArenaError, match=r"001\.obj: not a closed solid"):
        Arena.load(folder)
    (folder / "surface.obj").write_text("v 0 0 0\n" * 4 + "f 1 2 3\n")
    with pytest.raises(ArenaError, match=r"surface\.obj: the surface has no area"):
        Arena.load(folder)


def test_a_piece_of_vertices_alone_or_too_small_for_mujoco_is_refused(folder):
    path = folder / "pieces" / "001.obj"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if line.startswith("v")))
    with pytest.raises(ArenaError, match=r"001\.obj: not a closed solid"):
        Arena.load(folder)
    for size, is_accepted in ((1e-5, True), (1e-9, False)):
        tetrahedron = trimesh.Trimesh(
            size * np.eye(4, 3), [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], process=False
        )
        path.write_text(tetrahedron.export(file_type="obj", digits=12))
        if is_accepted:
            Arena.load(folder).spec().compile()
        else:
            with pytest.raises(ArenaError, match=r"001\.obj: the piece has an area of .*MuJoCo"):
                Arena.load(folder)


def test_a_height_field_survives_its_folder(hfield):
    loaded = Arena.load(hfield)
    assert loaded.height_field is not None
    assert loaded.height_field.heights.shape == (5, 7)
    loaded.spec().compile()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"heights": np.full((5, 7), np.nan)}, "heights must be floats, all finite"),
        ({"heights": np.full((5, 7), 1e30)}, "heights reaches beyond"),
        ({"heights": np.zeros(5)}, r"heights has shape \(5,\)"),
        ({"heights": np.zeros((1, 7))}, r"heights has shape \(1, 7\)"),
        ({"heights": np.full((2, 2), "a")}, "heights must be floats"),
        ({"low": np.zeros(3)}, "low and high"),
        ({"low": np.array([2.0, 0.0])}, "low below high"),
        ({"high": np.array([np.inf, 1.0])}, "high must be floats, all finite"),
    ],
)
def test_a_wrong_height_field_is_named(hfield, changes, said):
    path = hfield / "height_field.npz"
    with np.load(path) as arrays:
        content = dict(arrays) | changes
    np.savez(path, **content)
    with pytest.raises(ArenaError, match=rf"height_field\.npz: .*{said}"):
        Arena.load(hfield)


@pytest.mark.parametrize("name", ["", "a\nb", "\x1b[2J", "\udcff", "x" * 300, 7, None])
def test_names_that_would_break_a_line_are_refused(name):
    with pytest.raises(ArenaError, match="printable") as refusal:
        Arena.from_course(Course(), name=name)
    assert str(refusal.value).isprintable()


def test_no_path_is_more_than_an_arena_that_is_not_there():
    for name in ("", "\0", "a\0b", "x" * 5000):
        with pytest.raises(ArenaError):
            load_arena(name)


@pytest.mark.parametrize("z", ["nan", "1e30", "-inf"])
def test_a_mesh_file_of_nonsense_is_refused_by_name(tmp_path, z):
    path = tmp_path / "pit.obj"
    path.write_text(f"v 0 0 {z}\nv 1 0 {z}\nv 0 1 {z}\nf 1 2 3\n")
    with pytest.raises(ArenaError, match=r"pit\.obj: "):
        make_arena(path, cache=False)


def test_a_mesh_far_from_the_origin_is_moved_and_says_so(tmp_path):
    mesh = Course().surface()
    mesh.apply_translation([0.0, 5.4e6, 0.0])
    arena = make_arena(mesh, cache=False)
    assert arena.offset == (0.0, 5.4e6, 0.0)
    assert np.abs(arena.surface.bounds).max() < 10
    arena.save(tmp_path / "far")
    assert Arena.load(tmp_path / "far").offset == arena.offset
