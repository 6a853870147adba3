"""A place that has changed, the round of a Scout in it, and its readings as points."""

import json

import numpy as np
import pytest

import evolution as ev
import symbrion_gym as sg
from evolution._src.experiments.live.drive import DriveConfig, Readings, Stop, apply_error, drive_round
from evolution._src.experiments.live.live import LiveConfig, claim_folder, measure_errors
from evolution._src.experiments.live.matching import MatchConfig, find_points
from evolution._src.experiments.live.route import plan_round
from evolution._src.experiments.live.scene import Box, SceneConfig, find_regions, make_truth
from reconstruction._src.surfaces.quality import find_distances
from symbrion_gym._src.contact.local_changes import measure_gaps, sample_faces
from symbrion_gym._src.robot.scout_rays import find_scout_rays


def measure_distance(arena: sg.Arena, points: np.ndarray) -> np.ndarray:
    return find_distances(points, np.asarray(arena.surface.vertices), np.asarray(arena.surface.faces))


def test_the_truth_has_the_boxes_and_the_wall_where_they_are():
    scene = SceneConfig()
    before, now = (make_truth(scene, is_changed=changed) for changed in (False, True))
    assert before.height(-2.8, -0.5) == pytest.approx(0.15)
    assert now.height(-2.8, -0.5) == pytest.approx(0.0)
    assert now.height(-1.9, 0.4) == pytest.approx(0.1)
    assert before.height(0.25, 0.0) == pytest.approx(0.25)
    assert now.height(0.25, 0.0) == pytest.approx(0.0)
    assert [region.name for region in find_regions(scene)] == ["box added", "box gone", "wall moved"]
    for arena in (before, now):
        # Contact ends where the surface is.
        places = sample_faces(arena.surface, np.arange(len(arena.surface.faces)))
        assert measure_gaps(*places, arena.pieces).max() < 1e-6


def test_nothing_has_changed_in_a_scene_without_changes():
    scene = SceneConfig(widening=0.0, old_box=None, new_box=None)
    assert find_regions(scene) == []
    before, now = (make_truth(scene, is_changed=changed) for changed in (False, True))
    np.testing.assert_array_equal(before.surface.vertices, now.surface.vertices)


def test_impossible_scenes_are_refused():
    with pytest.raises(ev.RunError, match="plateau"):
        SceneConfig(widening=0.6)
    with pytest.raises(ev.RunError, match="first floor"):
        SceneConfig(new_box=Box((0.0, 0.2), (0.0, 0.2), 0.1))
    with pytest.raises(ev.RunError, match="no volume"):
        Box((0.0, 0.0), (0.0, 0.2), 0.1)
    for config in (DriveConfig, MatchConfig):
        with pytest.raises(ev.RunError, match="above 0"):
            config(**{"ticks" if config is DriveConfig else "cell": 0})


@pytest.fixture(scope="module")
def driven() -> tuple[sg.Arena, Readings]:
    arena = make_truth(SceneConfig(), is_changed=True)
    return arena, drive_round(arena, [Stop(-2.4, 0.1, 1.5), Stop(-2.2, 0.1, 0.5)], DriveConfig(), seed=3)


def test_readings_lie_on_the_truth_by_the_true_poses(driven):
    arena, readings = driven
    exact = readings._replace(poses=readings.true_poses)
    found = find_points(exact, arena.surface)
    distance = measure_distance(arena, found.points)
    assert distance.mean() < 0.004
    assert found.told_error == 0.0
    assert np.linalg.norm(readings.true_poses[-1, :2, 3] - [-2.2, 0.1]) < 0.08


def test_matching_brings_readings_nearer_to_the_surface(driven):
    arena, readings = driven
    told = find_points(readings, arena.surface, MatchConfig(gate=1e-9))
    matched = find_points(readings, arena.surface)
    errors = [measure_distance(arena, each.points).mean() for each in (told, matched)]
    assert errors[1] < 0.8 * errors[0]


def test_equal_seeds_read_the_same(driven):
    arena, readings = driven
    again = drive_round(arena, [Stop(-2.4, 0.1, 1.5), Stop(-2.2, 0.1, 0.5)], DriveConfig(), seed=3)
    np.testing.assert_array_equal(again.ranges, readings.ranges)
    np.testing.assert_array_equal(again.poses, readings.poses)
    other = drive_round(arena, [Stop(-2.4, 0.1, 0.2)], DriveConfig(), seed=4)
    assert not np.array_equal(other.poses[0], readings.poses[0])


def test_a_drive_that_ends_before_its_first_place_is_refused(driven):
    with pytest.raises(ev.RunError, match="could not finish"):
        drive_round(driven[0], [Stop(-2.4, 0.1, 1.5)], DriveConfig(duration=0.5))


def test_beams_that_meet_nothing_go_through_nothing(driven):
    arena, readings = driven
    exact = readings._replace(poses=readings.true_poses)
    free = find_points(exact, arena.surface, MatchConfig(gate=1e-9)).free_rays
    assert len(free) > 100
    np.testing.assert_allclose(np.linalg.norm(free[:, 1] - free[:, 0], axis=1), MatchConfig().farthest)
    # They begin in front of the Scout, above the floor, and stay above it.
    assert free[:, :, 2].min() > 0.0


def test_a_stop_faces_what_it_is_to_look_at():
    arena = make_truth(SceneConfig(), is_changed=True)
    readings = drive_round(arena, [Stop(-2.4, 0.1, 0.1, (-3.0, 0.1))], DriveConfig(), seed=3)
    yaw = np.arctan2(readings.true_poses[:, 1, 0], readings.true_poses[:, 0, 0])
    assert abs(yaw[0]) < 0.3
    assert np.abs(yaw).max() > np.pi - 0.3


def test_readings_of_nothing_are_refused(driven):
    arena, readings = driven
    with pytest.raises(ev.RunError, match="nothing"):
        find_points(readings._replace(ranges=np.full_like(readings.ranges, np.nan)), arena.surface)


def test_an_error_turns_and_moves_a_pose():
    moved = apply_error(np.eye(4), np.array([0.1, 0.0, 0.0, np.pi / 2, 0.0, 0.0]))
    np.testing.assert_allclose(moved[:3, 3], [0.1, 0.0, 0.0])
    np.testing.assert_allclose(moved[:3, 0], [0.0, 1.0, 0.0], atol=1e-12)


def test_the_error_of_a_model_is_that_of_the_change_it_misses():
    scene = SceneConfig(old_box=None)
    before, now = (make_truth(scene, is_changed=changed) for changed in (False, True))
    errors = measure_errors(scene, now.surface, [before.surface, now.surface])
    assert set(errors) == {"box added", "wall moved", "elsewhere"}
    assert max(errors.pop("elsewhere")) < 1e-9
    for missed, known in errors.values():
        assert missed > 0.01
        assert known < 1e-9


def test_the_round_stays_on_the_course():
    scene = SceneConfig()
    for x, y, *_ in plan_round(scene):
        assert abs(y) < scene.course.width / 2 - 0.1
        assert -scene.course.length / 2 < x < scene.course.pit_edges[0]
    assert len(find_scout_rays().origins) == 27


def test_a_folder_of_others_or_of_other_options_is_refused(tmp_path):
    claim_folder(LiveConfig(tmp_path / "a"))
    claim_folder(LiveConfig(tmp_path / "a", workers=2))
    with pytest.raises(ev.RunError, match="other options"):
        claim_folder(LiveConfig(tmp_path / "a", seed=1))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "results.json").write_text("mine")
    with pytest.raises(ev.RunError, match="overwritten"):
        claim_folder(LiveConfig(tmp_path / "b"))
    (tmp_path / "a" / "live.json").write_text("{")
    with pytest.raises(ev.RunError, match="damaged"):
        claim_folder(LiveConfig(tmp_path / "a"))
    assert json.dumps(LiveConfig(tmp_path).describe())
