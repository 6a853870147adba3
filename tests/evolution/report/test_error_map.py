"""Error maps: red where contact stands in front of the surface, blue where it is missing."""

import io

import numpy as np
import pytest
import trimesh
from PIL import Image

import symbrion_gym as sg
from evolution._src.report.error_map import describe_quality, draw_error_map
from evolution._src.report.figures import to_png
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality

GROUND = trimesh.Trimesh([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]])
QUALITY = ArenaQuality(0.0, 0.0, 0.0, 1)


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evolution._src.report.error_map.WIDTH", 300)


def make_box(low, high) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def find_tints(arena: sg.Arena) -> tuple[float, float]:
    """Return the shares of red and of blue pixels."""
    png = to_png(draw_error_map(arena, limit=0.05), is_reduced=False)
    red, _, blue = np.moveaxis(np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float), 2, 0)
    drawn = slice(60, -100)  # without the text and the color scale
    return float((red - blue > 90)[drawn].mean()), float((blue - red > 90)[drawn].mean())


@pytest.mark.slow
def test_exact_contact_is_gray_a_bump_red_and_a_gap_blue() -> None:
    slab = make_box([0, 0, -0.2], [4, 2, 0])
    assert find_tints(sg.Arena("exact", [slab], GROUND, QUALITY)) == (0.0, 0.0)
    bump = sg.Arena("bump", [slab, make_box([1, 0.5, -0.1], [2, 1.5, 0.3])], GROUND, QUALITY)
    red, blue = find_tints(bump)
    assert red > 0.02
    assert blue == 0.0
    gap = sg.Arena("gap", [make_box([0, 0, -0.2], [3, 2, 0])], GROUND, QUALITY)
    red, blue = find_tints(gap)
    assert red == 0.0
    assert blue > 0.02


@pytest.mark.slow
def test_a_ceiling_does_not_hide_the_room() -> None:
    room = make_box([0, 0, 0], [4, 3, 2])
    room.invert()
    floor, ceiling = make_box([0, 0, -0.1], [4, 3, 0]), make_box([0, 0, 2], [4, 3, 2.1])
    column = make_box([1, 1, 0], [2, 2, 1])
    red, _ = find_tints(sg.Arena("room", [floor, ceiling, column], room, QUALITY))
    assert red > 0.02


@pytest.mark.slow
def test_a_height_field_and_no_piece_are_drawn() -> None:
    field = HeightField(np.full((5, 9), 0.2), np.array([0.0, 0.0]), np.array([4.0, 2.0]))
    arena = sg.Arena("field", [], GROUND, QUALITY, kind="hfield", height_field=field)
    assert find_tints(arena)[0] > 0.1
    assert find_tints(sg.Arena("none", [], GROUND, QUALITY))[1] > 0.1


def test_quality_is_told() -> None:
    quality = ArenaQuality(
        0.004, 0.02, 0.1, 12, uncovered=0.005, beams_contact=0.78, beams_surface=0.79, free_space=0.01
    )
    text = describe_quality(quality)
    assert (
        "12 pieces; surface within reach to contact: mean 4 mm, 95 % 20 mm, max 100 mm; 0.5% without contact"
        in text
    )
    assert "78.0% on contact, 79.0% on the surface" in text
    assert "beams" not in describe_quality(QUALITY)
