"""Friction patches: the map, the cut of the pieces, folders, exports, models."""

import mujoco
import numpy as np
import pytest
import trimesh

from symbrion_gym._src.arenas.arena import Arena, stretch_arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch, find_piece_patches, split_pieces
from symbrion_gym._src.arenas.spec import PATCH_PRIORITY
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

ICE = ((-1.2, -0.9, 0.3), (-0.6, -0.3, -0.5, 0.5, 0.4))
DIAMOND = ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5))


def make_iced() -> Arena:
    return Arena.from_course(Course(friction_patches=ICE))


def test_places_have_the_friction_of_the_first_patch_that_contains_them() -> None:
    patches = (FrictionPatch(0.2, (DIAMOND,), 0.05), FrictionPatch.of_rectangle((0, 0), (2, 1), 0.9))
    found = FrictionMap(patches)
    places = np.array([[0.1, 0.1, 5.0], [1.5, 0.5, 0.0], [0.4, -0.4, 0.0], [-0.4, 0.0, 0.0]])
    assert found.find_patches(places).tolist() == [0, 1, -1, 0]
    assert found.find_friction(places, 0.7).tolist() == [0.2, 0.9, 0.7, 0.2]


def test_a_box_is_cut_into_boxes_and_a_diamond() -> None:
    box = trimesh.creation.box((2.0, 2.0, 0.2))
    found = FrictionMap((FrictionPatch(0.2, (DIAMOND,)),))
    parts = split_pieces([box], found)
    assert len(parts) == 5
    assert sum(part.volume for part in parts) == pytest.approx(box.volume)
    assert find_piece_patches(parts, found) == [0, -1, -1, -1, -1]
    assert parts[0].volume == pytest.approx(0.5 * 0.2)
    tops = np.concatenate([part.vertices[:, 2] for part in parts])
    assert set(np.abs(tops)) == {0.1}, "the top stays one plane, to the bit"


def test_folder_and_models_carry_the_map(tmp_path) -> None:
    arena = make_iced()
    arena.save(tmp_path / "arena")
    loaded = Arena.load(tmp_path / "arena")
    assert loaded.friction_map == arena.friction_map == arena.course.friction_map
    assert loaded.course == arena.course
    arena.export(tmp_path / "mjcf", "mjcf")
    for model in (
        arena.spec().compile(),
        loaded.spec().compile(),
        mujoco.MjModel.from_xml_path(str(tmp_path / "arena" / "arena.xml")),
        mujoco.MjModel.from_xml_path(str(tmp_path / "mjcf" / "arena.xml")),
    ):
        in_patch = model.geom_priority == PATCH_PRIORITY
        assert sorted(model.geom_friction[in_patch, 0]) == [0.3, 0.3, 0.4, 0.4]
        assert set(model.geom_friction[~in_patch & (model.geom_contype > 0), 0]) == {0.7}


def test_a_stretched_arena_has_stretched_patches() -> None:
    arena = stretch_arena(make_iced(), 1.1)
    assert len(arena.pieces) == len(make_iced().pieces)
    assert arena.course.friction_patches[0] == pytest.approx((-1.32, -0.99, 0.3))
    assert arena.friction_map == FrictionMap(arena.course.friction_map.patches)


@pytest.mark.parametrize(
    ("patch", "message"),
    [
        ((0.0, 1.0), "is needed"),
        ((1.0, 0.0, 0.3), "must be below"),
        ((0.0, 1.0, 0.0), "friction of a patch is 0.0"),
    ],
)
def test_courses_refuse_patches_that_are_no_rectangles(patch: tuple[float, ...], message: str) -> None:
    with pytest.raises(ArenaError, match=message):
        Course(friction_patches=(patch,))


@pytest.mark.parametrize(
    "outline",
    [
        ((0, 0), (1, 0)),
        ((0, 0), (0, 1), (1, 0)),
        ((0, 0), (1, 0), (2, 0)),
        ((0, 0), (2, 0), (1, 0.2), (0, 2)),
        ((0, 0), (1, 0), (0, float("nan"))),
    ],
)
def test_outlines_that_are_not_convex_are_refused(outline: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(ArenaError, match="outline is"):
        FrictionPatch(0.5, (outline,))


def test_impossible_values_are_refused() -> None:
    with pytest.raises(ArenaError, match="half_width"):
        FrictionPatch(0.5, (DIAMOND,), -0.1)
    with pytest.raises(ArenaError, match="half_width"):
        FrictionMap((), -0.1)
    with pytest.raises(ArenaError, match="no outline"):
        FrictionPatch(0.5, ())


def test_height_fields_have_one_friction() -> None:
    heights = HeightField(np.zeros((3, 3)), np.zeros(2), np.ones(2))
    quality = ArenaQuality(0.0, 0.0, 0.0, 0)
    surface = trimesh.creation.box((1.0, 1.0, 0.1))
    found = FrictionMap((FrictionPatch(0.2, (DIAMOND,)),))
    with pytest.raises(ArenaError, match="of the kind 'convex' for patches"):
        Arena("a", [], surface, quality, kind="hfield", height_field=heights, friction_map=found)


@pytest.mark.parametrize(
    "patches", [(0.0, 1.0, 0.3), ["ice"], [FrictionPatch.of_rectangle((0, 0), (1, 1), 0.3)]]
)
def test_patches_that_are_no_rectangles_are_refused(patches: object) -> None:
    with pytest.raises(ArenaError, match=r"a list of rectangles is needed, each \(lowest x"):
        Course(friction_patches=patches)  # pyright: ignore[reportArgumentType]
