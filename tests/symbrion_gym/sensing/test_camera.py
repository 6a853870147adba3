"""The camera of the survey."""

import numpy as np
import pytest

import reconstruction as rc
import symbrion_gym as sg
from symbrion_gym._src.errors import ArenaError, SurveyError
from symbrion_gym._src.sensing.survey_robot import round_to_pixels

PATH = [[-3.5, 1.4], [-1.0, 1.4]]


@pytest.fixture(scope="module")
def truth():
    return sg.Arena.from_course(sg.Course(color_pattern="gradient"))


@pytest.fixture(scope="module")
def log(truth):
    return sg.survey(truth, path=PATH, camera=True)


@pytest.mark.slow
def test_colors_are_those_of_the_truth_within_the_stated_noise(log, truth):
    ends = log.grid()
    inside = log.is_valid & (np.abs(ends[..., 1]) < 0.9) & (np.abs(ends[..., 0]) < 3.0)
    error = log.colors[inside] / 255 - truth.find_colors(ends[inside])
    assert inside.sum() > 1000
    assert np.sqrt((error**2).mean()) < 0.035  # noise 0.02, exposure 0.02 of up to 0.85, places 1 cm


@pytest.mark.slow
def test_ranges_are_those_of_a_survey_without_a_camera(log):
    plain = sg.survey(sg.Arena.from_course(sg.Course()), path=PATH)
    assert np.array_equal(plain.ranges, log.ranges, equal_nan=True)
    assert plain.colors is None


@pytest.mark.slow
def test_a_course_is_surveyed_like_its_arena(log, truth):
    again = sg.survey(truth.course, path=PATH, camera=True)
    np.testing.assert_array_equal(again.colors, log.colors)
    np.testing.assert_array_equal(again.ranges, log.ranges)


@pytest.mark.slow
def test_colors_survive_the_file_and_preprocessing(log, tmp_path):
    read = rc.load_scan_log(log.save(tmp_path / "log.npz"))
    assert np.array_equal(read.colors, log.colors)
    assert rc.load_cloud(tmp_path / "log.npz").colors is not None
    cloud = rc.preprocess(log)
    assert isinstance(cloud, rc.Cloud)
    assert np.array_equal(cloud.points, rc.preprocess(log.replace(colors=None)))
    assert rc.preprocess_cloud(log).colors is not None
    thin = rc.thin(cloud, 0.05)
    assert np.array_equal(thin.points, rc.thin(cloud.points, 0.05))


def test_a_pixel_looks_where_its_middle_is():
    ways = np.array([[1.0, 0, 0], [1, np.tan(0.104), 0], [0, 0, 2], [-1, 0, 0]])
    found = round_to_pixels(ways, 0.1)
    expected = [[1, 0, 0], [np.cos(0.1), np.sin(0.1), 0], [np.cos(1.6), 0, np.sin(1.6)]]
    assert found[:3] == pytest.approx(np.array(expected))
    assert np.linalg.norm(found, axis=1) == pytest.approx(1.0)


def test_an_arena_without_colors_is_refused():
    arena = sg.Arena.from_course(sg.Course())
    with pytest.raises(SurveyError, match="no colors"):
        sg.survey(arena, path=PATH, camera=True)
    with pytest.raises(SurveyError, match="no colors"):
        sg.survey(arena.surface, path=PATH, camera=True)


@pytest.mark.parametrize("pattern", ["checker", "gradient"])
def test_patterns_are_colors_of_a_course(pattern):
    for course in (sg.Course(color_pattern=pattern), sg.StairsCourse(color_pattern=pattern)):
        arena = sg.Arena.from_course(course)
        colors = arena.find_colors(np.asarray(arena.surface.triangles_center))
        assert ((colors >= 0) & (colors <= 1)).all()
        assert np.ptp(colors, axis=0).max() > 0.1
        assert type(course)(**{k: v for k, v in course.as_dict().items() if k != "kind"}) == course


def test_a_course_without_a_pattern_says_nothing_of_one():
    assert "color_pattern" not in sg.Course().as_dict()
    with pytest.raises(ArenaError, match="checker, gradient"):
        sg.Course(color_pattern="tartan")
