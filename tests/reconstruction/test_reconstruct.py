"""The facade: one call from points to a surface; saving; what it refuses."""

import hashlib
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from damage import flip_bits

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.reconstruction import Reconstruction

METHODS = ("gsrm", "gg")


def make_ground(number: int = 4000, seed: int = 0) -> np.ndarray:
    """Return points on gently rolling ground, 2 m x 1 m."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1, 1, number), rng.uniform(-0.5, 0.5, number)
    return np.column_stack([x, y, 0.1 * np.sin(3 * x) + rng.normal(0, 0.002, number)])


@pytest.fixture(scope="module", params=METHODS)
def ground(request) -> Reconstruction:
    return reconstruct(make_ground(), request.param, units=150)


def test_one_call_gives_a_sound_mesh_with_normals_up(ground):
    topology = ground.quality().topology
    assert topology.is_manifold
    assert (topology.components, topology.euler_number) == (1, 1)
    assert topology.unused_vertices == 0
    assert (ground.mesh.face_normals[:, 2] > 0).mean() > 0.99
    assert ground.quality().cloud_to_mesh.mean < 0.01
    assert ground.quality(truth=ground.mesh).truth_to_mesh.mean < 1e-6


def test_normals_point_to_the_scanner():
    below = reconstruct(make_ground(), "gg", units=150, viewpoints=[0, 0, -3])
    assert (below.mesh.face_normals[:, 2] < 0).mean() > 0.99


def test_a_saved_network_is_the_same_network(ground, tmp_path):
    path = tmp_path / "ground.npz"
    ground.save(path)
    loaded = Reconstruction.load(path)
    assert loaded.mesh.vertices.tobytes() == ground.mesh.vertices.tobytes()
    assert loaded.mesh.faces.tobytes() == ground.mesh.faces.tobytes()
    assert loaded.config == ground.config
    assert os.listdir(tmp_path) == ["ground.npz"]
    new = make_ground(400, seed=3)
    np.testing.assert_array_equal(loaded.refine(new).mesh.vertices, ground.refine(new).mesh.vertices)


def test_options_and_viewpoint_survive_saving(tmp_path):
    result = reconstruct(make_ground(), "gg", triangles=60, mode="paper", viewpoints=[0, 0, 2])
    result.save(tmp_path / "a.npz")
    loaded = Reconstruction.load(tmp_path / "a.npz")
    assert loaded.config == result.config
    np.testing.assert_array_equal(loaded.viewpoints, [[0, 0, 2]])


@pytest.mark.slow
def test_equal_seeds_give_equal_bytes_in_another_process_too(ground):
    code = (
        "import sys; sys.path.insert(0, 'tests/reconstruction'); import test_reconstruct as t; "
        f"print(t.digest(t.reconstruct(t.make_ground(), {ground.method!r}, units=150)))"
    )
    root = os.path.dirname(os.path.dirname(os.path.dirname(__file__)))
    output = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True
    )
    assert output.stdout.strip() == digest(ground)
    assert digest(reconstruct(make_ground(), ground.method, units=150)) == digest(ground)
    assert digest(reconstruct(make_ground(), ground.method, units=150, seed=1)) != digest(ground)


def digest(result: Reconstruction) -> str:
    return hashlib.sha256(result.mesh.vertices.tobytes() + result.mesh.faces.tobytes()).hexdigest()


def make_bad_points() -> dict[str, tuple[Any, str]]:
    good = make_ground(100)
    with_nan = good.copy()
    with_nan[7, 1] = np.nan
    line = np.outer(np.linspace(0, 1, 50), [1.0, 2.0, 3.0])
    return {
        "empty": (np.zeros((0, 3)), "at least 4 points, got 0"),
        "three": (good[:3], "at least 4 points, got 3"),
        "one place": (np.ones((50, 3)), "one place"),
        "one line": (line, "one line"),
        "nan": (with_nan, "1 of 100 points hold NaN"),
        "infinite": (good * np.array([1, np.inf, 1]), "NaN or infinity"),
        "one-dimensional": (good.ravel(), r"shape \[N, 3\], got \[300\]"),
        "two columns": (good[:, :2], r"got \[100, 2\]"),
        "words": (np.array([["a", "b", "c"]] * 5), "real numbers"),
        "complex": (good.astype(complex), "real numbers"),
        "ragged": ([[1, 2, 3], [1, 2]], "real numbers"),
        "nothing": (None, "real numbers"),
        "huge": (good * 1e200, "too large"),
    }


@pytest.mark.parametrize("name", make_bad_points())
def test_points_without_a_surface_are_refused(name):
    points, message = make_bad_points()[name]
    for method in METHODS:
        with pytest.raises(ReconstructionError, match=message):
            reconstruct(points, method, units=20)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"units": 3}, "at least 4"),
        ({"units": 1001}, "more than the 1000 distinct points"),
        ({"units": 20.5}, "whole number"),
        ({"units": True}, "whole number"),
        ({"seed": -1}, "seed"),
        ({"method": "poisson"}, "'gsrm', 'gg'"),
        ({"mode": "quick"}, "mode"),
        ({"color": "red"}, "unknown option color; there are"),
        ({"viewpoint": [0, 0]}, "viewpoint"),
    ],
)
@pytest.mark.parametrize("method", METHODS)
def test_wrong_arguments_are_refused(method, arguments, message):
    with pytest.raises(ReconstructionError, match=message):
        reconstruct(make_ground(1000), **{"method": method, "units": 30, **arguments})


def test_repeated_points_do_not_count_twice():
    few = make_ground(40)
    with pytest.raises(ReconstructionError, match="40 distinct points"):
        reconstruct(np.tile(few, (50, 1)), "gg", units=60)
    with pytest.raises(ReconstructionError, match="4 units are more than the 3 distinct points"):
        reconstruct(np.tile(few[:3], (50, 1)))


@pytest.mark.parametrize("method", METHODS)
def test_any_number_type_and_memory_order_will_do(method):
    points = make_ground()
    wanted = reconstruct(points, method, units=150).mesh.vertices
    backwards = np.asfortranarray(np.repeat(points, 2, axis=0))[::2]
    assert not backwards.flags.c_contiguous
    np.testing.assert_array_equal(reconstruct(backwards, method, units=150).mesh.vertices, wanted)
    np.testing.assert_array_equal(reconstruct(points.tolist(), method, units=150).mesh.vertices, wanted)
    for rough in (points.astype(np.float16), (1000 * points).astype(np.int16)):
        assert np.isfinite(reconstruct(rough, method, units=150).mesh.vertices).all()


def test_progress_runs_from_start_to_end(ground):
    reported = []
    reconstruct(make_ground(), ground.method, units=150, progress=lambda what, share: reported.append(share))
    np.testing.assert_allclose(reported, sorted(reported), atol=1e-9)
    assert reported[-1] == 1.0


def test_a_flipped_bit_gives_the_same_surface_or_the_error(tmp_path):
    surface = reconstruct(make_ground(), "gg", units=150)
    path = tmp_path / "a.npz"
    surface.save(path)
    refused = []
    for damaged in flip_bits(path.read_bytes(), 200):
        path.write_bytes(damaged)
        try:
            loaded = Reconstruction.load(path)
        except ReconstructionError as error:
            refused.append(str(error))
        else:
            np.testing.assert_array_equal(loaded.mesh.triangles, surface.mesh.triangles)
    assert len(refused) > 100
    assert all(str(path) in message for message in refused)


def test_a_surface_stops_at_the_limit(ground, tmp_path):
    ground.save(tmp_path / "a.npz")
    with pytest.raises(ReconstructionError, match=r"a\.npz.*limit"):
        Reconstruction.load(tmp_path / "a.npz", max_bytes=1000)


@pytest.mark.parametrize(
    "header",
    [
        "[" * 100_000,
        "[]",
        "{}",
        '{"format": 7, "version": 1}',
        '{"format": "symbrion reconstruction", "version": "one"}',
        '{"format": "symbrion reconstruction", "version": 1, "method": "gg", "config": {"units": 150}}',
        '{"format": "symbrion reconstruction", "version": 1, "method": ["gg"], "config": 3}',
    ],
)
def test_a_foreign_header_is_refused(tmp_path, header):
    np.savez(tmp_path / "a.npz", header=np.array(header))
    with pytest.raises(ReconstructionError, match=r"a\.npz"):
        Reconstruction.load(tmp_path / "a.npz")


def test_what_is_no_saved_reconstruction_is_refused(tmp_path):
    other = tmp_path / "other.npz"
    np.savez(other, points=np.zeros(3))
    text = tmp_path / "text.npz"
    text.write_text("no archive")
    for path in (other, text, tmp_path / "absent.npz"):
        with pytest.raises(ReconstructionError, match=path.name):
            Reconstruction.load(path)
    reconstruct(make_ground(), "gg", units=150).save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as file:
        arrays = dict(file)
    arrays["header"] = np.array(str(arrays["header"]).replace('"version": 1', '"version": 99'))
    np.savez(tmp_path / "newer.npz", **arrays)
    with pytest.raises(ReconstructionError, match="version 99"):
        Reconstruction.load(tmp_path / "newer.npz")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("points", lambda array: np.full_like(array, np.nan)),
        ("points", lambda array: np.array("x")),
        ("state_units", lambda array: np.full_like(array, np.inf)),
        ("state_units", lambda array: array[:, :2]),
        ("state_faces", lambda array: array - 7),
        ("state_faces", lambda array: array + 2**20),
        ("state_faces", lambda array: array[:0]),
        ("state_faces", lambda array: array.astype(float)),
    ],
)
def test_saved_arrays_of_no_network_are_refused(tmp_path, name, change):
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 20), np.linspace(0.0, 1.0, 20))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    reconstruct(points, method="gsrm", units=30).save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "a.npz", **{**arrays, name: change(arrays[name])})
    with pytest.raises(ReconstructionError, match=rf"a\.npz: {name.removeprefix('state_')} must"):
        Reconstruction.load(tmp_path / "a.npz")
