"""Known objects in an arena: sites, geoms, saving, exporting, stretching."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from reconstruction._src.geometry.pose import make_rotation
from reconstruction._src.objects.finding import FoundObject
from symbrion_gym._src.arenas.placed_objects import PlacedObject, find_object
from symbrion_gym._src.errors import ArenaError

BOX = trimesh.creation.box((0.1, 0.2, 0.3))
TURN = make_rotation(yaw=0.5, pitch=0.2)


def place(name="socket", position=(1.0, 0.5, 0.2), rotation=TURN, mesh=BOX):
    return PlacedObject(name, np.array(position), rotation, mesh)


@pytest.fixture
def arena():
    objects = (place(), place("station", (0.2, 0.0, 0.1)), place(position=(-1.0, 0.0, 0.3)))
    return replace(sg.load_arena("truth"), objects=objects)


def test_each_object_is_a_site_and_a_geom_that_touches_nothing(arena):
    model = arena.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = ["object_socket_0", "object_station_0", "object_socket_1"]
    assert [model.site(i).name for i in range(model.nsite)] == names
    for name, each in zip(names, arena.objects, strict=True):
        np.testing.assert_allclose(data.site(name).xpos, each.position)
        np.testing.assert_allclose(data.site(name).xmat.reshape(3, 3), TURN, atol=1e-9)
        assert model.geom(name).contype == model.geom(name).conaffinity == 0
        # MuJoCo moves the frame of a mesh to its middle, here its origin, along its principal axes.
        np.testing.assert_allclose(data.geom(name).xpos, each.position, atol=1e-9)


def test_a_saved_arena_has_them_again(arena, tmp_path):
    arena.save(tmp_path / "a")
    loaded = sg.Arena.load(tmp_path / "a")
    for one, other in zip(arena.objects, loaded.objects, strict=True):
        assert one.name == other.name
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.rotation, other.rotation)
        np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "a/arena.xml")).nsite == 3


@pytest.mark.parametrize("to", ["mjcf", "urdf", "obj"])
def test_an_export_has_their_places(arena, tmp_path, to):
    arena.export(tmp_path, to)
    places = json.loads((tmp_path / "objects.json").read_text())
    assert places["object_station_0"]["position"] == [0.2, 0.0, 0.1]
    if to == "mjcf":
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "arena.xml"))
        np.testing.assert_allclose(model.site("object_socket_1").pos, (-1.0, 0.0, 0.3))
    replace(arena, objects=()).export(tmp_path, to)
    assert not (tmp_path / "objects.json").exists()


def test_found_objects_are_placed_in_the_frame_of_the_arena(arena):
    arena = replace(arena, offset=(100.0, 0.0, 0.0))
    found = FoundObject("socket", np.array([101.5, 0.0, 0.4]), np.eye(3), 0.99, 1.0, 200)
    placed = sg.place_objects(arena, [found], {"socket": BOX})
    assert [each.name for each in placed.objects] == ["station", "socket"]
    np.testing.assert_allclose(placed.objects[1].position, (1.5, 0.0, 0.4))
    with pytest.raises(ArenaError, match="no mesh for object 'socket'; there are: tag"):
        sg.place_objects(arena, [found], {"tag": BOX})


def test_they_are_found_by_site_or_by_kind(arena):
    assert find_object(arena.objects, "object_socket_1") is arena.objects[2]
    assert find_object(arena.objects, "station") is arena.objects[1]
    with pytest.raises(ArenaError, match="2 objects 'socket' in the arena; there are: object_socket_0"):
        find_object(arena.objects, "socket")
    with pytest.raises(ArenaError, match="no objects 'tag' in the arena; there are: none; find them with"):
        find_object((), "tag")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": "power socket"}, "letters, digits"),
        ({"position": (0.0, np.nan, 0.0)}, "position must be"),
        ({"rotation": 2 * np.eye(3)}, "must be a rotation"),
        ({"rotation": np.diag([1.0, 1.0, -1.0])}, "must be a rotation"),
        ({"mesh": trimesh.Trimesh()}, "no faces"),
    ],
)
def test_what_is_no_object_is_refused(changes, words):
    with pytest.raises(ArenaError, match=words):
        place(**changes)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda each: each.pop("faces"), r"objects\[0\]: 'faces'"),
        (lambda each: each.update(faces=[[0, 1, 99]]), "a face names a vertex"),
        (lambda each: each.update(name="a b"), "letters, digits"),
    ],
)
def test_a_damaged_file_is_named(arena, tmp_path, damage, words):
    arena.save(tmp_path / "a")
    path = tmp_path / "a/arena.json"
    about = json.loads(path.read_text())
    damage(about["objects"][0])
    path.write_text(json.dumps(about))
    with pytest.raises(ArenaError, match=words):
        sg.Arena.load(tmp_path / "a")
