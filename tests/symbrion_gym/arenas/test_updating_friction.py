"""What robots felt of the ground becomes the friction of an arena that is updated."""

import numpy as np
import pytest

import reconstruction as rc
import symbrion_gym as sg
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.slip.drags import FrictionReadings


def make_slip(icy: float = 0.3) -> FrictionReadings:
    """Return readings of three lanes along x over ground of 0.6, icy beyond x = 0.4."""
    x, y = np.meshgrid(np.arange(-0.9, 0.9, 0.06), (-0.5, 0.0, 0.5))
    places = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    frictions = np.where(places[:, 0] > 0.4, icy, 0.6) + 0.005 * (-1.0) ** np.arange(len(places))
    same = np.full(len(places), 0.01)
    return FrictionReadings(places, frictions, same, same, np.repeat(np.arange(3), x.shape[1]))


@pytest.fixture(scope="module")
def surface() -> Reconstruction:
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(-1, 1, (6000, 2)), rng.normal(0, 0.002, 6000)]
    return rc.reconstruct(floor, units=200)


@pytest.fixture(scope="module")
def felt(surface: Reconstruction) -> Reconstruction:
    return Reconstruction(surface.method, surface.config, surface.state, surface.cloud, slip=make_slip())


def make_arena(surface: Reconstruction, **options) -> sg.Arena:
    return sg.make_arena(surface, accuracy=0.005, cache=False, **{"kind": "convex", **options})


def test_felt_ice_is_cut_into_an_arena_of_the_same_surface(surface, felt):
    arena = make_arena(surface)
    updated = sg.update_arena(arena, felt)
    assert (arena.friction_source, updated.friction_source) == ("assumed", "estimated")
    assert updated.friction == pytest.approx(0.6, abs=0.02)
    assert updated.find_friction(np.array([[0.8, 0.0], [-0.5, 0.0]])) == pytest.approx([0.3, 0.6], abs=0.02)
    assert updated.provenance["update"]["friction_patches"] == len(updated.friction_map.patches) == 1
    volumes = [sum(piece.volume for piece in each.pieces) for each in (arena, updated)]
    assert volumes[1] == pytest.approx(volumes[0])
    far = [piece for piece in arena.pieces if piece.bounds[1, 0] < 0.2]
    assert all(any(piece is other for other in updated.pieces) for piece in far)
    assert sg.update_arena(updated, felt) is updated


def test_a_friction_that_a_user_gave_stays(surface, felt):
    arena = make_arena(surface, friction=0.5)
    assert sg.update_arena(arena, felt) is arena


def test_a_height_field_becomes_pieces_where_there_is_ice(surface, felt):
    arena = make_arena(surface, kind="auto")
    if arena.height_field is None:
        arena = make_arena(surface, kind="hfield")
        with pytest.raises(sg.ArenaError, match="one friction"):
            sg.update_arena(arena, felt)
        return
    updated = sg.update_arena(arena, felt)
    assert updated.kind == "convex"
    assert updated.friction_map is not None
    assert "height field" in updated.provenance["update"]["built_again"]


def test_friction_that_has_changed_again_replaces_the_former(surface, felt):
    arena = sg.update_arena(make_arena(surface), felt)
    other = Reconstruction(surface.method, surface.config, surface.state, surface.cloud, slip=make_slip(0.45))
    again = sg.update_arena(arena, other)
    assert again.find_friction(np.array([[0.8, 0.0]])) == pytest.approx(0.45, abs=0.02)
