"""Pictures of an arena show the layers that are asked for."""

import io

import numpy as np
import pytest
from PIL import Image

import symbrion_gym as sg
from evolution.report.arena_view import draw_arena, mute
from evolution.report.pictures import to_png


@pytest.fixture(scope="module")
def truth() -> sg.Arena:
    return sg.load_arena("truth")


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evolution.report.arena_view.WIDTH", 300)


def draw(arena: sg.Arena, *layers: str) -> np.ndarray:
    ground, route = arena.traversability(), arena.find_route()
    png = to_png(draw_arena(arena, layers, ground, route), is_reduced=False)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float)


def find_share(pixels: np.ndarray, channel: int) -> float:
    """Return the share of pixels in which one channel is much larger than the others."""
    others = np.delete(pixels, channel, axis=2).max(axis=2)
    return float((pixels[..., channel] - others > 25).mean())


def test_layers_have_their_colors(truth: sg.Arena) -> None:
    surface, ground = draw(truth, "surface"), draw(truth, "surface", "drivable")
    assert find_share(surface, 1) == 0.0
    assert find_share(ground, 1) > 0.03
    assert find_share(ground, 2) > 0.03  # the smaller region
    contact = draw(truth, "surface", "contact")
    assert (np.ptp(contact, axis=2) > 25).mean() > 0.05
    assert (np.ptp(surface, axis=2) > 25).mean() < 0.001
    route = draw(truth, "surface", "route")
    assert ((route[..., 0] > 120) & (route[..., 1] < 40)).sum() > 100


def test_colors_of_a_scan_are_grays_below_other_layers() -> None:
    arena = sg.Arena.from_course(sg.Course(color_pattern="checker"))
    assert (np.ptp(draw(arena, "surface"), axis=2) > 60).mean() > 0.2
    grays = mute(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(grays.max(axis=1), [0.92, 0.57, 0.57 + 0.35 * 0.2126])
    assert np.ptp(grays, axis=1).max() == 0.0
    ground = draw(arena, "surface", "drivable")
    plain = draw(sg.load_arena("truth"), "surface", "drivable")
    assert abs(find_share(ground, 1) - find_share(plain, 1)) < 0.05


def test_equal_arenas_give_equal_pictures(truth: sg.Arena) -> None:
    np.testing.assert_array_equal(draw(truth, "contact"), draw(truth, "contact"))
