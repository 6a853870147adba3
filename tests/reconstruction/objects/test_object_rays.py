"""Beams at an object: distances known by hand, and those that pass a place."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.objects.model import make_model
from reconstruction._src.objects.verification import BeamIndex, Beams, cast
from reconstruction._src.scans.cloud import Cloud


@pytest.fixture(scope="module")
def cube():
    return make_model("cube", trimesh.creation.box((0.2, 0.2, 0.2)))


def make_beams(origin, directions):
    directions = np.asarray(directions, float)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    count = len(directions)
    return Beams(np.arange(count), np.tile(np.asarray(origin, float), (count, 1)), directions, np.ones(count))


def test_a_beam_meets_the_nearest_side(cube):
    pose = np.eye(4)
    pose[:3, 3] = 1.0, 0.02, 0.03
    ranges, cosine = cast(cube, pose, make_beams((0, 0, 0), [(1, 0, 0), (0, 1, 0), (-1, 0, 0)]))
    np.testing.assert_allclose(ranges, [0.9, np.inf, np.inf])
    assert cosine[0] == pytest.approx(1.0)


def test_rays_are_those_of_another_library(cube):
    embree = pytest.importorskip("trimesh.ray.ray_pyembree")
    rng = np.random.default_rng(0)
    beams = make_beams((0.5, 0.2, 0.3), rng.normal(0, 0.08, (400, 3)) - (0.5, 0.2, 0.3))
    mine, _ = cast(cube, np.eye(4), beams)
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    places, rows, _ = embree.RayMeshIntersector(box).intersects_location(
        beams.origins, beams.directions, multiple_hits=False
    )
    theirs = np.full(400, np.inf)
    theirs[rows] = np.linalg.norm(places - beams.origins[rows], axis=1)
    np.testing.assert_allclose(mine, theirs, atol=1e-6)


def test_the_index_finds_the_beams_that_pass_a_ball():
    rng = np.random.default_rng(1)
    viewpoints = np.array([[0.0, 0, 1], [2.0, 0, 1]])
    seen_from = rng.integers(0, 2, 500)
    cloud = Cloud(rng.uniform(-1, 3, (500, 3)), viewpoints=viewpoints, seen_from=seen_from)
    center, radius = np.array([1.0, 1.0, 1.0]), 0.3
    found = BeamIndex(cloud).find(center, radius)
    offset = center - cloud.origins
    ray = cloud.points - cloud.origins
    length = np.linalg.norm(ray, axis=1)
    along = (offset * ray).sum(axis=1) / length
    passes = (np.sqrt(np.maximum((offset**2).sum(axis=1) - along**2, 0)) <= radius) & (along > 0)
    distance = np.linalg.norm(offset, axis=1)
    passes &= length > 0.5 * (distance - radius)
    assert sorted(found.rows) == np.flatnonzero(passes).tolist()
    np.testing.assert_allclose(
        found.origins + found.directions * found.ranges[:, None], cloud.points[found.rows]
    )
