"""Primitives replace what they fit within the noise, and nothing else."""

import numpy as np
import pytest
import trimesh

from reconstruction import ReconstructionError
from reconstruction._src.surfaces.primitives.find import Primitives, find_primitives, find_rectangles
from reconstruction._src.surfaces.primitives.primitive import Primitive, take_out
from reconstruction._src.surfaces.primitives.ransac import estimate_noise

NOISE = 0.001


def make_noisy(
    solid: trimesh.Trimesh, seed: int = 0, edge: float = 0.05, noise: float = NOISE
) -> trimesh.Trimesh:
    """Return the surface of a solid in small triangles, its vertices off by a noise [m]."""
    vertices, faces = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, edge)[:2]
    mesh = trimesh.Trimesh(vertices, faces)
    mesh.merge_vertices()
    shift = np.random.default_rng(seed).normal(0.0, noise, mesh.vertices.shape)
    return trimesh.Trimesh(mesh.vertices + shift, mesh.faces, process=False)


def make_box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return a box."""
    return trimesh.creation.box(size).apply_translation(center)


def make_sphere_on_plane() -> trimesh.Trimesh:
    """Return a sphere of 0.3 m, a third of it sunk into a floor of 2 x 2 m."""
    floor = make_box((2.0, 2.0, 0.5), (0.0, 0.0, -0.25))
    return trimesh.boolean.union(
        [floor, trimesh.creation.icosphere(3, 0.3).apply_translation((0.2, 0.1, 0.1))]
    )


def make_column_room() -> trimesh.Trimesh:
    """Return the inside of a room of 2 x 1.6 x 1 m with a column of 0.2 m from floor to ceiling; faces look inwards."""
    column = trimesh.creation.cylinder(0.2, 1.4, sections=24).apply_translation((0.3, 0.2, 0.5))
    inside = trimesh.boolean.difference([make_box((2.0, 1.6, 1.0), (0.0, 0.0, 0.5)), column])
    inside.invert()
    return inside


FLAT = Primitive("plane", np.array([0.0, 0.0, -0.002]), np.eye(3), np.array([0.5, 0.3, 0.002]))


def pick(found: Primitives, kind: str) -> list[Primitive]:
    """Return the primitives of a kind."""
    return [one for one in found.shapes if one.kind == kind]


def measure_rest(found: Primitives, mesh: trimesh.Trimesh) -> float:
    """Return the share of the area that stays mesh."""
    rest = [trimesh.triangles.area(part).sum() for part in found.find_rest(mesh)]
    return float(sum(rest)) / float(mesh.area)


def test_the_noise_of_a_surface_is_estimated() -> None:
    mesh = make_noisy(trimesh.creation.icosphere(3, 0.5), noise=0.002)
    assert estimate_noise(np.asarray(mesh.vertices), np.asarray(mesh.faces)) == pytest.approx(0.002, rel=0.35)


@pytest.mark.slow
def test_a_sphere_on_a_plane_is_a_sphere_and_its_floor_a_box() -> None:
    mesh = make_noisy(make_sphere_on_plane(), edge=0.2)
    found = find_primitives(mesh)
    (sphere,), (floor,) = pick(found, "sphere"), pick(found, "box")
    np.testing.assert_allclose(sphere.center, [0.2, 0.1, 0.1], atol=NOISE)
    assert sphere.half_sizes[0] == pytest.approx(0.3, abs=2 * NOISE)
    np.testing.assert_allclose(np.sort(floor.half_sizes), [0.25, 1.0, 1.0], atol=2 * NOISE)
    assert measure_rest(found, mesh) < 0.01


@pytest.mark.slow
def test_a_column_in_a_room_is_a_cylinder_between_floor_and_ceiling() -> None:
    mesh = make_noisy(make_column_room(), edge=0.12)
    found = find_primitives(mesh)
    (column,) = pick(found, "cylinder")
    np.testing.assert_allclose(column.center, [0.3, 0.2, 0.5], atol=0.03)
    assert abs(column.axes[2, 2]) == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(column.half_sizes[:2], [0.199, 0.5], atol=0.06)
    assert not pick(found, "box")  # a room is no box: its inside is free
    for plane in pick(found, "plane"):  # rectangles may end behind other walls, but stand nowhere in the room
        places = np.abs(plane.as_mesh().sample(2000, seed=0) - [0.0, 0.0, 0.5])
        assert not (places < np.array([1.0, 0.8, 0.5]) - 0.01).all(axis=1).any()
        assert (places < np.array([1.0, 0.8, 0.5]) + 0.07).all()


@pytest.mark.slow
def test_boxes_need_sides_at_right_angles_that_are_there() -> None:
    solid = trimesh.boolean.union(
        [make_box((2, 2, 0.5), (0, 0, -0.25)), make_box((0.5, 0.4, 0.6), (0.2, 0.1, 0.25))]
    )
    mesh = make_noisy(solid, edge=0.1)
    found = find_primitives(mesh)
    sizes = sorted(tuple(np.sort(box.half_sizes).round(2)) for box in pick(found, "box"))
    assert sizes == [(0.2, 0.25, 0.27), (0.25, 1.0, 1.0)] or sizes == [(0.2, 0.25, 0.28), (0.25, 1.0, 1.0)]
    unseen = trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.triangles_center[:, 0] < 0.44], process=False)
    assert not pick(find_primitives(unseen), "box")  # nobody has seen their back


@pytest.mark.slow
def test_half_a_ball_is_no_sphere_and_rough_ground_nothing() -> None:
    ball = make_noisy(trimesh.creation.icosphere(3, 0.3))
    assert [one.kind for one in find_primitives(ball).shapes] == ["sphere"]
    half = trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 0] < 0], process=False)
    assert not pick(find_primitives(half), "sphere")
    rough = trimesh.creation.icosphere(3, 1.0)
    rough.vertices *= 1 + 0.2 * np.random.default_rng(0).normal(size=(len(rough.vertices), 1))
    assert not find_primitives(rough).shapes


def test_a_rectangle_covers_no_more_than_the_surface_did() -> None:
    flat = trimesh.creation.box((2.0, 2.0, 0.2))
    top = flat.subdivide().subdivide().subdivide()
    top.update_faces(top.triangles_center[:, 2] > 0.099)
    hole = np.linalg.norm(top.triangles_center[:, :2] - [0.4, 0.4], axis=1) < 0.4
    mesh = trimesh.Trimesh(top.vertices, top.faces[~hole], process=False)
    found = find_primitives(mesh)
    assert found.shapes
    for plane in found.shapes:
        assert (np.abs(plane.as_mesh().vertices[:, :2]) <= 1.0 + 1e-6).all()
        inside = np.abs(([0.4, 0.4, 0.1] - plane.center) @ plane.axes)[:2]
        assert (inside > plane.half_sizes[:2]).any()
    covered = sum(4 * plane.half_sizes[0] * plane.half_sizes[1] for plane in found.shapes)
    assert covered + measure_rest(found, mesh) * mesh.area == pytest.approx(mesh.area, rel=0.05)


@pytest.mark.slow
def test_equal_seeds_give_equal_primitives() -> None:
    mesh = make_noisy(make_box((0.5, 0.4, 0.3), (0.0, 0.0, 0.0)), edge=0.1)
    one, other = find_primitives(mesh, seed=3), find_primitives(mesh, seed=3)
    assert len(one.shapes) == len(other.shapes) > 0
    for first, second in zip(one.shapes, other.shapes, strict=True):
        assert first.kind == second.kind
        for a, b in zip(first[1:], second[1:], strict=True):
            assert np.array_equal(a, b)


def test_triangles_are_cut_at_the_rim_of_a_rectangle() -> None:
    corners = np.array([[[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 3.0, 0.0]]])
    rest = take_out(corners, FLAT, tolerance=0.001, margin=0.0)
    assert trimesh.triangles.area(rest).sum() == pytest.approx(10.0 - 4 * 0.5 * 0.3)
    behind = take_out(corners[:, ::-1], FLAT, tolerance=0.001, margin=0.0)
    assert len(behind) == 1  # it looks the other way
    assert len(take_out(np.add(corners, (0, 0, 0.1)), FLAT, tolerance=0.001, margin=0.0)) == 1


def test_rectangles_of_a_wall_with_strips_that_are_open():
    size = 0.05
    x, y = np.meshgrid(np.arange(40) * size, np.arange(20) * size, indexing="ij")
    low = np.stack([x, y], axis=-1).reshape(-1, 2)
    low = low[(low[:, 0] < 0.499) | ((low[:, 0] > 0.599) & ((low[:, 0] < 1.499) | (low[:, 0] > 1.599)))]
    first = low[:, None] + np.array([[0, 0], [size, 0], [size, size]])
    second = low[:, None] + np.array([[0, 0], [size, size], [0, size]])
    wall = np.concatenate([first, second])  # 2 x 1 m, without two strips 0.1 m wide
    ((_, axes, half),) = find_rectangles(wall, 0.01, 0.6, 6)
    np.testing.assert_allclose(np.sort(half), [0.45, 0.5], atol=0.011)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-9)
    assert len(find_rectangles(wall, 0.01, 0.3, 6)) == 3
    assert find_rectangles(np.zeros((1, 3, 2)), 0.1, 0.1, 3) == []


def test_an_empty_or_broken_mesh_is_refused() -> None:
    with pytest.raises(ReconstructionError, match="0 faces; repair it first"):
        find_primitives(trimesh.Trimesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=int), process=False))
    broken = trimesh.Trimesh([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]], [[0, 1, 2]], process=False)
    with pytest.raises(ReconstructionError, match="finite vertices"):
        find_primitives(broken)
