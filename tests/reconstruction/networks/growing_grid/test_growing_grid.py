"""The growing grid: what it must reach, keep and refuse."""

import numpy as np
import pytest
import trimesh

from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.networks.growing_grid.growing_grid import GrowingGridConfig, State, train
from reconstruction._src.networks.growing_grid.growth import choose_line_pair
from reconstruction._src.networks.growing_grid.mesh import find_folded, open_pinches, triangulate, unfold
from reconstruction._src.surfaces.quality import Quality, compute_distances, measure_quality

CONFIG = GrowingGridConfig(units=300)


def make_step(half_width: float = 0.7, edge: float = 0.0, height: float = 0.3) -> trimesh.Trimesh:
    """Return a step across x = edge, 3 m long: floor, wall, floor."""
    profile = np.array([[-1.5, 0.0], [edge, 0.0], [edge, height], [1.5, height]])
    sides = [np.insert(profile, 1, y, axis=1) for y in (-half_width, half_width)]
    faces = [[i, i + 1, i + 5] for i in range(3)] + [[i, i + 5, i + 4] for i in range(3)]
    return trimesh.Trimesh(np.concatenate(sides), faces, process=False)


def draw(mesh: trimesh.Trimesh, number: int, seed: int = 0, noise: float = 0.004) -> np.ndarray:
    points = sample_area(np.asarray(mesh.vertices), np.asarray(mesh.faces), number, seed)
    return points + np.random.default_rng([seed, 7]).normal(0, noise, points.shape)


def judge(state: State, truth: trimesh.Trimesh | None = None) -> Quality:
    return measure_quality(
        trimesh.Trimesh(state.vertices, state.faces, process=False), truth=truth, num_samples=20_000
    )


@pytest.fixture(scope="module")
def step() -> trimesh.Trimesh:
    return make_step()


@pytest.fixture(scope="module")
def grown(step) -> State:
    return train(draw(step, 20_000), GrowingGridConfig(units=300), seed=0)


@pytest.mark.slow
def test_it_finds_the_surface_up_to_its_rim(step, grown):
    quality = judge(grown, step)
    assert quality.truth_to_mesh is not None
    assert quality.mesh_to_truth is not None
    assert quality.truth_to_mesh.mean < 0.002
    assert quality.truth_to_mesh.p95 < 0.008
    assert quality.mesh_to_truth.mean < 0.002
    assert (quality.self_intersections, quality.folds) == (0, 0)
    assert quality.min_angle > np.deg2rad(30)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1e2])
def test_the_unit_of_length_does_not_matter(step, scale):
    points = draw(step, 6000)
    near = judge(train(points, GrowingGridConfig(units=300)), step)
    scaled = step.copy()
    scaled.apply_scale(scale)
    far = judge(train(points * scale, GrowingGridConfig(units=300)), scaled)
    assert near.truth_to_mesh is not None
    assert far.truth_to_mesh is not None
    assert far.truth_to_mesh.mean == pytest.approx(scale * near.truth_to_mesh.mean, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("triangles", [210, 800])
def test_the_wanted_triangles_come_out(step, triangles):
    state = train(draw(step, 6000), GrowingGridConfig(triangles=triangles))
    assert len(state.faces) == pytest.approx(triangles, rel=0.02)


def test_the_paper_rules_spread_over_the_surface(step):
    points = draw(step, 4000)
    state = train(points, GrowingGridConfig(units=60, mode="paper"))
    assert 60 <= len(state.vertices) <= 75
    assert judge(state).topology.is_manifold
    assert compute_distances(points, state.vertices, state.faces).mean() < 0.1
    again = train(points, GrowingGridConfig(units=60, mode="paper"))
    assert again.units.tobytes() == state.units.tobytes()


@pytest.mark.slow
def test_outliers_and_doubled_points_do_little_harm(step):
    points = draw(step, 10_000)
    outliers = np.random.default_rng(1).uniform(points.min(axis=0) - 0.1, points.max(axis=0) + 0.1, (500, 3))
    cloud = np.concatenate([points, points[:2000], outliers])
    quality = judge(train(cloud, GrowingGridConfig(units=300)), step)
    assert quality.truth_to_mesh is not None
    assert quality.truth_to_mesh.mean < 0.006
    assert quality.topology.is_manifold


@pytest.mark.slow
def test_a_ring_keeps_its_hole():
    rng = np.random.default_rng(0)
    radius, angle = rng.uniform(0.7, 1.0, 8000), rng.uniform(0, 2 * np.pi, 8000)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.normal(0, 0.002, 8000)])
    state = train(points, GrowingGridConfig(units=400))
    middle = state.vertices[state.faces].mean(axis=1)
    topology = judge(state).topology
    assert topology.is_manifold
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (0, 2, 1)
    assert (np.linalg.norm(middle, axis=1) < 0.6).mean() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_no_pinch_on_a_fine_grid(step, seed):
    """Padding repeats samples, and equal coordinates once put strays into tiles: the grid was dragged to them."""
    quality = judge(train(draw(step, 61_000, seed), GrowingGridConfig(units=7000), seed=seed))
    assert (quality.self_intersections, quality.folds) == (0, 0)


def test_the_sequential_rule_asks_the_unit_that_won_most():
    counters = np.array([[0, 9, 1], [0, 5, 0]])
    assert choose_line_pair(counters) == (0, 0)


def test_a_folded_unit_is_laid_flat_again():
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
    units = np.stack([x, y, 0 * x], axis=2)
    assert not find_folded(units).any()
    units[2, 2] += [1.7, 1.3, 0]
    assert find_folded(units).any()
    flat = unfold(units)
    assert not find_folded(flat).any()
    faces = triangulate(flat, np.ones((5, 4), dtype=bool))
    corners = flat.reshape(-1, 3)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()


def test_cells_that_touch_at_a_corner_only_are_parted():
    has_face = np.array([[True, False], [False, True]])
    assert open_pinches(has_face).sum() == 1
