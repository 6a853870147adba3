"""Colors of a surface."""

import numpy as np
import pytest
import trimesh
from constants import with_constants

import reconstruction as rc
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces import color
from reconstruction._src.surfaces.color import (
    ColorSource,
    copy_vertex_colors,
    find_vertex_colors,
    match_colors,
    paint_mesh,
)

RED, BLUE = [200, 40, 30], [20, 60, 220]


def make_sheet(num: int = 4000, seed: int = 0) -> Cloud:
    """Red where x is below 0, blue elsewhere, on 2 x 1 m."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, num), rng.uniform(0, 1, num), rng.normal(0, 0.002, num)])
    return Cloud(points, np.where(points[:, :1] < 0, RED, BLUE).astype(np.uint8))


def paint(places):
    return np.where(np.asarray(places)[:, :1] < 0, RED, BLUE) / 255


def check_painted(made):
    away = np.abs(made.mesh.vertices[:, 0]) > 0.15  # from the edge between both colors
    assert np.abs(made.vertex_colors[away] / 255 - paint(made.mesh.vertices[away])).max() < 0.05


def test_a_place_on_a_point_among_equal_ones_takes_their_color():
    cloud = Cloud(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.full((3, 3), 77, np.uint8))
    assert ColorSource(cloud).find_colors(np.array([[0.0, 0.0, 0.0]])).tolist() == [[77, 77, 77]]


def test_like_colors_are_averaged_by_their_distance():
    colors = np.array([[100, 100, 100], [110, 110, 110]], np.uint8)
    source = ColorSource(Cloud(np.array([[0, 0, 0], [3, 0, 0]], float), colors))
    with with_constants(color, softening=1e-9, contrast=1e9):
        found = source.find_colors(np.array([[1.0, 0.0, 0.0]]))
    assert found.tolist() == [[102, 102, 102]]  # weights 1 and 1/4


def test_edges_stay_sharp():
    cloud = make_sheet()
    colors = ColorSource(cloud).find_colors(cloud.points)
    assert np.abs(colors.astype(int) - cloud.colors).max() <= 2


def test_the_far_side_of_a_thin_wall_does_not_shine_through():
    rng = np.random.default_rng(0)
    front = np.column_stack([np.full(500, 0.01), rng.uniform(-1, 1, (500, 2))])
    points = np.concatenate([front, front * [-1, 1, 1]])
    colors = np.repeat(np.array([RED, BLUE], np.uint8), 500, axis=0)
    cloud = Cloud(points, colors, np.array([[3.0, 0, 0], [-3.0, 0, 0]]), np.repeat([0, 1], 500))
    place = np.array([[0.0, 0.1, 0.1]])
    assert ColorSource(cloud).find_colors(place, np.array([[1.0, 0, 0]])).tolist() == [RED]
    assert ColorSource(cloud).find_colors(place, np.array([[-1.0, 0, 0]])).tolist() == [BLUE]


def test_a_cloud_without_colors_is_refused():
    with pytest.raises(ReconstructionError, match="colors"):
        ColorSource(Cloud(np.eye(3)))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["gsrm", "gg"])
def test_both_networks_carry_colors_and_the_surface_stays_the_same(method):
    cloud = make_sheet()
    colored = rc.reconstruct(cloud, method, units=200)
    plain = rc.reconstruct(Cloud(cloud.points), method, units=200)
    assert plain.vertex_colors is None
    assert find_vertex_colors(plain.mesh) is None
    assert np.array_equal(colored.mesh.vertices, plain.mesh.vertices)
    assert np.array_equal(colored.mesh.faces, plain.mesh.faces)
    assert colored.vertex_colors is not None
    assert colored.vertex_colors.dtype == np.uint8
    check_painted(colored)
    again = rc.reconstruct(cloud, method, units=200)
    assert np.array_equal(colored.vertex_colors, again.vertex_colors)


@pytest.mark.slow
def test_readings_color_the_surface_where_the_points_have_none(tmp_path):
    cloud = make_sheet()
    made = rc.reconstruct(Cloud(cloud.points[::2]), units=200, readings=cloud)
    assert made.colors is None
    check_painted(made)
    made.save(tmp_path / "made.npz")
    assert np.array_equal(rc.Reconstruction.load(tmp_path / "made.npz").vertex_colors, made.vertex_colors)


def test_colors_survive_refine():
    cloud = make_sheet()
    first = rc.reconstruct(cloud, units=200)
    green = make_sheet(1000, seed=1)
    near = green.points[:, 0] > 0.5
    colors = np.where(near[:, None], [30, 200, 40], green.colors).astype(np.uint8)
    with_colors = first.refine(green.replace(colors=colors))
    assert with_colors.vertex_colors is not None
    assert "colors" not in with_colors.notes
    without = first.refine(green.points)
    check_painted(without)
    assert "1000 new readings" in without.notes["colors"]


def test_colors_of_new_readings_alone_are_dropped_with_a_word():
    first = rc.reconstruct(make_sheet().points, units=200)
    refined = first.refine(make_sheet(1000, seed=1))
    assert refined.vertex_colors is None
    assert "dropped" in refined.notes["colors"]
    assert match_colors(Cloud(np.eye(3)), Cloud(np.eye(3)))[1] == ""


def test_a_copy_has_the_colors_of_its_model():
    mesh = trimesh.creation.box()
    target = mesh.copy()
    copy_vertex_colors(mesh, target)
    assert find_vertex_colors(target) is None
    paint_mesh(mesh, Cloud(np.array([[0, 0, 0.0], [9, 9, 9], [9, 0, 0]]), np.full((3, 3), 9, np.uint8)))
    copy_vertex_colors(mesh, target)
    assert (find_vertex_colors(target) == 9).all()
