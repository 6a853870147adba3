"""The map of drivable ground: ceilings, tables, walls, slopes and steps that are known by hand."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from constants import with_constants

from benchmarks.material.driving_scenes import (
    GALLERY,
    TABLE,
    make_box,
    make_exact_arena,
    make_furnished_room,
    make_two_storeys,
)
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.traversability import drivable
from symbrion_gym._src.traversability.drivable import find_traversability
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import find_nearest_level


@pytest.fixture(scope="module")
def room():
    return make_furnished_room()


def find_level(ground, x, y, z):
    number = int(find_nearest_level(ground, np.array([[x, y]]), np.array([z]))[0])
    return number if number >= 0 and abs(ground.height[number] - z) < 0.05 else None


def make_ramp(angle: float) -> Arena:
    rise = 2.0 * np.tan(angle)
    line = np.array([(0, -1), (0, 0), (1, 0), (3, rise), (4, rise), (4, -1)], dtype=float)
    pieces = [
        trimesh.Trimesh(np.array([(x, y, z) for y in (0.0, 1.0) for x, z in part])).convex_hull
        for part in (line[[0, 1, 2]], line[[0, 2, 5]], line[[2, 3, 5]], line[[3, 4, 5]])
    ]
    return make_exact_arena("ramp", pieces, pieces)


def test_nothing_stands_on_a_ceiling_seen_from_below(room):
    ground = room.traversability()
    assert ground.height.max() < 2.0
    assert find_level(ground, 0.5, 2.5, 0.0) is not None
    assert find_level(ground, 0.5, 2.5, 2.46) is None


def test_a_table_has_ground_above_and_below(room):
    ground = room.traversability()
    below, above = (find_level(ground, 1.5, 1.4, z) for z in (0.0, TABLE))
    assert ground.clearance[below] == pytest.approx(TABLE - 0.02)
    assert ground.clearance[above] == pytest.approx(2.4 - TABLE)
    assert (ground.region[below], ground.level[below], ground.level[above]) == (0, 0, 1)
    assert ground.region[above] > 0
    tall = room.traversability(Footprint(height=1.0))
    assert find_level(tall, 1.5, 1.4, 0.0) is None


def test_a_thin_screen_and_legs_are_kept_clear(room):
    ground = room.traversability()
    drivable = ground.positions[ground.is_drivable & (ground.height < 0.1)]
    screen = np.abs(drivable[:, 0] - 2.81)[drivable[:, 1] < 1.6]
    assert screen.min() > ground.footprint.width / 2
    leg = np.linalg.norm(drivable[:, :2] - (1.02, 1.02), axis=1)
    assert ground.footprint.width / 2 < leg.min() < 0.25
    wide = room.traversability(Footprint(radius=0.3))
    assert wide.region_areas[0] < ground.region_areas[0]


def test_the_area_of_an_empty_floor_is_that_within_reach_of_its_rim():
    box = make_box((0, 0, -0.1), (2, 1, 0))
    ground = make_exact_arena("floor", [box], [box]).traversability()
    exact = (2 - 2 * ground.footprint.reach) * (1 - 2 * ground.footprint.reach)
    assert 0.85 * exact < ground.region_areas.sum() <= exact
    assert ground.slope[ground.is_drivable] == pytest.approx(0.0)
    assert ground.step[ground.is_drivable] == pytest.approx(0.0)
    assert np.isinf(ground.clearance).all()


@pytest.mark.parametrize(("degrees", "is_climbed"), [(10.0, True), (25.0, False)])
def test_slopes_up_to_the_limit_are_climbed(degrees, is_climbed):
    ground = make_ramp(np.deg2rad(degrees)).traversability()
    on_ramp = find_level(ground, 2.0, 0.5, np.tan(np.deg2rad(degrees)))
    assert np.rad2deg(ground.slope[on_ramp]) == pytest.approx(degrees, abs=0.1)
    assert ground.is_drivable[on_ramp] == is_climbed
    assert ground.num_regions == (1 if is_climbed else 2)


@pytest.mark.parametrize(("height", "num_regions"), [(0.008, 1), (0.014, 2)])
def test_steps_up_to_the_limit_are_climbed(height, num_regions):
    boxes = [make_box((0, 0, -0.1), (2, 1, 0)), make_box((1, 0, -0.1), (2, 1, height))]
    ground = make_exact_arena("step", boxes, boxes).traversability()
    assert ground.num_regions == num_regions
    assert np.nanmax(ground.step) == pytest.approx(height)
    assert make_exact_arena("step", boxes, boxes).traversability(snake(5)).num_regions == 1


@pytest.mark.parametrize(("width", "num_regions"), [(0.012, 1), (0.08, 4)])
def test_gaps_that_a_track_does_not_sink_into_are_no_rims(width, num_regions):
    # the middle of a cell lies in one of the gaps
    planks = [make_box((0, 0.37 * k, -0.05), (1, 0.37 * (k + 1) - width, 0)) for k in range(4)]
    boxes = [make_box((0, 0, -0.1), (1, 1.48, -0.05)), *planks]
    assert make_exact_arena("planks", boxes, boxes).traversability(snake(1)).num_regions == num_regions


def test_a_gallery_and_the_hall_below_are_one_region_by_the_ramp():
    ground = make_two_storeys().traversability()
    above, below = find_level(ground, 1.0, 2.2, GALLERY), find_level(ground, 1.0, 2.2, 0.0)
    assert ground.region[above] == ground.region[below] == 0


def test_links_are_mutual_and_on_one_ground(room):
    ground = room.traversability()
    first, k = np.nonzero(ground.links >= 0)
    second = ground.links[first, k]
    assert np.array_equal(ground.links[second, (k + 4) % 8], first)
    assert np.abs(ground.height[first] - ground.height[second]).max() < 0.01


def test_summary(room):
    ground = room.traversability()
    about = ground.as_dict()
    assert about["num_levels"] == 2
    assert about["drivable_area"] == pytest.approx(sum(about["region_areas"]))


def test_wide_cells_are_said(caplog):
    box = make_box((0, 0, -0.1), (20, 20, 0))
    arena = make_exact_arena("field", [box], [box])
    with with_constants(drivable, max_cells=5_000):
        arena.traversability()
    assert "wider than the body" in caplog.text


def test_what_has_no_ground_is_refused(room):
    with pytest.raises(ArenaError, match="no ground to drive on"):
        find_traversability(room.surface, [], None, Footprint())
    flipped = room.surface.copy()
    flipped.invert()
    upside_down = replace(room, surface=flipped, name="flipped")
    assert find_level(upside_down.traversability(), 0.5, 2.5, 0.0) is None


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"length": 0.0}, "length must be above 0"),
        ({"max_step": -1.0}, "max_step must be at least 0"),
        ({"radius": -1.0}, "radius must be at least 0"),
        ({"max_slope": 2.0}, "max_slope must be below pi/2"),
    ],
)
def test_impossible_bodies_are_refused(fields, message):
    with pytest.raises(OptionError, match=message):
        Footprint(**fields)


def test_footprints_of_organisms(room):
    with pytest.raises(OptionError, match="body must be an Organism or a Footprint"):
        room.traversability("snake")
    one, two, five, eight = (Footprint.of(snake(n)) for n in (1, 2, 5, 8))
    assert one == Footprint.of(None) == Footprint()
    assert (two.length, two.width) == (pytest.approx(0.2304), pytest.approx(0.105))
    assert one.max_step == two.max_step < five.max_step < eight.max_step
    assert one.max_slope == two.max_slope == eight.max_slope
    assert Footprint.of(snake(2), friction=0.3).max_slope < two.max_slope
    assert eight.reach == pytest.approx(np.hypot(eight.length, 0.105) / 2)
    assert Footprint.of(eight) is eight
