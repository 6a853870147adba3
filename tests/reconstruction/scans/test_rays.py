"""A scan log gives its points together with where they were read from, and refining takes it as it is."""

import numpy as np
import pytest

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import read_rays
from reconstruction._src.scans.scan import ScanLog

HEIGHT = 1.5


def make_log() -> ScanLog:
    """A scanner that looks straight down moves 2 m along x, 1.5 m above level ground."""
    angles = np.linspace(-0.6, 0.6, 81)
    poses = np.tile(np.eye(4), (81, 1, 1))
    # The beam's axis points down, its sideways axis along y.
    poses[:, :3, :3] = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    poses[:, 0, 3] = np.linspace(-1, 1, 81)
    poses[:, 2, 3] = HEIGHT
    ranges = HEIGHT / np.cos(angles) + np.random.default_rng(0).normal(0, 0.002, (81, 81))
    return ScanLog(ranges, angles, poses)


def test_every_point_has_its_origin():
    points, origins = read_rays(make_log())
    assert points.shape == origins.shape
    assert len(points) > 6000
    np.testing.assert_allclose(origins[:, 2], HEIGHT, atol=0.05)
    assert np.abs(points[:, 0] - origins[:, 0]).max() < 0.05


def test_a_log_refines_a_surface():
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-1, 1, (6000, 2)), rng.normal(0, 0.003, 6000)])
    ground = reconstruct(points, units=200)
    again = ground.refine(make_log())
    quality = again.quality()
    assert quality.cloud_to_mesh is not None
    assert quality.cloud_to_mesh.mean < 0.01
    with pytest.raises(ReconstructionError, match="its own origins"):
        ground.refine(make_log(), origins=[0, 0, 1])
    with pytest.raises(ReconstructionError, match="in meters"):
        ground.refine(1000 * points)
    with pytest.raises(ReconstructionError, match="NaN"):
        ground.refine(points, origins=[0, 0, np.nan])
