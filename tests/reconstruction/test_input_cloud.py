"""What `reconstruct` takes and keeps: clouds, viewpoints, colors, coordinates far from the origin."""

import numpy as np
import pytest
import trimesh
from test_reconstruct import make_ground

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.sampling import count_votes
from reconstruction._src.input_cloud import (
    check_free_rays,
    check_origins,
    check_scale,
    join_clouds,
    make_cloud,
    make_cloud_of_rays,
)
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces.quality import compute_distances

UTM = np.array([365_000.0, 5_800_000.0, 40.0])
ABOVE = np.array([0.0, 0.0, 2.0])


def make_room(number: int = 6000, seed: int = 0) -> np.ndarray:
    """Return points on the walls, floor and ceiling of a room of 4 m x 3 m x 2.5 m."""
    rng = np.random.default_rng(seed)
    size = np.array([4.0, 3.0, 2.5])
    points = rng.uniform(-0.5, 0.5, (number, 3))
    axis = rng.choice(3, number, p=np.array([7.5, 10.0, 12.0]) / 29.5)
    points[np.arange(number), axis] = np.where(rng.random(number) < 0.5, -0.5, 0.5)
    return points * size


@pytest.mark.slow
def test_a_room_looks_inwards_with_a_viewpoint_and_outwards_without():
    points = make_room()
    inwards = reconstruct(points, units=300, viewpoints=[0.3, 0.2, 0.1])
    votes, weights = count_votes(inwards.mesh.vertices, inwards.mesh.faces, points, inwards.viewpoints)
    assert (votes > 0.2 * weights).mean() > 0.97
    assert inwards.mesh.volume < 0
    assert "looks to where it was seen from" in inwards.notes["orientation"]
    outwards = reconstruct(points, units=300)
    assert outwards.mesh.volume > 0
    assert "closed ones and rooms outwards" in outwards.notes["orientation"]
    assert "no viewpoint" in outwards.notes["orientation"]


@pytest.mark.slow
def test_coordinates_far_away_are_recentered_and_come_back():
    points = make_ground()
    near = reconstruct(points, units=150, viewpoints=[0, 0, 2])
    far = reconstruct(points + UTM, units=150, viewpoints=UTM + ABOVE)
    assert not near.offset.any()
    assert (far.offset == np.round(far.offset)).all()
    assert "were subtracted" in far.notes["offset"]
    moved = far.mesh.vertices + far.offset - UTM
    np.testing.assert_allclose(far.points + far.offset, points + UTM, atol=1e-8)
    np.testing.assert_allclose(far.viewpoints + far.offset, [UTM + ABOVE])
    assert compute_distances(moved, near.mesh.vertices, near.mesh.faces).max() < 0.1
    truth = trimesh.Trimesh(moved + UTM, far.mesh.faces, process=False)
    assert far.quality(truth=truth).truth_to_mesh.max < 1e-6
    again = far.refine(points[:500] + UTM + [0, 0, 0.3])
    np.testing.assert_array_equal(again.offset, far.offset)
    assert np.abs(again.points).max() < 10
    with pytest.raises(ReconstructionError, match="frame of the first scan"):
        far.refine(points[:500])


def test_a_cloud_brings_its_fields_and_they_survive_saving(tmp_path):
    points = make_ground()
    colors = np.full((len(points), 3), 7, np.uint8)
    viewpoints = np.array([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]])
    seen_from = (points[:, 0] > 0).astype(np.int64)
    cloud = Cloud(points, colors, viewpoints, seen_from, offset=np.array([10.0, 20.0, 0.0]))
    result = reconstruct(cloud, units=150, readings=np.concatenate([points, points[:9]]) + cloud.offset)
    result.save(tmp_path / "a.npz")
    loaded = Reconstruction.load(tmp_path / "a.npz")
    for each in (result, loaded):
        np.testing.assert_array_equal(each.colors, colors)
        np.testing.assert_array_equal(each.viewpoints, viewpoints)
        np.testing.assert_array_equal(each.seen_from, seen_from)
        np.testing.assert_array_equal(each.offset, [10, 20, 0])
        np.testing.assert_allclose(each.readings.points[: len(points)], points, atol=1e-12)
        assert each.readings.num_points == len(points) + 9
    assert loaded.notes == result.notes
    np.testing.assert_array_equal(loaded.mesh.faces, result.mesh.faces)


def test_refining_keeps_the_viewpoint_of_every_point():
    points = make_ground()
    cloud = Cloud(points, viewpoints=np.array([[0.0, 0.0, 2.0]]))
    new = make_ground(500, seed=3) + 0.05 * ABOVE
    result = reconstruct(cloud, units=150).refine(new, origins=np.array([0.0, 0.0, 3.0]))
    assert result.seen_from is not None
    np.testing.assert_array_equal(result.viewpoints[result.seen_from[-500:]], np.tile([0.0, 0, 3], (500, 1)))
    assert (result.seen_from[:-500] == 0).all()


def test_joined_clouds_keep_what_both_know():
    first = Cloud(make_ground(5), np.zeros((5, 3), np.uint8), np.zeros((1, 3)))
    rays = make_cloud_of_rays(make_ground(4), np.tile([1.0, 2, 3], (4, 1)), np.zeros(3))
    joined = join_clouds(first, rays)
    np.testing.assert_array_equal(joined.seen_from, [0] * 5 + [1] * 4)
    assert joined.colors is None
    assert join_clouds(first, first).colors.shape == (10, 3)
    bare = make_cloud_of_rays(make_ground(4), None, np.zeros(3))
    assert join_clouds(bare, bare).viewpoints is None


def test_viewpoints_of_new_readings_are_not_those_of_old_ones():
    bare, rays = (
        make_cloud_of_rays(make_ground(4), None, np.zeros(3)),
        Cloud(make_ground(5), viewpoints=np.ones((1, 3))),
    )
    for joined in (join_clouds(bare, rays), join_clouds(rays, bare)):
        assert joined.viewpoints is None
        assert joined.seen_from is None
    nothing = bare.replace(points=np.zeros((0, 3)))
    assert join_clouds(nothing, rays).viewpoints is not None


@pytest.mark.slow
def test_a_surface_seen_by_nobody_known_looks_up_after_readings_from_below():
    ground = make_ground()
    result = reconstruct(ground, units=150)
    new = ground[np.abs(ground[:, :2]).max(axis=1) < 0.3] + 0.05 * ABOVE / np.linalg.norm(ABOVE)
    refined = result.refine(new, origins=np.array([0.0, 0.0, -3.0]))
    assert refined.mesh.face_normals[:, 2].mean() > 0.9


@pytest.mark.parametrize(
    ("shift", "extent", "is_moved"),
    [(900.0, 1.0, False), (1001.0, 1.0, True), (1500.0, 3000.0, False), (1500.0, 1000.0, True)],
)
def test_only_what_is_far_is_recentered(shift, extent, is_moved):
    points = make_ground()
    points = (points - points.mean(axis=0)) / np.ptp(points[:, 0]) * extent + [shift, 0, 0]
    assert make_cloud(points).offset.any() == is_moved


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"viewpoints": [[0, 0]]}, "viewpoints must be"),
        ({"viewpoints": "here"}, "viewpoints must be"),
        ({"viewpoints": np.zeros((0, 3))}, "viewpoints must be"),
        ({"viewpoints": [0, 0, np.nan]}, "viewpoints must be"),
        ({"seen_from": np.zeros(1000, int)}, "needs viewpoints"),
        ({"viewpoints": [0, 0, 1], "seen_from": np.ones(1000, int)}, "1 viewpoint"),
        ({"colors": np.zeros((3, 3))}, "colors must be"),
    ],
)
def test_fields_that_fit_no_points_are_refused(arguments, message):
    with pytest.raises(ReconstructionError, match=message):
        reconstruct(make_ground(1000), units=30, **arguments)


def test_origins_and_free_rays_that_are_none_are_refused():
    assert check_origins([1, 2, 3], 5).shape == (5, 3)
    assert check_free_rays(np.zeros((4, 2, 3))).shape == (4, 2, 3)
    for wrong, reason in (
        (np.zeros((4, 3)), r"\[5, 3\]"),
        ([0.0, np.nan, 0.0], "NaN"),
        (["a"], "real numbers"),
    ):
        with pytest.raises(ReconstructionError, match=f"origins must .*{reason}"):
            check_origins(wrong, 5)
    for wrong, reason in ((np.zeros((4, 3)), r"\[K, 2, 3\]"), (np.full((1, 2, 3), np.inf), "finite")):
        with pytest.raises(ReconstructionError, match=reason):
            check_free_rays(wrong)


def test_another_unit_is_noticed():
    points = np.random.default_rng(2).uniform(-1, 1, (100, 3))
    check_scale(points + np.array([3, 0, 0]), points)
    with pytest.raises(ReconstructionError, match="in meters"):
        check_scale(1000 * points, points)
