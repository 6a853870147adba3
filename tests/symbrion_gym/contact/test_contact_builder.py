"""The passes: which candidate is accepted, and why."""

import numpy as np
import pytest
import trimesh
from scanned_surface import make_scanned_surface

from reconstruction._src.geometry.mesh_repair import RepairConfig, repair_mesh
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.contact.builder import make_contact
from symbrion_gym._src.contact.options import ContactOptions
from symbrion_gym._src.contact.passes import coacd
from symbrion_gym._src.errors import ArenaError

ACCURACY = 0.005


@pytest.fixture(scope="module")
def mesh() -> trimesh.Trimesh:
    return repair_mesh(make_scanned_surface(Course().profile(), num_vertices=1500, noise=0.002))


def make_rough(num_vertices: int = 700) -> trimesh.Trimesh:
    """Return hills with bumps, for which planes are no model."""
    rng = np.random.default_rng(0)
    flat = make_scanned_surface(np.array([[-1.5, 0.0], [1.5, 0.0]]), 3.0, num_vertices, 0.0)
    vertices = np.array(flat.vertices)
    for _ in range(60):
        x, y, size = *rng.uniform(-1.5, 1.5, 2), rng.uniform(0.1, 0.4)
        near = np.exp(-((vertices[:, 0] - x) ** 2 + (vertices[:, 1] - y) ** 2) / (2 * size**2))
        vertices[:, 2] += rng.normal() * 0.4 * size * near
    return repair_mesh(trimesh.Trimesh(vertices, flat.faces, process=False))


def fill_pit(pieces, *_arguments, **_options):
    low, high = (np.array([slab.bounds[i] for slab in pieces]) for i in range(2))
    extents = high.max(axis=0) - low.min(axis=0)
    box = trimesh.creation.box(extents)
    box.apply_translation((high.max(axis=0) + low.min(axis=0)) / 2)
    return [box]


def shift(pieces, *_arguments, **_options):
    return [slab.copy().apply_translation([0.03, 0.0, 0.0]) for slab in pieces]


def shatter(pieces, *_arguments, **_options):
    return [*pieces, *pieces, *pieces]


def fail(*_arguments, **_options):
    raise ArenaError("coacd is not well today")


def find_note(contact, name):
    return next(note["result"] for note in contact.notes["passes"] if note["pass"] == name)


@pytest.mark.parametrize(
    ("decompose", "reason"),
    [
        (fill_pit, "move walls"),
        pytest.param(shift, "move walls", marks=pytest.mark.slow),
        pytest.param(shatter, "pieces for", marks=pytest.mark.slow),
        (fail, "not well today"),
    ],
)
def test_slabs_are_kept_where_coacd_does_worse(mesh, monkeypatch, decompose, reason):
    monkeypatch.setattr(coacd, "decompose_slabs", decompose)
    contact = make_contact(mesh, ContactOptions(), ACCURACY)
    assert contact.notes["way"] == "slabs"
    assert reason in find_note(contact, "decompose united slabs")
    assert contact.quality.mean < 0.003


def test_pieces_as_good_as_the_slabs_are_taken(mesh, monkeypatch):
    monkeypatch.setattr(coacd, "decompose_slabs", lambda pieces, *_: list(pieces))
    contact = make_contact(mesh, ContactOptions(), ACCURACY)
    assert contact.notes["way"] == "coacd of slabs"


def test_many_slabs_never_go_to_coacd(monkeypatch):
    monkeypatch.setattr(coacd, "decompose_slabs", fail)
    stairs = repair_mesh(make_scanned_surface(StairsCourse(rise=0.1).profile(), num_vertices=2000))
    monkeypatch.setattr(coacd, "MAX_UNITED", 3)
    contact = make_contact(stairs, ContactOptions(), ACCURACY)
    assert "too long" in find_note(contact, "decompose united slabs")
    assert contact.quality.mean < 0.003


@pytest.mark.slow
def test_boxes_are_refused_where_they_move_the_ground(mesh, monkeypatch):
    monkeypatch.setattr(coacd, "decompose_slabs", fail)
    monkeypatch.setattr(coacd, "turn_into_boxes", shift)
    contact = make_contact(mesh, ContactOptions(), ACCURACY)
    assert contact.quality.mean < 0.003
    assert "refused" in find_note(contact, "fit boxes")


def test_without_slabs_patches_follow_the_course(mesh, monkeypatch):
    monkeypatch.setattr(coacd, "make_slabs", lambda *_arguments: ([], []))
    contact = make_contact(mesh, ContactOptions(), ACCURACY)
    assert contact.notes["way"] == "patches of planes and triangles"
    assert contact.notes["is_reached"]
    assert contact.quality.mean < 0.003
    assert contact.quality.uncovered < 0.008


def test_a_room_is_hollow():
    """Walls, floor and ceiling of a room seen from inside grow outwards: all of its inside stays free."""
    room = trimesh.creation.box([4.0, 3.0, 2.5]).subdivide().subdivide()
    room.invert()
    room.update_faces(np.arange(len(room.faces)) > 0)  # a hole: it is no closed body
    oriented = repair_mesh(room, RepairConfig(keeps_winding=True))
    contact = make_contact(oriented, ContactOptions(), 0.01)
    inside = np.random.default_rng(0).uniform([-1.99, -1.49, -1.24], [1.99, 1.49, 1.24], (2000, 3))
    for piece in contact.pieces:
        planes = piece.face_normals, (piece.face_normals * piece.triangles[:, 0]).sum(axis=1)
        is_in = (inside @ planes[0].T < planes[1]).all(axis=1)
        assert not is_in.any()
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


def test_a_pass_of_ones_own(mesh):
    def fit_box(problem, best):
        return problem.measure([trimesh.creation.box(bounds=mesh.bounds)], {"way": "one box"})

    contact = make_contact(mesh, ContactOptions(), ACCURACY, passes=(fit_box,))
    assert contact.notes["way"] == "one box"
    assert not contact.notes["is_reached"]


def test_the_deadline_ends_with_the_best_so_far(mesh):
    contact = make_contact(mesh, ContactOptions(time_limit=1e-6), ACCURACY)
    assert contact.pieces
    assert contact.notes["was_cut_short"]
    assert "time limit" in contact.notes["warnings"][0]
