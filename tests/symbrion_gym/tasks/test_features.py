"""Gaps, ramps, steps and stairs are found on the surface alone: on exact courses, on scans, turned by any angle."""

import numpy as np
import pytest
import trimesh

from benchmarks.material.bare_surfaces import make_bare
from benchmarks.material.driving_scenes import make_furnished_room, make_terrain
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.tasks.features.gap import find_gap, find_ramp, find_ramps
from symbrion_gym._src.tasks.features.stairs import find_stairs, find_step
from symbrion_gym._src.tasks.features.way import read_profile


@pytest.mark.parametrize(("width", "height"), [(0.2, 0.25), (0.45, 0.15)])
def test_the_gap_of_an_exact_course_is_found_to_a_tenth_of_a_millimeter(width: float, height: float) -> None:
    gap = find_gap(make_bare(Course(pit=width, height=height).surface()), snake(8))
    assert (gap.near, gap.far) == pytest.approx((-width / 2, width / 2), abs=1e-4)
    assert (gap.floor, gap.top) == pytest.approx((0.0, height), abs=1e-6)
    assert gap.start == pytest.approx(-width / 2 - 1.5, abs=1e-3)
    assert gap.way.half_width == pytest.approx(1.0, abs=0.011)
    assert gap.confidence == 1.0
    assert gap.find_finish(snake(8)) == pytest.approx(width / 2 + 0.0627, abs=1e-4)


@pytest.mark.parametrize("degrees", [10, 90, -65, 137])
def test_a_turned_course_is_crossed_perpendicular_to_its_edges(degrees: float) -> None:
    yaw, middle = np.radians(degrees), np.array([3.0, -2.0])
    gap = find_gap(make_bare(Course(pit=0.35).surface(), yaw, tuple(middle)))
    direction = np.array(gap.way.direction)
    assert abs(direction @ [np.cos(yaw), np.sin(yaw)]) == pytest.approx(1.0, abs=1e-6)
    assert (gap.near, gap.far) == pytest.approx(middle @ direction + np.array([-0.175, 0.175]), abs=5e-3)


@pytest.mark.parametrize("name", ["gsrm", "gg"])
def test_the_gap_of_a_scan_is_found_to_3_mm(name: str) -> None:
    surface = load_arena(name, Course(pit=0.45)).surface
    for yaw in (0.0, 0.5):
        gap = find_gap(make_bare(surface, yaw))
        assert gap.way.heading == pytest.approx(yaw, abs=np.radians(0.2))
        assert (gap.near, gap.far) == pytest.approx((-0.225, 0.225), abs=0.003)
        assert gap.start == pytest.approx(-0.225 - 1.5, abs=0.01)
        assert gap.confidence > 0.8


def test_the_way_back_meets_the_far_edge_first() -> None:
    gap = find_gap(make_bare(Course(pit=0.3).surface(), move=(1.0, 0.0)), direction=(-1, 0))
    assert (gap.near, gap.far) == pytest.approx((-1.15, -0.85), abs=1e-4)
    for direction in ((0.0, 0.0), (np.nan, 1.0), (1.0, 0.0, 0.0)):
        with pytest.raises(TaskError, match="direction must be"):
            find_gap(make_bare(Course().surface()), direction=direction)


def test_a_course_that_is_known_is_not_looked_at() -> None:
    lying = Arena.from_course(Course(pit=0.2))
    bare = make_bare(Course(pit=0.3).surface())
    object.__setattr__(lying, "surface", bare.surface)
    assert find_gap(lying) == find_gap(bare)


@pytest.mark.parametrize(
    ("arena", "reason"),
    [
        (make_bare(StairsCourse().surface()), "nowhere drops by 0.08 m"),
        (make_bare(Course(pit=0.07, height=0.05).surface()), "nowhere drops"),
        (make_bare(Course(pit=2.0).surface()), "within 1.5 m"),
        (make_furnished_room(), "something hangs above 100 %"),
        (make_terrain(0), "no gap"),
    ],
)
def test_what_has_no_gap_is_refused_with_the_reason(arena: Arena, reason: str) -> None:
    with pytest.raises(TaskError, match=reason):
        find_gap(arena)


def test_a_pit_that_can_be_driven_around_is_no_gap() -> None:
    x, y = np.meshgrid(np.linspace(-3, 3, 301), np.linspace(-1, 1, 101), indexing="ij")
    z = np.where((np.abs(x) < 0.2) & (y < -0.1), 0.0, 0.25)
    corner = np.arange(301 * 101).reshape(301, 101)
    a, b, c, d = (
        part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    surface = trimesh.Trimesh(np.stack([x, y, z], -1).reshape(-1, 3), faces, process=False)
    with pytest.raises(TaskError, match="whole way"):
        find_gap(make_bare(surface))


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_a_ramp_has_foot_crest_and_slope(yaw):
    ramp = find_ramp(make_bare(Course(pit=0.4).surface(), yaw))
    assert (ramp.foot, ramp.crest) == pytest.approx((-1.7, -0.7), abs=1e-3)
    assert (ramp.low, ramp.high) == pytest.approx((0.0, 0.25), abs=1e-3)
    assert ramp.slope == pytest.approx(np.arctan(0.25), abs=1e-3)


def test_both_ramps_of_a_scan_are_found():
    ramps = find_ramps(read_profile(load_arena("gsrm")))
    assert [ramp.rise for ramp in ramps] == pytest.approx([0.25, -0.25], abs=0.003)
    assert (ramps[0].foot, ramps[1].crest) == pytest.approx((-1.725, 1.725), abs=0.02)


@pytest.mark.parametrize("yaw", [0.0, -0.4])
def test_stairs_have_their_steps(yaw):
    surface = make_bare(StairsCourse(steps=4, rise=0.06, run=0.25).surface(), yaw)
    steps = find_stairs(surface).steps
    assert [step.edge for step in steps] == pytest.approx([0.0, 0.25, 0.5, 0.75], abs=1e-3)
    assert [step.rise for step in steps] == pytest.approx([0.06] * 4, abs=1e-3)
    assert {step.confidence for step in steps} == {1.0}
    assert find_step(surface, snake(2)) == steps[0]


def test_what_is_not_there_is_refused_with_the_reason():
    course, stairs = make_bare(Course().surface()), make_bare(StairsCourse().surface())
    for find in (find_step, find_stairs):
        with pytest.raises(TaskError, match="on the way across arena 'bare'"):
            find(course)
    with pytest.raises(TaskError, match="no ramp"):
        find_ramp(stairs)
    with pytest.raises(TaskError, match="1 steps on it"):
        find_stairs(make_bare(StairsCourse(steps=1).surface()))
    with pytest.raises(TaskError, match="no step"):  # the far wall of a pit
        find_step(make_bare(Course(pit=0.3, height=0.1).surface()))


def test_a_way_knows_its_width_and_ends():
    way = read_profile(make_bare(Course(pit=0.4, width=1.5).surface(), move=(0.0, 2.0))).way
    assert (way.heading, way.lateral) == (0.0, 2.0)
    assert (way.begin, way.end) == pytest.approx((-3.3, 3.3))
    assert way.width == pytest.approx(1.5, abs=0.03)
