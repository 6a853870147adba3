"""The growing self-reconstruction map makes a true two-manifold of the right topology, whatever the cloud."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from constants import with_constants
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import make_sheet, make_trench, sample_mesh

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.networks.gsrm import gsrm
from reconstruction._src.networks.gsrm.gsrm import GSRMConfig, State, find_uncovered, train
from reconstruction._src.networks.som.compilation import keep_compiled_programs
from reconstruction._src.surfaces.quality import Topology, compute_distances, count_topology

keep_compiled_programs()
ROOT = Path(__file__).parents[4]
SPHERE = trimesh.creation.icosphere(4)
SEEDS = pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
TORUS = trimesh.creation.torus(1.0, 0.4, major_sections=64, minor_sections=32)


def _grow(points: np.ndarray, units: int = 300, seed: int = 0) -> tuple[State, Topology]:
    state = train(points, GSRMConfig(units=units), seed)
    topology = count_topology(state.faces, len(state.units))
    assert np.isfinite(state.units).all()
    assert topology.is_manifold
    assert topology.unused_vertices == 0
    return state, topology


@pytest.mark.slow
@SEEDS
def test_a_sheet_has_one_rim(seed: int) -> None:
    points = make_sheet(seed=seed)
    state, topology = _grow(points, seed=seed)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (1, 1, 1)
    assert 290 <= len(state.units) <= 300
    assert compute_distances(points, state.units, state.faces).mean() < 0.004


@pytest.mark.slow
@SEEDS
def test_sharp_edges_and_vertical_walls(seed: int) -> None:
    points = make_trench(seed=seed)
    state, topology = _grow(points, 800, seed)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (1, 1, 1)
    clean = make_trench(noise=0.0)
    assert compute_distances(clean, state.units, state.faces).mean() < 0.0015


@pytest.mark.slow
@pytest.mark.parametrize(("mesh", "euler_number"), [(SPHERE, 2), (TORUS, 0)])
def test_closed_surfaces(mesh: trimesh.Trimesh, euler_number: int) -> None:
    _, topology = _grow(sample_mesh(mesh, 20000, 0.01), 800)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (euler_number, 0, 1)


@pytest.mark.slow
def test_several_components() -> None:
    far = TORUS.copy()
    far.apply_translation([3.0, 0.0, 0.0])
    _, topology = _grow(sample_mesh(SPHERE + far, 20000, 0.005), 800)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (2, 0, 2)


@pytest.mark.slow
def test_outliers_and_duplicates() -> None:
    rng = np.random.default_rng(0)
    clean = make_sheet(12000)
    low, high = clean.min(axis=0) - 0.5, clean.max(axis=0) + 0.5
    outliers = rng.uniform(low, high, size=(600, 3))
    state, topology = _grow(np.concatenate([clean, clean[:3000], outliers]), 400)
    assert compute_distances(clean, state.units, state.faces).mean() < 0.005
    assert topology.components <= 2
    is_off = compute_distances(state.units, *_mesh_of(make_sheet(20000, 0.0))) > 0.05
    assert is_off.mean() < 0.02


def _mesh_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    state = train(points, GSRMConfig(units=800), 0)
    return state.units, state.faces


@pytest.mark.slow
def test_uneven_density() -> None:
    points = make_sheet(60000)
    rng = np.random.default_rng(1)
    uneven = points[rng.random(len(points)) < np.clip(np.exp(-2 * (points[:, 0] + 1)), 0.04, 1)]
    state, topology = _grow(uneven, 400)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (1, 1, 1)
    assert compute_distances(make_sheet(noise=0.0), state.units, state.faces).mean() < 0.006


@pytest.mark.slow
@pytest.mark.parametrize("units", [200, 800, 2200])
def test_noisy_scan_lines_far_apart_make_one_sheet(units: int) -> None:
    rng = np.random.default_rng(0)
    line, along = np.divmod(np.arange(20000), 1000)
    points = np.column_stack([line / 10, along / 1000, 0.1 * np.sin(line / 2)])
    _, topology = _grow(points + rng.normal(0, 0.002, points.shape), units)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (1, 1, 1)


@SEEDS
def test_thin_bodies_are_closed_along_their_sharp_rim(seed: int) -> None:
    vertices = np.asarray(SPHERE.vertices) * [1.0, 1.0, 0.15]
    lens = trimesh.Trimesh(vertices, SPHERE.faces, process=False)
    _, topology = _grow(sample_mesh(lens, 20000, 0.002, seed), 1000, seed)
    assert (topology.euler_number, topology.boundary_loops, topology.components) == (2, 0, 1)


@pytest.mark.slow
def test_a_hole_in_the_data_stays_open() -> None:
    points = make_sheet(20000)
    _, topology = _grow(points[np.linalg.norm(points[:, :2], axis=1) > 0.2], 600)
    assert (topology.euler_number, topology.boundary_loops) == (0, 2)


@pytest.mark.parametrize("scale", [1e-3, 100.0])
def test_scale_is_free(scale: float) -> None:
    points = make_sheet(4000)
    once = train(points, GSRMConfig(units=150), 0)
    scaled = train(points * scale + 1000 * scale, GSRMConfig(units=150), 0)
    assert abs(len(scaled.units) - len(once.units)) <= 2
    distance = compute_distances(scaled.units / scale - 1000, once.units, once.faces)
    assert distance.mean() < 0.003


@pytest.mark.slow
@given(
    number=st.integers(4, 60),
    units=st.integers(4, 60),
    kind=st.sampled_from(["plane", "ball", "repeated", "grid"]),
    seed=st.integers(0, 100),
)
@settings(max_examples=6, deadline=None)
def test_few_points_give_a_manifold_or_a_refusal(number: int, units: int, kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(number, 3))
    if kind == "plane":
        points[:, 2] = 0
    elif kind == "repeated":
        points = np.repeat(points[: max(4, number // 8)], 8, axis=0)
    elif kind == "grid":
        points = np.round(points)
    try:
        state = train(points, GSRMConfig(units=min(units, len(np.unique(points, axis=0)), len(points))), seed)
    except ReconstructionError:
        return
    assert np.isfinite(state.units).all()
    assert count_topology(state.faces, len(state.units)).is_manifold


@pytest.mark.slow
@pytest.mark.data
def test_bunny(shared_data: Path) -> None:
    bunny = trimesh.load(shared_data / "stanford-bunny.obj", process=False)
    state, topology = _grow(np.asarray(bunny.vertices), 2200)
    assert topology.components == 1
    assert topology.euler_number == 2 - topology.boundary_loops
    assert compute_distances(np.asarray(bunny.vertices), state.units, state.faces).mean() < 0.0003


SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def make_scan(seed: int = 0) -> np.ndarray:
    """Return a wall with 12,000 samples, dense in its middle, a small board far from it with 40, and ten strays."""
    rng = np.random.default_rng(seed)
    near = np.c_[rng.normal(2, 0.003, 12_000), rng.uniform(-1, 1, (12_000, 2)) ** 3]
    far = np.c_[rng.normal(9, 0.002, 40), rng.uniform(-0.03, 0.03, (40, 2))]
    strays = np.c_[rng.uniform(4, 7, 10), rng.uniform(-3, 3, (10, 2))]
    return np.concatenate([near, far, strays])


def test_only_groups_far_from_every_face_are_uncovered():
    rng = np.random.default_rng(0)
    on = np.c_[rng.uniform(0, 1, (2000, 2)), rng.normal(0, 0.01, 2000)]
    group = np.c_[rng.uniform(0, 1, (40, 2)), np.full(40, 3.0)]
    strays = np.concatenate([[[0.0, 0, -9], [5, 0, -9], [0, 8, 9]], rng.uniform(11, 12, (60, 3))])
    found = find_uncovered(np.concatenate([on, group, strays]), *SQUARE)
    assert found[2000:2040].all()
    assert found.sum() == 40
    few = np.concatenate([on, group[: gsrm._MIN_SAMPLES - 1]])
    assert not find_uncovered(few, *SQUARE).any()


@pytest.mark.slow
def test_what_was_dropped_as_debris_is_covered_and_the_rest_stays_as_it_is():
    samples = make_scan()
    config = GSRMConfig(units=400)
    with with_constants(gsrm, passes=0):
        without = train(samples, config)
    state = train(samples, config)
    before, after = (
        compute_distances(samples[12_000:12_040], each.units, each.faces) for each in (without, state)
    )
    assert np.median(after) < 0.02
    assert np.median(before) > 3.0
    num_faces, num_units = len(without.faces), len(without.units)
    np.testing.assert_array_equal(state.faces[:num_faces], without.faces)
    np.testing.assert_array_equal(state.units[:num_units], without.units)
    assert len(state.units) <= 1.25 * 400
    assert count_topology(state.faces, len(state.units)).is_manifold
    again = train(samples, config)
    np.testing.assert_array_equal(again.units, state.units)


@pytest.mark.slow
def test_an_even_cloud_is_not_completed():
    rng = np.random.default_rng(0)
    samples = np.c_[rng.uniform(0, 2, (5000, 2)), np.zeros(5000)]
    whole = train(samples, GSRMConfig(units=200))
    with with_constants(gsrm, passes=0):
        without = train(samples, GSRMConfig(units=200))
    np.testing.assert_array_equal(whole.units, without.units)
