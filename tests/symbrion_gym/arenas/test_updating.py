"""An arena is made again only where its surface has changed."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import symbrion_gym as sg
from symbrion_gym._src.arenas.placed_objects import PlacedObject
from symbrion_gym._src.contact.local_changes import UpdateConfig, find_local_changes


def make_floor(bump: float = 0.0, hole: float = 0.0, num: int = 41) -> trimesh.Trimesh:
    """Return a floor of 4 m x 4 m on a grid, with a platform of 0.8 m x 0.8 m raised or sunk in it."""
    side = np.linspace(-2.0, 2.0, num)
    x, y = np.meshgrid(side, side)
    z = np.where((np.abs(x - 1.0) < 0.45) & (np.abs(y - 1.0) < 0.45), bump, 0.0)
    z = np.where((np.abs(x + 1.0) < 0.45) & (np.abs(y + 1.0) < 0.45), -hole, z)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    corner = (np.arange(num - 1)[:, None] * num + np.arange(num - 1)).ravel()
    first = np.stack([corner, corner + 1, corner + num], axis=1)
    second = np.stack([corner + 1, corner + num + 1, corner + num], axis=1)
    return trimesh.Trimesh(vertices, np.concatenate([first, second]), process=False)


@pytest.fixture(scope="module")
def plain() -> sg.Arena:
    return sg.make_arena(make_floor(hole=0.3), accuracy=0.005, name="plain", friction=0.4, cache=False)


def count_kept(arena: sg.Arena, updated: sg.Arena) -> int:
    return sum(any(piece is old for old in arena.pieces) for piece in updated.pieces)


def test_the_same_surface_gives_the_same_arena(plain):
    assert sg.update_arena(plain, make_floor(hole=0.3)) is plain


def test_a_saved_and_loaded_arena_has_not_changed(plain, tmp_path):
    from symbrion_gym._src.arenas.saving import _SURFACE_DIGITS

    assert UpdateConfig().digits == _SURFACE_DIGITS
    fine, other = make_floor(hole=0.3), make_floor(hole=0.3, bump=0.2)
    for mesh in (fine, other):  # no vertex is as round as the file
        mesh.vertices = mesh.vertices * (1.0 + np.pi * 1e-5) + 1.23456789e-5
    sg.make_arena(fine, accuracy=0.005, cache=False).save(tmp_path / "arena")
    loaded = sg.Arena.load(tmp_path / "arena")
    assert not np.array_equal(loaded.surface.vertices, fine.vertices)
    assert sg.update_arena(loaded, fine) is loaded
    updated = sg.update_arena(loaded, other)
    assert 0.0 < updated.provenance["update"]["changed_area"] < 0.1
    assert count_kept(loaded, updated) == updated.provenance["update"]["kept"] >= 1


def test_objects_stay_and_those_where_the_surface_changed_are_named(plain, caplog):
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    places = [(1.0, 1.0, 0.1), (-1.5, 1.5, 0.1)]
    objects = tuple(PlacedObject("box", np.array(place), np.eye(3), box) for place in places)
    updated = sg.update_arena(replace(plain, objects=objects), make_floor(bump=0.2, hole=0.3))
    assert updated.objects == objects
    assert "object_box_0 stays where the surface has changed" in caplog.text
    assert "object_box_1" not in caplog.text


def test_a_new_platform_gets_pieces_and_the_others_stay(plain):
    updated = sg.update_arena(plain, make_floor(bump=0.2, hole=0.3))
    notes = updated.provenance["update"]
    assert notes["built_again"] == ""
    assert count_kept(plain, updated) == notes["kept"] >= 1
    assert notes["made"] >= 1
    assert updated.quality.mean < 0.005
    assert (updated.friction, updated.friction_source, updated.name) == (0.4, "given", "plain")
    top = updated.traversability()
    assert np.isclose(top.positions[:, 2], 0.2, atol=0.01).any()


def test_a_platform_that_is_gone_leaves_the_ground_beneath(plain):
    raised = sg.update_arena(plain, make_floor(bump=0.2, hole=0.3))
    again = sg.update_arena(raised, make_floor(hole=0.3))
    assert again.provenance["update"]["removed"] >= 1
    assert again.quality.mean < 0.005
    assert again.quality.protrusion_p95 is not None
    assert again.quality.protrusion_p95 < 0.015


def test_a_new_hole_cuts_the_slab_it_lies_in(plain):
    filled = sg.make_arena(make_floor(), accuracy=0.005, cache=False)
    updated = sg.update_arena(filled, make_floor(hole=0.3))
    assert updated.quality.mean < 0.005
    assert updated.height(-1.0, -1.0) == pytest.approx(-0.3)


def test_where_most_has_changed_all_is_built_again_and_the_notes_say_so(plain):
    moved = make_floor(hole=0.3)
    moved.apply_translation([0.0, 0.0, 0.5])
    updated = sg.update_arena(plain, moved)
    assert "%" in updated.provenance["update"]["built_again"]
    assert updated.friction == 0.4
    assert updated.name == "plain"


def test_equal_changes_give_equal_arenas(plain):
    first, second = (sg.update_arena(plain, make_floor(bump=0.2, hole=0.3)) for _ in range(2))
    assert len(first.pieces) == len(second.pieces)
    for one, other in zip(first.pieces, second.pieces, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)


def test_an_updated_arena_is_saved_and_updated_again(plain, tmp_path):
    sg.update_arena(plain, make_floor(bump=0.2, hole=0.3)).save(tmp_path / "arena")
    loaded = sg.Arena.load(tmp_path / "arena")
    assert loaded.provenance["update"]["built_again"] == ""
    assert sg.update_arena(loaded, make_floor(bump=0.25, hole=0.3)).quality.mean < 0.005


def test_a_small_move_within_the_tolerance_keeps_all_pieces(plain):
    moved = make_floor(hole=0.3)
    moved.vertices[np.abs(moved.vertices[:, :2]).max(axis=1) < 0.25, 2] += 0.004
    updated = sg.update_arena(plain, moved)
    assert count_kept(plain, updated) == len(plain.pieces) == len(updated.pieces)
    assert updated.surface.vertices[:, 2].max() == pytest.approx(0.004)


def test_what_changed_is_found():
    floor, raised = make_floor(), make_floor(bump=0.2)
    slab = trimesh.creation.box((4.0, 4.0, 0.2))
    slab.apply_translation([0.0, 0.0, -0.1])
    changes = find_local_changes(floor, raised, [slab], 0.005)
    assert not changes.is_removed.any()
    is_top = raised.triangles_center[:, 2] > 0.19
    assert changes.is_open[is_top].all()
    assert not changes.is_open[raised.triangles_center[:, 0] < 0.4].any()
    box = trimesh.creation.box((0.8, 0.8, 0.4))
    box.apply_translation([1.0, 1.0, 0.0])
    back = find_local_changes(raised, floor, [slab, box], 0.005)
    np.testing.assert_array_equal(back.is_removed, [False, True])
    assert not back.is_open.any()


def test_what_no_scan_updates_is_refused(plain):
    with pytest.raises(sg.ArenaError, match="exact course"):
        sg.update_arena(sg.load_arena("truth"), make_floor())
    far = make_floor()
    far.apply_translation([1e6, 0.0, 0.0])
    with pytest.raises(sg.ArenaError, match="offset"):
        sg.update_arena(plain, far)
    with pytest.raises(sg.ArenaError, match="tolerance"):
        UpdateConfig(tolerance=0.0)


def test_a_closed_box_put_on_a_floor_keeps_the_piece_of_the_floor() -> None:
    """The bottom of the box lies on the floor and looks into it: nothing can touch it."""
    room = trimesh.creation.box((3.0, 2.0, 1.5))
    room.invert()
    crate = trimesh.creation.box((0.5, 0.4, 0.4)).apply_translation((0.5, 0.3, -0.55))
    plain = room.subdivide_to_size(0.15)
    boxed = trimesh.util.concatenate([plain, crate.subdivide_to_size(0.15)])
    viewpoint = [[0.0, 0.0, 0.2]]
    arena = sg.make_arena(plain, accuracy=0.005, viewpoints=viewpoint, cache=False)
    updated = sg.update_arena(arena, boxed, viewpoints=viewpoint)
    assert updated.provenance["update"]["built_again"] == ""
    assert all(any(piece is old for piece in updated.pieces) for old in arena.pieces)
    assert len(updated.pieces) > len(arena.pieces)
