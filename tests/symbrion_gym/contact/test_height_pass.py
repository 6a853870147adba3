"""Rough open ground that becomes a height field by itself, and what does not."""

import numpy as np
import pytest
import trimesh
from constants import with_constants

from symbrion_gym._src.contact.builder import make_contact
from symbrion_gym._src.contact.kinds import Contact
from symbrion_gym._src.contact.options import ContactOptions
from symbrion_gym._src.contact.passes import patches

ACCURACY = 0.008


def make_waves(num: int = 41, size: float = 2.0) -> trimesh.Trimesh:
    """Return a square of ground with bumps 10 cm high, finer than planes follow."""
    side = np.linspace(0, size, num)
    x, y = np.meshgrid(side, side)
    heights = 0.05 * np.sin(9 * x + 2) * np.cos(8 * y) + 0.03 * np.sin(15 * x - 11 * y)
    corner = (np.arange(num - 1)[:, None] * num + np.arange(num - 1)).ravel()
    first = np.stack([corner, corner + 1, corner + num], axis=1)
    second = np.stack([corner + 1, corner + num + 1, corner + num], axis=1)
    vertices = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    return trimesh.Trimesh(vertices, np.concatenate([first, second]), process=False)


def make(mesh: trimesh.Trimesh, least_density: float = 1.0) -> Contact:
    with with_constants(patches, least_density=least_density):
        return make_contact(mesh, ContactOptions(), ACCURACY)


@pytest.fixture(scope="module")
def waves() -> Contact:
    return make(make_waves())


def find_result(contact: Contact) -> str | None:
    found = [note["result"] for note in contact.notes["passes"] if note["pass"] == "fit height field"]
    return found[0] if found else None


def test_rough_ground_becomes_a_height_field_as_close_as_patches(waves):
    contact = waves
    assert contact.height_field is not None
    assert contact.pieces == []
    assert find_result(contact) == "accepted"
    assert contact.quality.mean <= 0.3 * ACCURACY
    assert 0.02 <= contact.notes["spacing"] <= 0.06


def test_the_heights_are_those_of_the_ground(waves):
    field = waves.height_field
    assert field is not None
    rows, columns = field.heights.shape
    x, y = np.meshgrid(
        np.linspace(field.low[0], field.high[0], columns), np.linspace(field.low[1], field.high[1], rows)
    )
    wanted = 0.05 * np.sin(9 * x + 2) * np.cos(8 * y) + 0.03 * np.sin(15 * x - 11 * y)
    assert np.abs(field.heights - wanted).max() < 0.012  # the chords of a mesh of 5 cm


def test_ground_with_few_pieces_keeps_them():
    contact = make(make_waves(21, 1.0), 1e6)
    assert contact.height_field is None
    assert find_result(contact) is None


def test_ground_with_holes_keeps_its_pieces():
    mesh = make_waves()
    is_far = np.linalg.norm(mesh.triangles_center[:, :2] - [1.0, 1.0], axis=1) > 0.4
    contact = make(trimesh.Trimesh(mesh.vertices, mesh.faces[is_far], process=False))
    assert contact.height_field is None
    assert "not known" in (find_result(contact) or "")


def test_where_pieces_are_asked_for_there_is_no_height_field():
    with with_constants(patches, least_density=1.0):
        contact = make_contact(make_waves(21, 1.0), ContactOptions(kind="convex"), ACCURACY)
    assert contact.height_field is None
    assert contact.pieces
