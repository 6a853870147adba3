"""What an arena is made of, and what is asked about."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import reconstruction as rc
from benchmarks.material.driving_scenes import make_furnished_room
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.arenas.scanned import (
    MeshFrame,
    ScannedSurface,
    add_scan_quality,
    find_two_sided,
    simulate_readings,
    take_surface,
)
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError


@pytest.mark.parametrize("is_file", [True, False])
def test_a_mesh_in_millimeters_is_asked_about(tmp_path, is_file):
    room = trimesh.creation.box([4000.0, 3000.0, 2500.0])
    room.export(tmp_path / "room.stl")
    given = tmp_path / "room.stl" if is_file else room
    with pytest.raises(
        ArenaError, match=r"is 4,000 m, above 1000 m; give its --unit or --scale, or --unit m"
    ):
        take_surface(given)
    for unit, size in (("mm", 4.0), ("m", 4000.0)):
        taken = take_surface(given, frame=MeshFrame(unit, "z"))
        assert np.ptp(taken.mesh.vertices[:, 0]) == pytest.approx(size)


def test_a_room_that_may_have_y_up_says_which_axis_it_is(tmp_path):
    room = trimesh.creation.box([4.0, 2.5, 3.0])  # as much square to one axis as to another
    for name in ("room.obj", "room.ply"):
        room.export(tmp_path / name)
        with pytest.raises(ArenaError, match="y or z may point up; give --up y"):
            take_surface(tmp_path / name)
        for up, height in (("y", 2.5), ("z", 3.0)):
            seen = take_surface(tmp_path / name, frame=MeshFrame(up=up)).mesh
            assert np.ptp(seen.vertices[:, 2]) == pytest.approx(height)
    for sizes, name, height in (
        ([4.0, 3.0, 2.5], "lower.obj", 2.5),
        ([4.0, 4.0, 0.5], "plate.obj", 0.5),
        ([4.0, 0.5, 1.0], "bank.ply", 1.0),  # hardly anything is level along y
        ([4.0, 3.0, 2.5], "said.glb", 3.0),  # its format has y up
    ):
        box = trimesh.creation.box(sizes)
        if name == "bank.ply":
            box.update_faces(np.abs(box.face_normals[:, 1]) < 0.5)
        box.export(tmp_path / name)
        assert np.ptp(take_surface(tmp_path / name).mesh.vertices[:, 2]) == pytest.approx(height)


def test_a_room_seen_from_inside_is_hollow():
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide()
    arena = make_arena(room, viewpoints=[0.0, 0.0, 0.0], cache=False)
    for piece in arena.pieces:
        assert np.abs(piece.vertices / [2.0, 1.5, 1.25]).max(axis=1).min() > 0.99
    assert arena.quality.free_space == 0.0
    assert arena.quality.beams_contact == 1.0


def test_faces_wound_at_random_look_to_who_saw_them():
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide().subdivide()
    is_flipped = np.random.default_rng(0).random(len(room.faces)) < 0.5
    faces = np.where(is_flipped[:, None], room.faces[:, ::-1], room.faces)
    seen = take_surface(trimesh.Trimesh(room.vertices, faces, process=False), [0.5, 0.0, 0.0]).mesh
    assert len(seen.faces) == len(faces)
    assert (
        np.einsum("ij,ij->i", seen.face_normals, np.array([0.5, 0.0, 0.0]) - seen.triangles_center) > 0
    ).all()


def join(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    joined = trimesh.util.concatenate(meshes)
    assert isinstance(joined, trimesh.Trimesh)
    return joined


def test_without_viewpoints_backs_below_the_sky_were_seen():
    ground = trimesh.Trimesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]])
    leaning = trimesh.Trimesh([[0, 0, 0.5], [1, 0, 0.5], [0, 1, 1.0]], [[0, 2, 1]])
    assert leaning.face_normals[0, 2] < -0.5
    mesh = join([ground, leaning])
    found = find_two_sided(take_surface(mesh), mesh)
    assert found is not None
    assert found.tolist() == [False, False, True]
    roof = ground.copy().apply_translation([0, 0, 2])
    covered = join([ground, leaning, roof])
    found = find_two_sided(take_surface(covered), covered)
    assert found is not None
    assert not found[:3].any()


def test_a_closed_body_without_viewpoints_has_no_backs():
    box = trimesh.creation.box()
    assert find_two_sided(take_surface(box), box) is None


@pytest.mark.slow
def test_an_arena_says_what_of_the_surface_was_cut():
    side = np.linspace(0, 3, 61)
    floor = np.stack([*np.meshgrid(side, side), np.zeros((61, 61))], axis=-1).reshape(-1, 3)
    made = rc.reconstruct(floor, units=200)
    assert "cut" not in make_arena(made, cache=False).provenance
    made.notes["cut"] = "3 m² of the surface"
    assert make_arena(made, cache=False).provenance["cut"] == "3 m² of the surface"


def make_box(low: list[float], high: list[float]) -> trimesh.Trimesh:
    box = trimesh.creation.box(np.subtract(high, low)).subdivide().subdivide()
    box.apply_translation(np.add(low, high) / 2)
    return box


@pytest.mark.parametrize("is_inverted", [False, True])
@pytest.mark.parametrize("viewpoint", [[2.0, 1.4, 1.4], [0.3, 2.7, 0.2]])
def test_a_table_in_a_room_is_not_turned_inside_out(viewpoint, is_inverted):
    room, top = make_box([0, 0, 0], [4, 3, 2.5]), make_box([1, 1, 0.70], [2.2, 1.8, 0.74])
    if is_inverted:
        top.invert()
    mesh = take_surface(trimesh.util.concatenate([room, top]), viewpoint).mesh
    is_top = np.asarray(mesh.vertices)[mesh.faces][:, :, 2].max(axis=1) < 0.75
    is_top &= np.asarray(mesh.vertices)[mesh.faces][:, :, 2].min(axis=1) > 0.69
    parts = [trimesh.Trimesh(mesh.vertices, mesh.faces[chosen]) for chosen in (is_top, ~is_top)]
    assert parts[0].volume == pytest.approx(1.2 * 0.8 * 0.04)
    assert parts[1].volume == pytest.approx(-4 * 3 * 2.5)
    assert len(mesh.vertices) == len(room.vertices) + len(top.vertices)


def test_triangles_of_a_file_that_share_no_vertex_are_turned_together(tmp_path):
    room = trimesh.util.concatenate(
        [make_box([0, 0, 0], [4, 3, 2.5]), make_box([1, 1, 0.7], [2.2, 1.8, 0.74])]
    )
    room.export(tmp_path / "room.stl")
    mesh = take_surface(tmp_path / "room.stl", [2.0, 1.4, 1.4]).mesh
    assert mesh.volume == pytest.approx(1.2 * 0.8 * 0.04 - 30.0, rel=1e-5)


def test_unit_axis_and_scale_of_a_mesh(tmp_path):
    box = trimesh.creation.box([3000.0, 2500.0, 4000.0])  # millimeters, y up
    box.export(tmp_path / "box.ply")
    for surface in (box, tmp_path / "box.ply"):
        extents = take_surface(surface, frame=MeshFrame("mm", "y", 2.0)).mesh.extents
        np.testing.assert_allclose(extents, [6.0, 8.0, 5.0])
    assert take_surface(box, frame=MeshFrame("m")).mesh is box
    with pytest.raises(ArenaError, match="unknown axis up='w'"):
        take_surface(box, frame=MeshFrame(up="w"))
    with pytest.raises(ArenaError, match="unknown unit 'mile'"):
        make_arena(box, unit="mile")


def test_points_are_sent_to_reconstruct(tmp_path):
    points = tmp_path / "scan.xyz"
    np.savetxt(points, np.random.default_rng(0).random((50, 3)))
    np.savez(tmp_path / "scan.npz", points=np.zeros((5, 3)))
    trimesh.PointCloud(np.random.default_rng(0).random((50, 3))).export(tmp_path / "scan.ply")
    for name in ("scan.xyz", "scan.npz", "scan.ply"):
        with pytest.raises(
            ArenaError, match=r"holds points without a surface; first: symbrion reconstruct .*scan"
        ):
            make_arena(tmp_path / name)


GROUND = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])
SLAB = [trimesh.creation.box(bounds=[[0, 0, -0.2], [4, 2, 0]])]
QUALITY = ArenaQuality(0.0, 0.0, 0.0, 1)
POINTS = np.random.default_rng(0).uniform([0, 0, 0], [4, 2, 0], (2000, 3))


def test_without_viewpoints_nothing_is_known_of_beams():
    assert add_scan_quality(QUALITY, ScannedSurface(GROUND), SLAB, GROUND) == QUALITY
    scanned = ScannedSurface(GROUND, points=POINTS, dropped=0.2)
    quality = add_scan_quality(QUALITY, scanned, SLAB, GROUND)
    assert quality.readings == pytest.approx(0.0, abs=1e-9)
    assert replace(quality, readings=None) == replace(QUALITY, dropped=0.2)


def test_with_viewpoints_beams_are_compared():
    scanned = ScannedSurface(GROUND, points=POINTS, viewpoints=np.array([[2.0, 1.0, 1.0]]))
    for each in (scanned, replace(scanned, points=None)):
        quality = add_scan_quality(QUALITY, each, SLAB, GROUND)
        assert (quality.beams_contact, quality.beams_surface, quality.free_space) == (1.0, 1.0, 0.0)
        assert quality.dropped is None


def test_simulated_readings_are_what_a_viewpoint_sees():
    table = trimesh.creation.box(bounds=[[1, 0.5, 0.5], [2, 1.5, 0.6]])
    scene = trimesh.Trimesh(
        np.concatenate([GROUND.vertices, table.vertices]), np.concatenate([GROUND.faces, table.faces + 4])
    )
    viewpoints = np.array([[1.5, 1.0, 2.0], [1.5, 1.0, 0.3]])
    points, seen_from = simulate_readings(scene, viewpoints, 5000)
    from_above = points[seen_from == 0]
    is_under = (np.abs(from_above[:, :2] - [1.5, 1.0]) < 0.5).all(axis=1) & (from_above[:, 2] < 0.01)
    assert not is_under.any()
    below = points[seen_from == 1]
    assert (np.abs(below[:, :2] - [1.5, 1.0]) < 0.5).all(axis=1).any()
    assert not (below[:, 2] > 0.55).any()


def test_chosen_ends_were_seen():
    room = make_furnished_room()
    viewpoint = [3.4, 0.4, 0.6]  # behind the screen
    room.provenance["viewpoints"] = [viewpoint]
    route = room.find_route()
    assert room.find_seen(np.array([route.start, route.goal])).all()
    free = replace(room, provenance={}).find_route()
    assert not room.find_seen(np.array([free.start, free.goal])).all()


def test_files_that_are_no_meshes(tmp_path):
    with pytest.raises(ArenaError, match=r"absent\.ply: there is no such file"):
        take_surface(tmp_path / "absent.ply")
    (tmp_path / "bad.ply").write_text("not a mesh")
    with pytest.raises(ArenaError, match=r"bad\.ply"):
        take_surface(tmp_path / "bad.ply")
    (tmp_path / "box.zip").write_bytes(b"PK")
    with pytest.raises(ArenaError, match="unpack it, and give one of its files"):
        take_surface(tmp_path / "box.zip")
