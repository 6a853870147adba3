"""Robots that feel the ground of a course: lanes, readings, what they find, refusals."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.knowledge.slip.drags import find_friction
from reconstruction._src.knowledge.slip.patches import estimate_friction_patches
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import choose_friction
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.friction_drive import drive_lanes, find_lanes
from symbrion_gym._src.sensing.survey import survey

SMALL = Course(pit=0.3, floor=0.9, plateau=0.45, ramp=0.6, height=0.1, width=0.5, friction=0.6)
ICED = Course(**{**vars(SMALL), "friction_patches": ((-1.9, -1.4, 0.3),)})


def test_lanes_end_before_the_pit_and_run_both_ways() -> None:
    lanes = find_lanes(Arena.from_course(SMALL))
    assert len(lanes) == 4
    assert {lane.start[1] for lane in lanes} == {0.0}
    assert max(lane.end[0] for lane in lanes if lane.end[0] < 0) == pytest.approx(-0.3, abs=0.02)
    assert sorted(lane.start[0] for lane in lanes) == sorted(lane.end[0] for lane in lanes)


@pytest.mark.slow
def test_a_patch_and_the_ground_are_felt() -> None:
    readings = drive_lanes(Arena.from_course(ICED), np.random.default_rng(0))
    again = drive_lanes(Arena.from_course(ICED), np.random.default_rng(0))
    assert (readings.forces == again.forces).all(), "equal seeds give equal readings"
    felt = estimate_friction_patches(find_friction(readings))
    ground = choose_friction(None, None, None, felt)
    assert ground.source == "estimated"
    assert ground.friction == pytest.approx(0.6, abs=0.05)
    (patch,) = ground.friction_map.patches
    assert patch.friction == pytest.approx(0.3, abs=0.05)
    assert abs(patch.friction - 0.3) <= patch.half_width
    xs = [x for outline in patch.outlines for x, _ in outline]
    assert min(xs) < -1.7
    assert max(xs) == pytest.approx(-1.4, abs=0.15), "next to the foot of the ramp, where it bends"


def test_what_is_given_goes_before_what_was_felt() -> None:
    assert choose_friction(0.5, None, None, None)[:2] == (0.5, "given")
    assert choose_friction(None, None, ICED, None) == (0.6, "exact", ICED.friction_map)
    assert choose_friction(None, None, None, None)[:2] == (0.7, "assumed")


def test_a_mesh_has_no_friction_to_feel() -> None:
    with pytest.raises(SurveyError, match="a mesh has none"):
        survey(trimesh.creation.box(), friction=True)
