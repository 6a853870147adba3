"""Friction from slip: by place, in patches, and in the files of logs and reconstructions."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

import reconstruction as rc
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.knowledge.slip.drags import (
    FrictionReadings,
    find_friction,
    join_slip,
    read_slip_arrays,
)
from reconstruction._src.knowledge.slip.patches import estimate_friction_patches, find_segments
from reconstruction._src.scans.slip_readings import SlipReadings

TICK, MASS, SPEED, GRAVITY = 0.02, 0.8, 0.12, 9.81


def make_slip(
    friction,
    slope: float = 0.0,
    seconds: float = 20.0,
    offset: float = 0.24,
    bias: float = 0.0,
    noise: float = 0.0,
    both_ways: bool = True,
) -> SlipReadings:
    """Drive along x, up a slope [rad]; friction is a function of x; `bias` of the pull of the dock [N]."""
    rng = np.random.default_rng(0)
    times = np.arange(0.0, seconds, TICK)
    number, phase = np.divmod(times, 1.0)
    sign = np.where(number % 2 == 0, -1.0, 1.0) if both_ways else np.ones(len(times))
    change = np.where(phase < 0.5, 0.0, offset * sign)
    way = SPEED * times
    x, z = way * np.cos(slope), way * np.sin(slope)
    load = MASS * GRAVITY * np.cos(slope)
    pull = np.sign(change) * np.vectorize(friction)(x) * load
    specific = np.stack(
        [np.full(len(times), GRAVITY * np.sin(slope)), 0 * x, GRAVITY * np.cos(slope) + 0 * x], 1
    )
    forces = MASS * specific - np.stack([pull, 0 * x, np.full(len(times), load)], axis=1)
    forces[:, 0] += bias
    forces += noise * rng.standard_normal(forces.shape)
    return SlipReadings(
        times,
        np.zeros(len(times), dtype=int),
        np.stack([x, 0 * x, z], axis=1),
        np.zeros(len(times)),
        np.full(len(times), slope),
        SPEED + change,
        specific,
        forces,
        MASS,
    )


@pytest.mark.parametrize("slope", [0.0, 0.25, -0.25])
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.9])
def test_friction_is_found_on_flats_and_slopes(friction: float, slope: float) -> None:
    found = find_friction(make_slip(lambda x: friction, slope))
    assert len(found.frictions) == 40, "two windows a drag"
    assert found.frictions == pytest.approx(friction)
    assert found.sigmas == pytest.approx(0.01, abs=0.005)


def test_places_are_those_of_the_drags() -> None:
    found = find_friction(make_slip(lambda x: 0.3 if x < 1.0 else 0.8))
    is_near = found.places[:, 0] < 0.95
    assert found.frictions[is_near] == pytest.approx(0.3)
    assert found.frictions[found.places[:, 0] > 1.05] == pytest.approx(0.8)


def test_tracks_that_slip_too_little_do_not_count() -> None:
    assert len(find_friction(make_slip(lambda x: 0.5, offset=0.08)).frictions) == 0


def test_a_module_that_is_pulled_as_fast_as_its_tracks_run_does_not_count() -> None:
    slip = make_slip(lambda x: 0.5)
    standing = replace(slip, commanded=np.where(slip.commanded < 0.1, 0.12 - 1e-3, slip.commanded))
    assert len(find_friction(standing).frictions) == 20


def test_drags_over_a_knick_do_not_count() -> None:
    slip = make_slip(lambda x: 0.5)
    bent = replace(slip, pitches=np.where(slip.times > 10.8, 0.1, 0.0))
    assert len(find_friction(slip).frictions) - len(find_friction(bent).frictions) in (2, 4)


def test_the_offset_of_the_pull_is_found_from_both_directions() -> None:
    biased = find_friction(make_slip(lambda x: 0.5, bias=0.4))
    assert biased.frictions == pytest.approx(0.5, abs=0.002)
    alone = find_friction(make_slip(lambda x: 0.5, bias=0.4, both_ways=False))
    assert np.abs(alone.frictions - 0.5).min() > 0.03
    assert alone.sigmas.min() > 0.05, "and without both, the interval says so"


def test_noise_widens_the_interval() -> None:
    quiet, loud = (find_friction(make_slip(lambda x: 0.5, noise=noise)) for noise in (0.0, 2.0))
    assert loud.sigmas[0] > 1.5 * quiet.sigmas[0]
    assert np.abs(loud.frictions - 0.5).std() < 2 * loud.sigmas[0]


def test_readings_that_are_none_are_refused() -> None:
    slip = make_slip(lambda x: 0.5)
    with pytest.raises(ScanError, match="forces has shape"):
        replace(slip, forces=slip.forces[:-1])
    with pytest.raises(ScanError, match="pitches must be finite"):
        replace(slip, pitches=slip.pitches * np.nan)
    with pytest.raises(ScanError, match="mass must be above 0"):
        replace(slip, mass=0.0)


def test_no_readings_are_no_friction() -> None:
    nothing = np.zeros((0, 3))
    empty = SlipReadings(*(nothing[:, 0],) * 2, nothing, *(nothing[:, 0],) * 3, nothing, nothing, 1.0)
    assert len(find_friction(empty).frictions) == 0


def make_readings(friction, lanes=(-0.4, 0.0, 0.4), noise: float = 0.0) -> FrictionReadings:
    """Return readings every 6 cm along lanes of 3 m."""
    x = np.arange(0.03, 3.0, 0.06)
    places = np.array([(a, y, 0.0) for y in lanes for a in x])
    values = np.array([friction(a, y) for a, y, _ in places])
    values += noise * np.random.default_rng(0).standard_normal(len(values))
    count = len(values)
    runs = np.repeat(np.arange(len(lanes)), len(x))
    return FrictionReadings(places, values, np.full(count, 0.01), np.full(count, 0.005), runs)


def test_changes_are_found_where_they_are() -> None:
    values = np.array([0.3, 0.3, 0.3, 0.7, 0.7, 0.5, 0.5])
    assert find_segments(values, 0.01, 16.0).tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert find_segments(values, 0.5, 16.0).tolist() == [0] * 7
    assert find_segments(np.zeros(0), 0.01, 16.0).tolist() == []


def test_ice_in_the_middle_is_one_patch() -> None:
    felt = estimate_friction_patches(make_readings(lambda x, y: 0.2 if 1.0 < x < 1.6 else 0.7, noise=0.01))
    assert [round(patch.friction, 2) for patch in felt.patches] == [0.7, 0.2]
    ground, ice = felt.patches
    assert len(ground.rectangles) == 0
    low, high = ice.rectangles[0][:2], ice.rectangles[0][2:]
    np.testing.assert_allclose([low[0], high[0]], [1.0, 1.6], atol=0.06)
    np.testing.assert_allclose([low[1], high[1]], [-0.7, 0.7], atol=0.06)
    assert ice.half_width == pytest.approx(1.96 * 0.005, rel=0.3), "most of it is the shared error"


def test_grounds_alike_are_one_patch_wherever_they_are() -> None:
    felt = estimate_friction_patches(
        make_readings(lambda x, y: 0.3 if x < 0.6 else 0.31 if x > 2.4 else 0.7, noise=0.002)
    )
    assert len(felt.patches) == 2
    covered = felt.patches[1].rectangles
    assert covered[:, 0].min() < 0.1
    assert covered[:, 2].max() > 2.9


def test_a_place_on_a_border_belongs_to_neither_side() -> None:
    felt = estimate_friction_patches(
        make_readings(lambda x, y: 0.2 if x < 1.5 else 0.45 if x < 1.56 else 0.7)
    )
    assert [round(patch.friction, 6) for patch in felt.patches] == [0.2, 0.7]
    assert (felt.patch_of == -1).sum() >= 3


def test_too_few_readings_are_no_patch() -> None:
    readings = make_readings(lambda x, y: 0.5)
    assert estimate_friction_patches(FrictionReadings(*(array[:1] for array in readings))) is None
    assert estimate_friction_patches(FrictionReadings(*(array[:0] for array in readings))) is None


def test_a_new_survey_replaces_what_was_known_of_its_places() -> None:
    offset = np.array([100.0, 0.0, 0.0])
    first = join_slip(None, make_slip(lambda x: 0.7), np.zeros(3))
    slip = make_slip(lambda x: 0.2, seconds=8.0)
    assert join_slip(first, None, offset) is first
    moved = dataclasses.replace(slip, positions=slip.positions + offset)
    both = join_slip(first, moved, offset)
    assert set(both.frictions.round(3)) == {0.2, 0.7}
    assert both.places[both.frictions > 0.5, 0].min() > find_friction(slip).places[:, 0].max() + 0.19
    assert len(np.unique(both.runs)) == 2


def test_slip_that_is_none_is_refused() -> None:
    with pytest.raises(ReconstructionError, match="SlipReadings"):
        join_slip(None, np.zeros((3, 3)), np.zeros(3))


def test_arrays_of_a_file_are_checked() -> None:
    arrays = {f"slip_{name}": array for name, array in make_readings(lambda x, y: 0.5)._asdict().items()}
    assert read_slip_arrays({}) is None
    assert read_slip_arrays(arrays) is not None
    with pytest.raises(ReconstructionError, match="slip must be finite"):
        read_slip_arrays(arrays | {"slip_sigmas": np.zeros(2)})


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
