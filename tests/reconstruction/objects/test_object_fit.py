"""Fitting and verifying poses, symmetries, and the planes that are set aside."""

import numpy as np
import pytest
import trimesh

from benchmarks.material.known_objects import make_box, make_socket, make_station
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.pose import rotate_about
from reconstruction._src.objects.finding import MIN_SCORE, align
from reconstruction._src.objects.model import choose_equivalent, compute_angle, compute_symmetries, make_model
from reconstruction._src.objects.regions import find_background, find_planes, measure_noise
from reconstruction._src.objects.verification import (
    Beams,
    cast,
    make_beams,
    verify_by_beams,
    verify_by_distance,
)
from reconstruction._src.scans.cloud import Cloud

NOISE, TOLERANCE = 0.003, 0.009


def turn(axis, degrees):
    return rotate_about(np.asarray(axis, float) / np.linalg.norm(axis), np.radians([degrees]))[0]


@pytest.fixture(scope="module")
def socket():
    return make_model("socket", make_socket())


@pytest.fixture(scope="module")
def beams(socket):
    """Beams from two places at a socket at the origin and at the wall that it hangs on."""
    rng = np.random.default_rng(0)
    places = np.array([[1.2, 0.5, 0.3], [1.0, -0.6, -0.2]])
    origins = np.repeat(places, 1200, axis=0)
    targets = np.column_stack([np.full(2400, 0.04), rng.uniform(-0.15, 0.15, (2400, 2))])
    directions = targets - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = Beams(np.arange(2400), origins, directions, np.ones(2400))
    hit, _ = cast(socket, np.eye(4), rays)
    wall = -origins[:, 0] / directions[:, 0]
    ranges = np.minimum(hit, wall) + rng.normal(0, NOISE, 2400)
    return rays._replace(ranges=ranges), ~np.isfinite(hit)


def test_a_fit_ends_at_the_true_pose(socket, beams):
    rays, is_wall = beams
    points = (rays.origins + rays.directions * rays.ranges[:, None])[~is_wall]
    toward = -rays.directions[~is_wall]
    start = np.eye(4)
    start[:3, :3] = turn([1.0, 2.0, 0.5], 12.0)
    start[:3, 3] = 0.012, -0.008, 0.01
    poses, worth = align(socket, start[None], points, toward, NOISE)
    assert np.linalg.norm(poses[0][:3, 3]) < 0.012
    assert compute_angle(poses[0][:3, :3], np.eye(3)) < np.deg2rad(6.0)
    assert worth[0] > 0.4 * len(points)


def test_beams_speak_for_the_true_pose_and_against_others(socket, beams):
    rays, is_wall = beams

    def ask(pose):
        return verify_by_beams(socket, pose, rays, is_wall, TOLERANCE)

    right = ask(np.eye(4))
    assert right.score > 0.98
    assert right.coverage > 0.98
    for shift in ((0.05, 0, 0), (-0.05, 0, 0), (0, 0.04, 0)):
        pose = np.eye(4)
        pose[:3, 3] = shift
        assert ask(pose).score < MIN_SCORE
    upside_down = np.eye(4)
    upside_down[:3, :3] = np.diag([1.0, -1.0, -1.0])
    assert ask(upside_down).score < MIN_SCORE


def test_free_space_rules_an_object_out(socket, beams):
    rays, _ = beams
    through = rays._replace(ranges=rays.ranges + 0.5)
    assert verify_by_beams(socket, np.eye(4), through, np.ones(2400, bool), TOLERANCE).score < 0.2


def test_what_hides_an_object_lowers_its_coverage_alone(socket, beams):
    rays, is_wall = beams
    hidden = rays.ranges.copy()
    hidden[:1200] = 0.3
    found = verify_by_beams(socket, np.eye(4), rays._replace(ranges=hidden), is_wall, TOLERANCE)
    assert found.score > 0.98
    assert 0.3 < found.coverage < 0.7


def test_without_viewpoints_distances_decide(socket):
    points = socket.points[socket.points[:, 0] > 0.01]
    wall = np.zeros(len(points), bool)
    right = verify_by_distance(socket, np.eye(4), points, wall, TOLERANCE, 0.008)
    assert right.score > 0.99
    moved = np.eye(4)
    moved[0, 3] = 0.03
    assert verify_by_distance(socket, moved, points, wall, TOLERANCE, 0.008).score < 0.9


def test_walls_are_found_and_their_noise_is_measured():
    rng = np.random.default_rng(3)
    wall = np.column_stack([rng.normal(0, 0.004, 60_000), rng.uniform(-1, 1, (60_000, 2))])
    thing = rng.uniform(-0.05, 0.05, (500, 3)) + np.array([0.3, 0, 0])
    cloud = Cloud(np.concatenate([wall, thing]))
    planes = find_planes(cloud.points, 0.1, np.random.default_rng(0))
    assert len(planes) == 1
    assert abs(planes[0].normal[0]) == pytest.approx(1.0, abs=1e-3)
    assert measure_noise(cloud, planes) == pytest.approx(0.004, rel=0.1)
    background = find_background(cloud.points, planes, 0.016)
    assert background[:60_000].mean() > 0.99
    assert not background[60_000:].any()


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (trimesh.Trimesh(), "no faces"),
        (trimesh.creation.box((65.0, 65.0, 45.0)), "is the mesh in meters"),
        (trimesh.creation.box((0.005, 0.005, 0.005)), "is 0.005 m long"),
    ],
)
def test_meshes_that_are_no_objects_are_refused(mesh, words):
    with pytest.raises(ReconstructionError, match=words):
        make_model("thing", mesh)


def test_a_beam_meets_the_nearest_side():
    cube, pose = make_model("cube", trimesh.creation.box((0.2, 0.2, 0.2))), np.eye(4)
    pose[:3, 3] = 1.0, 0.02, 0.03
    ways = np.array([(1.0, 0, 0), (0, 1, 0), (-1, 0, 0)])
    ranges, cosine = cast(cube, pose, Beams(np.arange(3), np.zeros((3, 3)), ways, np.ones(3)))
    np.testing.assert_allclose(ranges, [0.9, np.inf, np.inf])
    assert cosine[0] == pytest.approx(1.0)


def test_the_beams_that_pass_a_ball():
    rng = np.random.default_rng(1)
    seen_from = rng.integers(0, 2, 500)
    cloud = Cloud(rng.uniform(-1, 3, (500, 3)), viewpoints=[[0.0, 0, 1], [2.0, 0, 1]], seen_from=seen_from)
    center, radius = np.array([1.0, 1.0, 1.0]), 0.3
    beams = make_beams(cloud)
    found = beams.select_near(center, radius)
    steps = np.linspace(0, 6, 600)[:, None, None]
    nearest = np.linalg.norm(beams.origins + steps * beams.directions - center, axis=2).min(axis=0)
    assert (nearest[found.rows] <= radius + 0.01).all()
    assert {*np.flatnonzero((nearest < radius - 0.01) & (beams.ranges > 1.0))} <= {*found.rows}
    np.testing.assert_allclose(
        found.origins + found.directions * found.ranges[:, None], cloud.points[found.rows]
    )
    assert len(beams.select_near(center, radius, most=5).rows) <= 5
    assert make_beams(Cloud(cloud.points)) is None


@pytest.mark.parametrize(
    ("mesh", "count"),
    [
        (make_socket(), 1),
        (make_station(), 1),
        (make_box(), 4),
        (trimesh.creation.box((0.2, 0.2, 0.2)), 24),
        (trimesh.creation.cylinder(0.1, 0.3, sections=64), 72),
    ],
)
def test_the_group_has_as_many_rotations_as_the_shape(mesh, count):
    found = compute_symmetries(mesh, mesh.triangles_center.T @ mesh.area_faces / mesh.area)
    assert len(found) == count
    np.testing.assert_allclose(found[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found @ found.transpose(0, 2, 1), np.tile(np.eye(3), (count, 1, 1)), atol=1e-9)


def test_symmetries_are_left_out_of_account():
    half, turned = np.array([np.eye(3), turn([0, 0, 1], 180.0)]), turn([0, 0, 1], 170.0)
    assert compute_angle(turned, np.eye(3)) == pytest.approx(np.deg2rad(170.0))
    assert compute_angle(turned, np.eye(3), half) == pytest.approx(np.deg2rad(10.0))
    np.testing.assert_allclose(choose_equivalent(turned, half), turn([0, 0, 1], -10.0), atol=1e-12)
