"""Slip in scan logs and reconstructions: files, refine, refusals."""

import dataclasses

import numpy as np
import pytest

import reconstruction as rc
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.knowledge.slip.patches import estimate_friction_patches
from tests.reconstruction.knowledge.slip.made_slip import make_slip


def make_surface() -> rc.Reconstruction:
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(-1.0, 4.0, 1500), rng.uniform(-1.0, 1.0, 1500), np.zeros(1500)]
    return rc.reconstruct(points, units=80, seed=0)


def test_a_log_keeps_its_slip(tmp_path) -> None:
    slip = make_slip(lambda x: 0.5, seconds=4.0)
    log = rc.ScanLog(np.ones((1, 2)), np.zeros(2), np.eye(4)[None], slip=slip)
    log.save(tmp_path / "log.npz")
    loaded = rc.load_scan_log(tmp_path / "log.npz").slip
    for field in dataclasses.fields(slip):
        np.testing.assert_array_equal(getattr(loaded, field.name), getattr(slip, field.name))
    rc.ScanLog(np.ones((1, 2)), np.zeros(2), np.eye(4)[None]).save(tmp_path / "none.npz")
    assert rc.load_scan_log(tmp_path / "none.npz").slip is None


@pytest.mark.slow
def test_refine_takes_slip_and_leaves_the_surface(tmp_path) -> None:
    surface = make_surface()
    assert surface.friction is None
    felt = surface.refine(slip=make_slip(lambda x: 0.3 if x < 1.0 else 0.8))
    np.testing.assert_array_equal(felt.mesh.vertices, surface.mesh.vertices)
    assert sorted(round(patch.friction, 2) for patch in felt.friction.patches) == [0.3, 0.8]
    felt.save(tmp_path / "felt.npz")
    loaded = rc.Reconstruction.load(tmp_path / "felt.npz")
    assert loaded.friction.patches[0][:2] == felt.friction.patches[0][:2]
    moved = loaded.refine(np.array([[1.0 + 0.1 * i, 0.1 * (i % 2), 0.0] for i in range(6)]))
    assert len(moved.slip.frictions) == len(felt.slip.frictions), "new points leave the friction"
    assert estimate_friction_patches(moved.slip) is not None


def test_nothing_new_is_refused() -> None:
    surface = make_surface()
    with pytest.raises(ReconstructionError, match="nothing new"):
        surface.refine()
    with pytest.raises(ReconstructionError, match="SlipReadings"):
        surface.refine(slip=np.zeros(3))
