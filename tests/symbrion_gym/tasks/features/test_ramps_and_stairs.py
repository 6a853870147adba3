"""Ramps, steps and stairs are found on the surface alone."""

import numpy as np
import pytest

from benchmarks.material.bare_surfaces import make_bare
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.robot.organism import snake
from symbrion_gym._src.tasks.features.ramp import RampSearch, find_ramp, find_ramps
from symbrion_gym._src.tasks.features.stairs import StepSearch, find_stairs, find_step
from symbrion_gym._src.tasks.features.way import WaySearch, find_way, read_profile


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_a_ramp_has_foot_crest_and_slope(yaw):
    ramp = find_ramp(make_bare(Course(pit=0.4).surface(), yaw), snake(8))
    assert (ramp.foot, ramp.crest) == pytest.approx((-1.7, -0.7), abs=1e-3)
    assert (ramp.low, ramp.high) == pytest.approx((0.0, 0.25), abs=1e-3)
    assert ramp.slope == pytest.approx(np.arctan(0.25), abs=1e-3)
    assert np.linalg.norm(np.diff(ramp.foot_line, axis=0)) == pytest.approx(2.0, abs=0.03)


def test_both_ramps_of_a_scan_are_found():
    ramps = find_ramps(read_profile(load_arena("gsrm")))
    assert [ramp.rise for ramp in ramps] == pytest.approx([0.25, -0.25], abs=0.003)
    assert (ramps[0].foot, ramps[1].crest) == pytest.approx((-1.725, 1.725), abs=0.02)


def test_a_ramp_too_steep_for_a_body_is_refused():
    steep = make_bare(Course(pit=0.0, ramp=0.6).surface())
    assert find_ramp(steep).slope == pytest.approx(np.arctan2(0.25, 0.6), abs=1e-2)
    with pytest.raises(TaskError, match="23 degrees; the organism climbs 15"):
        find_ramp(steep, snake(1))


@pytest.mark.parametrize("yaw", [0.0, -0.4])
def test_stairs_have_their_steps(yaw):
    course = StairsCourse(steps=4, rise=0.06, run=0.25)
    stairs = find_stairs(make_bare(course.surface(), yaw))
    assert [step.edge for step in stairs.steps] == pytest.approx([0.0, 0.25, 0.5, 0.75], abs=1e-3)
    assert (stairs.rise, stairs.run, stairs.confidence) == pytest.approx((0.06, 0.25, 1.0), abs=1e-3)
    assert find_step(make_bare(course.surface(), yaw), snake(2)) == stairs.steps[0]


def test_what_is_not_there_is_refused_with_the_reason():
    course, stairs = make_bare(Course().surface()), make_bare(StairsCourse().surface())
    for find in (find_step, find_stairs):
        with pytest.raises(TaskError, match="on the way across arena 'bare'"):
            find(course)
    with pytest.raises(TaskError, match="no ramp"):
        find_ramp(stairs)
    with pytest.raises(TaskError, match="1 steps on it"):
        find_stairs(make_bare(StairsCourse(steps=1).surface()))


def test_the_far_wall_of_a_pit_is_no_step():
    with pytest.raises(TaskError, match="no step"):
        find_step(make_bare(Course(pit=0.3, height=0.1).surface()))


def test_a_way_knows_its_width_and_ends():
    way = find_way(make_bare(Course(pit=0.4, width=1.5).surface(), move=(0.0, 2.0)))
    assert (way.heading, way.lateral) == (0.0, 2.0)
    assert (way.begin, way.end) == pytest.approx((-3.3, 3.3))
    assert way.width == pytest.approx(1.5, abs=0.03)
    assert np.allclose(way.find_line(1.0), [(1.0, 2.0 - way.half_width), (1.0, 2.0 + way.half_width)])


def test_wrong_options_are_refused():
    for make, values in (
        (RampSearch, {"length": 0.0}),
        (RampSearch, {"min_slope": 1.0}),
        (StepSearch, {"rise": -1.0}),
        (StepSearch, {"num_steps": 0}),
        (WaySearch, {"lane": 0.0}),
    ):
        with pytest.raises(OptionError, match=next(iter(values))):
            make(**values)
