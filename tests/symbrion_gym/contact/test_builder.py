"""Ways to make contact, which of them is taken, and what it promises."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from benchmarks.material.driving_scenes import make_terrain
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.mesh_repair import repair_mesh
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.contact import builder, coacd
from symbrion_gym._src.contact.builder import make_contact
from symbrion_gym._src.contact.distances import compute_depths
from symbrion_gym._src.contact.kinds import ContactOptions
from symbrion_gym._src.contact.reach import Reach
from symbrion_gym._src.errors import ArenaError

ACCURACY = 0.005


@pytest.fixture(scope="module")
def mesh() -> trimesh.Trimesh:
    return repair_mesh(make_scanned_surface(Course().profile(), num_vertices=1500, noise=0.002))


@pytest.fixture
def dense(monkeypatch):
    """Look for a height field from one piece a square meter on, and make no slabs, which take long here."""
    monkeypatch.setattr(builder, "_LEAST_DENSITY", 1.0)
    monkeypatch.setattr(builder, "make_slabs", lambda *_arguments: [])


def shift(pieces, *_arguments):
    return [slab.copy().apply_translation([0.03, 0.0, 0.0]) for slab in pieces]


def find_note(contact, name):
    return next(note["result"] for note in contact.notes["passes"] if note["pass"] == name)


@pytest.mark.slow
def test_a_scanned_course_becomes_few_boxes(mesh):
    contact = make_contact(mesh, ContactOptions(), ACCURACY)
    assert contact.notes["way"] == "slabs"
    assert contact.notes["is_reached"]
    assert len(contact.pieces) <= 8
    assert contact.quality.mean < 0.003
    again = make_contact(mesh.copy(), ContactOptions(), ACCURACY)
    assert all(
        np.array_equal(a.vertices, b.vertices) for a, b in zip(contact.pieces, again.pieces, strict=True)
    )


@pytest.mark.slow
def test_boxes_are_refused_where_they_move_the_ground(mesh, monkeypatch):
    monkeypatch.setattr(builder, "turn_into_boxes", shift)
    contact = make_contact(mesh, ContactOptions(), ACCURACY)
    assert contact.quality.mean < 0.003
    assert "refused" in find_note(contact, "fit boxes")


@pytest.mark.slow
def test_without_slabs_patches_follow_the_course(mesh, dense):
    contact = make_contact(mesh, ContactOptions(kind="convex"), ACCURACY)
    assert contact.notes["way"] == "patches of planes and triangles"
    assert contact.notes["is_reached"]
    assert contact.quality.mean < 0.003
    assert contact.quality.uncovered < 0.008


def test_a_room_is_hollow():
    """Walls, floor and ceiling of a room seen from inside grow outwards: all of its inside stays free."""
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide().subdivide()
    room.invert()
    room.update_faces(np.arange(len(room.faces)) > 0)  # a hole: it is no closed body
    oriented = repair_mesh(room, keeps_winding=True)
    contact = make_contact(oriented, ContactOptions(), 0.01)
    inside = np.random.default_rng(0).uniform([-1.99, -1.49, -1.24], [1.99, 1.49, 1.24], (2000, 3))
    assert not compute_depths(inside, contact.pieces).any()
    assert contact.quality.mean < 0.001
    assert contact.quality.uncovered < 0.008


def test_a_thin_wall_is_not_pierced():
    wall = trimesh.creation.box([2.0, 0.03, 1.0]).subdivide().subdivide()
    contact = make_contact(repair_mesh(wall), ContactOptions(), 0.003)
    reach = max(np.abs(piece.vertices[:, 1]).max() for piece in contact.pieces)
    assert reach < 0.016


def test_faces_seen_from_behind_stay_thin():
    sheet = trimesh.Trimesh(
        [[0, 0, 0], [2, 0, 0], [2, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    contact = make_contact(sheet, ContactOptions(), 0.003, is_two_sided=np.ones(len(sheet.faces), bool))
    assert max(np.ptp(piece.vertices[:, 1]) for piece in contact.pieces) < 0.02


@pytest.mark.slow
def test_a_body_becomes_pieces_of_coacd():
    contact = make_contact(trimesh.creation.torus(0.5, 0.12), ContactOptions(), 0.005)
    assert contact.notes["way"] == "coacd"
    assert len(contact.pieces) < 60
    assert contact.notes["is_reached"]


@pytest.mark.slow
def test_the_time_limit_of_coacd_gives_an_error_and_never_another_contact(monkeypatch):
    monkeypatch.setattr(coacd, "_TIME_LIMIT", 1e-6)
    with pytest.raises(ArenaError, match=r"coacd took longer than 1e-06 s on .* give a simpler body"):
        make_contact(trimesh.creation.torus(0.5, 0.12), ContactOptions(), 0.005)


@pytest.fixture(scope="module")
def rough() -> trimesh.Trimesh:
    return make_terrain(3, size=2.0, spacing=0.1).surface


@pytest.mark.slow
def test_rough_ground_becomes_a_height_field_as_close_as_patches(rough, dense):
    contact = make_contact(rough, ContactOptions(), 0.008)
    field = contact.height_field
    assert field is not None
    assert contact.pieces == []
    assert find_note(contact, "fit height field") == "accepted"
    assert contact.quality.mean <= 0.3 * 0.008
    heights = Elevation(rough).height(*field.find_places())
    assert np.nanmax(np.abs(field.heights - heights)) < 1e-6


@pytest.mark.slow
def test_ground_with_holes_keeps_its_pieces(rough, dense):
    is_far = np.linalg.norm(rough.triangles_center[:, :2] - rough.bounds.mean(axis=0)[:2], axis=1) > 0.4
    torn = trimesh.Trimesh(rough.vertices, rough.faces[is_far], process=False)
    contact = make_contact(torn, ContactOptions(), 0.008)
    assert contact.pieces
    assert "not known" in find_note(contact, "fit height field")


@pytest.mark.slow
def test_where_few_pieces_do_or_pieces_are_asked_for_there_is_no_height_field(rough, dense, monkeypatch):
    assert make_contact(rough, ContactOptions(kind="convex"), 0.008).pieces
    monkeypatch.setattr(builder, "_LEAST_DENSITY", 1e6)
    assert make_contact(rough, ContactOptions(), 0.008).pieces


@pytest.mark.slow
def test_where_pieces_miss_what_is_wanted_a_height_field_is_taken_that_is_closer(rough):
    is_far = np.linalg.norm(rough.triangles_center[:, :2] - rough.bounds.mean(axis=0)[:2], axis=1) > 0.4
    torn = trimesh.Trimesh(rough.vertices, rough.faces[is_far], process=False)
    for surface, is_whole in ((rough, True), (torn, False)):
        taken, pieces = (
            make_contact(surface, ContactOptions(max_pieces=40, kind=kind), 0.004)
            for kind in ("auto", "convex")
        )
        field = taken.height_field
        assert field is not None
        assert taken.quality.mean < pieces.quality.mean / 2
        assert not pieces.notes["is_reached"]
        height = field.heights[
            np.hypot(*(field.find_places() - rough.bounds.mean(axis=0)[:2, None, None])) < 0.3
        ]
        lowest = float(surface.vertices[:, 2].min())
        assert is_whole or height == pytest.approx(lowest, abs=0.02), (
            "where no ground is known it is the lowest"
        )


@pytest.mark.slow
def test_contact_is_coarse_beyond_reach_and_as_accurate_as_before_within_it():
    rng, (u, v) = np.random.default_rng(0), np.meshgrid(np.linspace(0, 2.4, 25), np.linspace(0, 2.4, 25))
    cell = (np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
    corners = np.concatenate([cell[:, None] + [0, 1, 26], cell[:, None] + [0, 26, 25]])
    depth = rng.normal(scale=0.015, size=u.shape) * (u > 0)
    floor, wall = (np.stack(each, axis=-1).reshape(-1, 3) for each in ((u, v, 0 * u), (depth, v, u)))
    faces = np.concatenate([corners, corners[:, ::-1] + len(floor)])
    room = trimesh.Trimesh(np.concatenate([floor, wall]), faces)
    assert (room.face_normals[:, [0, 2]].sum(axis=1) > 0).all()
    usual, coarse = (
        make_contact(room, ContactOptions(), 0.004, zone=zone) for zone in (None, Reach(room, 0.8, 0.105))
    )
    high, fewer = ([piece.bounds[0, 2] > 0.8 for piece in each.pieces] for each in (usual, coarse))
    assert 0 < sum(fewer) < sum(high) / 3
    assert coarse.quality.mean < 0.004  # of what is within reach
    assert coarse.quality.p95 < 0.012
