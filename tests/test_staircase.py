"""A real scan of a staircase, from the points to a snake on the steps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from benchmarks import staircase
from benchmarks.material import stairs
from reconstruction._src.scans.formats import load_points


def _make_beams(undercut: float = 0.0) -> np.ndarray:
    """Two sweeps' columns down a riser of 0.144 m between two treads, `[4, 3, 3]` in the stairs' frame."""
    profile = [[5.60, 0.144], [5.50, 0.144], [5.50 + undercut, 0.0], [5.30, 0.0]]
    across = [0.0, 0.1, 0.2]
    return np.array([[[x, y, z] for y in across] for x, z in profile])


def _place(points: np.ndarray) -> np.ndarray:
    return stairs.stretch_stairs(points, 1.0)


def test_beams_are_ordered_by_sweep_and_azimuth() -> None:
    azimuth = np.radians([-30.0, 0.0, 30.0, -30.0, 30.0])
    points = np.stack([np.cos(azimuth), np.sin(azimuth), [0.0, 1.0, 2.0, 3.0, 4.0]], axis=-1)
    grid = stairs.order_beams(points)
    assert grid.shape == (2, 61, 3)
    np.testing.assert_array_equal(grid[:, ::30, 2], [[0, 1, 2], [3, np.nan, 4]])


def test_squeezing_can_be_undone() -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(stairs.stretch_stairs(stairs.squeeze_stairs(points, 0.15), 0.15), points)


def test_points_between_beams_lie_on_the_treads_and_the_riser() -> None:
    filled = stairs.squeeze_stairs(stairs.fill_between_beams(_place(_make_beams()), 0.02, 1.0), 1.0)
    x, y, z = filled.T
    on_riser = (z > 1e-9) & (z < 0.144 - 1e-9)
    assert on_riser.any()
    np.testing.assert_allclose(x[on_riser], 5.50)
    assert set(np.round(z[~on_riser], 9)) == {0.0, 0.144}
    assert (x.min(), x.max()) == pytest.approx((5.32, 5.60), abs=0.02)
    assert 0.0 - 1e-9 <= y.min() < y.max() <= 0.2 + 1e-9


def test_nothing_is_filled_in_between_different_things() -> None:
    beams = _make_beams()
    beams[:2, :, 0] += 1.0
    x = stairs.squeeze_stairs(stairs.fill_between_beams(_place(beams), 0.02, 1.0), 1.0)[:, 0]
    assert not ((x > 5.51) & (x < 6.49)).any()


def test_a_riser_behind_its_nosing_is_brought_under_it_and_the_rest_stays() -> None:
    beams = _make_beams(undercut=0.04)
    filled = stairs.squeeze_stairs(stairs.fill_undercuts(_place(beams)), 1.0)
    np.testing.assert_allclose(filled[[0, 1, 3]], beams[[0, 1, 3]], atol=1e-12)
    np.testing.assert_allclose(filled[2, :, 0], 5.50 - 0.1 * 0.144)


def test_risers_of_regular_stairs_are_found() -> None:
    corners, z = [], 0.0
    for step in range(stairs.NUM_STEPS + 1):
        x = stairs.FIRST_RISER + step * stairs.TREAD
        corners.append((x - stairs.TREAD if step else 4.0, z))
        corners.append((x, z))
        z += 0.165 if step == 0 else stairs.RISE
    profile = np.array(corners)
    vertices = np.array([[x, y, z] for x, z in profile for y in (-4.0, 1.5)])
    first = 2 * np.arange(len(profile) - 1)[:, None]
    faces = np.concatenate([first + np.array([0, 2, 1]), first + np.array([1, 2, 3])])
    mesh = trimesh.Trimesh(_place(vertices), faces, process=False)
    expected = stairs.FIRST_RISER + stairs.TREAD * np.arange(stairs.NUM_STEPS)
    np.testing.assert_allclose(staircase.find_risers(mesh), expected, atol=0.006)


@pytest.mark.data
def test_real_scan_to_snake_on_the_steps(shared_data: Path) -> None:
    scan = load_points(shared_data / staircase.SCAN.name)
    points = scan[stairs.crop_stairs(scan)]
    surface: dict[str, Any] = staircase.compare(staircase.grow_stairs(scan), points)
    assert surface["components"] == 1
    assert surface["reach"] > surface["highest"] - 0.1
    assert surface["judged"] >= 7
    assert surface["worst_height"] < 0.010
    assert abs(surface["rise"] - stairs.RISE) < 0.010
    assert abs(surface["tread"] - stairs.TREAD) < 0.010
    assert surface["cloud_to_mesh"] < 0.006
    arena, _ = staircase.make_stairs_arena(scan)
    assert len(arena.pieces) <= staircase.MAX_PIECES
    assert arena.quality.mean < 0.004
    drive, _ = staircase.drive(arena, staircase.STAIRS_CHAMPION)
    assert not drive.rolled_over
    assert drive.on_steps[0] >= 4
    assert drive.on_steps[1] >= 1
