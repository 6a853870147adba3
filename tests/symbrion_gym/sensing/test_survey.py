"""The virtual survey: its path, its errors, what comes home."""

import bz2

import igl
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from reconstruction._src.geometry.pose import to_planar
from reconstruction._src.scans.leveling import level_floor
from reconstruction._src.scans.preprocess import preprocess, remove_mixed_pixels
from reconstruction._src.scans.scan import load_scan_log
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.sensing.survey import SurveyRobot, make_path, survey
from symbrion_gym._src.sensing.survey_robot import LaserScanner

SURFACE = Course(pit=0.40).surface()
QUICK = SurveyRobot(speed=0.5, scan_rate=8.0, rest=2.0)
PATH = [[-1.0, 1.6], [0.2, 2.8], [1.4, 1.6]]


def compute_distances(points: np.ndarray) -> np.ndarray:
    squared = igl.point_mesh_squared_distance(points, np.asarray(SURFACE.vertices), np.asarray(SURFACE.faces))
    return np.sqrt(squared[0])


@pytest.fixture(scope="module")
def log():
    return survey(SURFACE, path=PATH, sensor=QUICK, seed=0)


def test_the_log_is_whole(log, tmp_path):
    num_scans, num_beams = log.ranges.shape
    assert num_beams == 361
    assert log.horizontal.ranges.shape == (num_scans, 361)
    assert log.truth.is_mixed.shape == log.ranges.shape
    assert not (log.truth.is_mixed & ~log.is_valid).any()
    assert np.nanmax(log.ranges) <= 8.19
    np.testing.assert_allclose(np.round(log.ranges[log.is_valid] * 1000) / 1000, log.ranges[log.is_valid])
    assert load_scan_log(log.save(tmp_path / "a.npz")).report == log.report


@pytest.mark.slow
def test_equal_seeds_give_equal_logs_and_others_do_not(log):
    again = survey(SURFACE, path=PATH, sensor=QUICK, seed=0)
    other = survey(SURFACE, path=PATH, sensor=QUICK, seed=1)
    np.testing.assert_array_equal(log.ranges, again.ranges)
    np.testing.assert_array_equal(log.poses, again.poses)
    assert not np.array_equal(log.ranges, other.ranges, equal_nan=True)


def test_the_robot_is_localised(log):
    assert log.report["localization_max"] < 0.015
    assert log.report["localization_max_deg"] < 0.5
    robot = log.poses @ np.linalg.inv(log.mount)
    wheels = np.hypot(*(log.horizontal.odometry - to_planar(log.truth.robot_poses))[:, :2].T)
    found = np.hypot(*(to_planar(robot) - to_planar(log.truth.robot_poses))[:, :2].T)
    assert np.median(found) < np.median(wheels)


def test_levelling_finds_the_shaking(log):
    robot = level_floor(log).poses @ np.linalg.inv(log.mount)
    rest = np.linalg.inv(log.truth.robot_poses) @ robot
    roll = np.degrees(np.abs(np.arctan2(rest[:, 2, 1], rest[:, 1, 1])))
    before = np.degrees(np.arctan2(log.truth.robot_poses[:, 2, 1], log.truth.robot_poses[:, 2, 2]))
    assert np.std(before) > 0.4
    assert roll.max() < 0.1


def test_the_points_lie_on_the_surface(log):
    points = preprocess(log)
    distances = compute_distances(points)
    assert len(points) > 2000
    assert np.median(distances) < 0.005
    assert np.mean(distances > 0.03) < 0.002


def test_mixed_pixels_are_labelled_and_go(log):
    kept = remove_mixed_pixels(log).is_valid
    mixed = log.truth.is_mixed
    assert mixed.sum() > 20
    assert (mixed & kept).sum() < 0.1 * mixed.sum()


def test_without_errors_the_readings_are_exact():
    scanner = LaserScanner(noise=0, noise_per_meter=0, resolution=0, spot=0, divergence=0)
    still = {"shake": 0, "distance_drift": 0, "turn_drift": 0, "step_noise": 0, "scan_rate": 4.0, "rest": 0.5}
    log = survey(SURFACE, path=PATH, sensor=SurveyRobot(scanner=scanner, **still), seed=0)
    exact = log.replace(poses=log.truth.robot_poses @ log.mount).points()
    inside = ((exact[:, :2] > log.box[0, :2]) & (exact[:, :2] < log.box[1, :2])).all(axis=1)
    faces = np.asarray(SURFACE.faces)
    squared = igl.point_mesh_squared_distance(exact[inside], np.asarray(SURFACE.vertices), faces)[0]
    assert squared.max() < 1e-10
    assert not log.truth.is_mixed.any()


@pytest.mark.slow
def test_the_default_path_sees_everything():
    log = survey(SURFACE, seed=0)
    rest = np.linalg.inv(log.truth.robot_poses) @ level_floor(log).poses @ np.linalg.inv(log.mount)
    assert np.std(np.degrees(np.arcsin(log.truth.robot_poses[:, 2, 0]))) > 0.65
    assert np.std(np.degrees(np.arcsin(rest[:, 2, 0]))) < 0.35
    assert log.report["localization_max"] < 0.01
    points = preprocess(log)
    truth = trimesh.sample.sample_surface(SURFACE, 5000, seed=0)[0]
    assert cKDTree(points).query(truth)[0].max() < 0.06
    assert np.mean(compute_distances(points) > 0.03) < 0.001


def test_the_default_path_keeps_off_the_arena_and_closes():
    path = make_path(np.array([[-3.3, -1, 0], [3.3, 1, 0.25]]))
    np.testing.assert_array_equal(path[0], path[-1])
    outside = (np.abs(path[:, 0]) >= 3.6 - 1e-9) | (np.abs(path[:, 1]) >= 1.3 - 1e-9)
    assert outside.all()
    yaw = np.degrees(np.arctan2(*np.diff(path, axis=0).T[::-1])) % 90
    np.testing.assert_allclose(yaw, 45, atol=10)


def test_any_mesh_is_surveyed(tmp_path):
    box = trimesh.creation.box((0.6, 0.4, 0.3))
    file = tmp_path / "box.ply"
    box.export(file)
    path = [[-0.8, 0.6], [0.0, 1.4]]
    points = preprocess(survey(file, path=path, sensor=QUICK))
    assert len(points) > 20
    assert (np.abs(points[:, :2]) < [0.31, 0.21]).all()


def test_a_mesh_in_millimeters_is_refused_with_the_remedy():
    with pytest.raises(ArenaError, match=r"4000 m large.*millimeter.*apply_scale"):
        survey(trimesh.creation.box((4000, 2000, 300)))


@pytest.mark.parametrize("arena", ["no such arena", "absent.ply", 7, trimesh.Trimesh()])
def test_what_is_no_arena_is_refused(arena):
    with pytest.raises(ArenaError):
        survey(arena)


@pytest.mark.parametrize(
    ("vertices", "words"),
    [
        (["0 0 0"] * 3, "0 m large"),
        (["0 0 0", "1 0 0", "2 0 0"], "MuJoCo refuses the mesh"),
        (["1e308 0 0", "-1e308 0 0", "0 1e308 0"], "not finite, or beyond"),
        (["1e30 0 0", "1 0 0", "0 1 0"], "not finite, or beyond"),
        (["nan 0 0", "1 0 0", "0 1 0"], "not finite"),
        ([], "is empty"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_mesh_files_that_are_no_place_are_refused(tmp_path, vertices, words):
    face = "f 1 2 3\n" if vertices else ""
    (tmp_path / "a.obj").write_text("".join(f"v {vertex}\n" for vertex in vertices) + face)
    with pytest.raises(ArenaError, match=rf"(?s)^[^\n]*{words}[^\n]*$"):
        survey(tmp_path / "a.obj")


def test_a_packed_mesh_that_grows_without_limit_is_refused(tmp_path):
    (tmp_path / "a.obj.bz2").write_bytes(bz2.compress(bytes(1000)))
    with pytest.raises(ArenaError, match=r"a\.obj\.bz2: a packed .obj file is not read; unpack it first"):
        survey(tmp_path / "a.obj.bz2")


@pytest.mark.parametrize("path", [[[0, 0]], [[0, 0, 0], [1, 1, 1]], [[0, 0], [np.nan, 1]], [[1, 1], [1, 1]]])
def test_paths_that_lead_nowhere_are_refused(path):
    with pytest.raises(ArenaError, match="path"):
        survey(SURFACE, path=path)


@pytest.mark.parametrize("change", [{"num_beams": 1}, {"max_range": 0}, {"noise": -1}, {"field_of_view": 7}])
def test_impossible_scanners_are_refused(change):
    with pytest.raises(ArenaError, match=next(iter(change))):
        LaserScanner(**change)


@pytest.mark.parametrize(
    "change", [{"speed": 0}, {"mast": -1}, {"shake": -1}, {"shake_memory": 1}, {"rest": np.nan}]
)
def test_impossible_robots_are_refused(change):
    with pytest.raises(ArenaError, match=next(iter(change))):
        SurveyRobot(**change)


def test_an_edge_gives_mixed_readings_between_its_surfaces():
    def cast(origin, directions):
        return np.where(directions[:, 1] > 0.001, 2.0, 3.0) / directions[:, 0]

    scanner = LaserScanner(num_beams=3, field_of_view=0.02, noise=0, noise_per_meter=0)
    rng = np.random.default_rng(0)
    scans = [scanner.scan(cast, np.eye(4), rng) for _ in range(200)]
    assert np.stack([is_mixed for _, is_mixed in scans]).tolist() == [[False, True, False]] * 200
    middle = np.array([ranges[1] for ranges, _ in scans])
    assert 2.0 <= middle.min() < 2.1 < 2.9 < middle.max() <= 3.0
