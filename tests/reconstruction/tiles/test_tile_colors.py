"""Tiles with colors."""

import numpy as np
import pytest

import reconstruction as rc
from reconstruction._src.surfaces.color import find_vertex_colors
from reconstruction._src.tiles.folder import read_surface

CONFIG = rc.TilesConfig(tile=10.0)


def make_field(num: int = 6000) -> rc.Cloud:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0, 20, num), rng.uniform(0, 10, num), rng.normal(0, 0.01, num)])
    return rc.Cloud(points, np.round(255 * paint(points)).astype(np.uint8))


def paint(places):
    return np.stack([places[:, 0] / 20, 0.5 + 0 * places[:, 0], 1 - places[:, 1] / 10], axis=1).clip(0, 1)


def test_tiles_have_the_colors_of_their_points(tmp_path):
    cloud = make_field()
    tiled = rc.reconstruct_tiles(cloud, tmp_path / "colored", CONFIG)
    mesh = tiled.mesh()
    colors = find_vertex_colors(mesh)
    assert colors is not None
    assert np.sqrt(np.mean((colors / 255 - paint(np.asarray(mesh.vertices))) ** 2)) < 0.02
    plain = rc.reconstruct_tiles(cloud.points, tmp_path / "plain", CONFIG).mesh()
    assert find_vertex_colors(plain) is None
    assert np.array_equal(plain.vertices, mesh.vertices)


def test_files_of_points_bring_their_colors(tmp_path):
    cloud = make_field()
    rows = np.column_stack([cloud.points, cloud.colors])
    np.savetxt(tmp_path / "a.xyz", rows, fmt=["%.4f"] * 3 + ["%d"] * 3)
    mesh = rc.reconstruct_tiles(tmp_path / "a.xyz", tmp_path / "tiles", CONFIG).mesh()
    assert find_vertex_colors(mesh) is not None


def test_damaged_colors_are_refused(tmp_path):
    path = tmp_path / "tile_0_0.npz"
    np.savez(path, vertices=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]), colors=np.zeros((2, 3), np.uint8))
    with pytest.raises(rc.ReconstructionError, match="colors are uint8 of"):
        read_surface(path)
