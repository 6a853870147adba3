"""Which pieces are chosen, and why: coacd's or the slabs that it was given."""

import numpy as np
import pytest
import trimesh

from reconstruction.geometry.mesh_repair import repair_mesh
from symbrion_gym.arenas.course import Course, StairsCourse
from symbrion_gym.arenas.scanned_surface import make_scanned_surface
from symbrion_gym.contact import terrain
from symbrion_gym.contact.builder import make_contact
from symbrion_gym.contact.options import ContactOptions, ContactTuning, SelectionConfig
from symbrion_gym.errors import ArenaError


@pytest.fixture(scope="module")
def mesh() -> trimesh.Trimesh:
    return repair_mesh(make_scanned_surface(Course().profile(), num_vertices=600, noise=0.002))


def fill_pit(slabs, *_arguments, **_options):
    low, high = (np.array([slab.bounds[i] for slab in slabs]) for i in range(2))
    extents = high.max(axis=0) - low.min(axis=0)
    box = trimesh.creation.box(extents)
    box.apply_translation((high.max(axis=0) + low.min(axis=0)) / 2)
    return [box]


def shift(slabs, *_arguments, **_options):
    return [slab.copy().apply_translation([0.03, 0.0, 0.0]) for slab in slabs]


def shatter(slabs, *_arguments, **_options):
    return [*slabs, *slabs, *slabs]


def fail(*_arguments, **_options):
    raise ArenaError("coacd is not well today")


@pytest.mark.parametrize(
    ("decompose", "reason"),
    [
        (fill_pit, "against"),
        pytest.param(shift, "", marks=pytest.mark.slow),
        pytest.param(shatter, "pieces for", marks=pytest.mark.slow),
        (fail, "not well today"),
    ],
)
def test_slabs_are_kept_where_coacd_does_worse(mesh, monkeypatch, decompose, reason):
    monkeypatch.setattr(terrain, "decompose_slabs", decompose)
    contact = make_contact(mesh, ContactOptions())
    assert contact.notes["way"] == "slabs"
    assert "slabs are kept" in contact.notes["why"]
    assert reason in contact.notes["why"]
    assert contact.quality.mean < 0.003


def test_pieces_as_good_as_the_slabs_are_taken(mesh, monkeypatch):
    monkeypatch.setattr(terrain, "decompose_slabs", lambda slabs, *_: list(slabs))
    contact = make_contact(mesh, ContactOptions())
    assert contact.notes["way"] == "coacd of slabs"


def test_many_slabs_never_go_to_coacd(monkeypatch):
    monkeypatch.setattr(terrain, "decompose_slabs", fail)
    stairs = repair_mesh(make_scanned_surface(StairsCourse(rise=0.1).profile(), num_vertices=1000))
    tuning = ContactTuning(selection=SelectionConfig(max_slabs=3))
    contact = make_contact(stairs, ContactOptions(tuning=tuning))
    assert "too long" in contact.notes["why"]
    assert contact.quality.mean < 0.003


@pytest.mark.slow
def test_boxes_are_refused_where_they_move_the_ground(mesh, monkeypatch):
    monkeypatch.setattr(terrain, "decompose_slabs", fail)
    monkeypatch.setattr(terrain, "turn_into_boxes", shift)
    contact = make_contact(mesh, ContactOptions())
    assert contact.quality.mean < 0.003


def test_a_terrain_has_contact_even_where_nothing_else_gave_any(mesh, monkeypatch):
    monkeypatch.setattr(terrain, "make_slabs", lambda *_arguments: ([], []))
    monkeypatch.setattr(terrain, "decompose_solid", fail)
    contact = make_contact(mesh, ContactOptions(max_pieces=64))
    assert contact.notes["way"] == "coarse prisms"
    assert contact.notes["why"] == "coacd is not well today"
    assert 0 < len(contact.pieces) <= 80
    assert contact.quality.mean < 0.05
