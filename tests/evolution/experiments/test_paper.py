"""The paper's experiments: kept one by one, counted right, refused where they contradict what is there."""

import contextlib
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import evolution as ev
import symbrion_gym as sg
from evolution._src.cli.main import run
from evolution._src.experiments.paper.arenas import RECIPES
from evolution._src.experiments.paper.benchmark import load_benchmark
from evolution._src.experiments.paper.config import QUICK, PaperConfig
from evolution._src.experiments.paper.experiments import list_experiments
from evolution._src.experiments.paper.folder import PaperFolder
from evolution._src.experiments.paper.laser import list_poses
from evolution._src.experiments.paper.networks import cut_sides, list_networks, measure_surface
from evolution._src.experiments.paper.physics import time_crossings
from evolution._src.experiments.paper.ray_casters import BruteForceCaster, EmbreeCaster, TreeCaster
from evolution._src.experiments.paper.robots import select_frames
from evolution._src.experiments.paper.statistics import find_power, find_ratio, summarize


def look_down(x: float, height: float = 1.5) -> np.ndarray:
    """Return the pose of a scanner whose middle beam points down, its fan across the course's y axis."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]).T  # x down, y along the course
    pose[:3, 3] = x, 0.1, height
    return pose


@pytest.fixture(scope="module")
def champion() -> ev.Champion:
    names = tuple(f"g{index}" for index in range(8))
    genotype = (-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6)
    return ev.Champion(genotype, names, "reactive", 8, "simple", 0, 0.0)


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    calls = []

    def experiment() -> dict[str, list[float]]:
        calls.append(1)
        return {"values": [1.0, 2.0]}

    assert PaperFolder(tmp_path, QUICK).find("cloud") is None
    first = PaperFolder(tmp_path, QUICK).keep("cloud", experiment)
    second = PaperFolder(tmp_path, QUICK).keep("cloud", experiment)
    assert first == second
    assert len(calls) == 1
    assert first["figures"] == {"values": [1.0, 2.0]}
    assert "mujoco" in first["machine"]
    assert first["cpu_seconds"] >= 0


def test_an_experiment_that_fails_leaves_nothing(tmp_path: Path) -> None:
    folder = PaperFolder(tmp_path, QUICK)

    def fail() -> dict[str, float]:
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="disk is full"):
        folder.keep("cloud", fail)
    assert folder.find("cloud") is None
    assert list((tmp_path / "experiments").iterdir()) == []


def test_another_configuration_is_refused(tmp_path: Path) -> None:
    PaperFolder(tmp_path, QUICK)
    with pytest.raises(ev.RunError, match=r"runs 3, not 100.*name another folder"):
        PaperFolder(tmp_path, PaperConfig())


def test_a_damaged_record_is_named(tmp_path: Path) -> None:
    folder = PaperFolder(tmp_path, QUICK)
    (tmp_path / "experiments" / "cloud.json").write_text("{")
    with pytest.raises(ev.RunError, match=r"cloud\.json is damaged"):
        folder.find("cloud")


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    folder, other = PaperFolder(tmp_path, QUICK), PaperFolder(tmp_path, QUICK)
    with folder.lock(), pytest.raises(ev.RunError, match="another run"), other.lock():
        pass


@pytest.mark.parametrize(
    "changes", [{"runs": 0}, {"gsrm_units": ()}, {"widened": 0.3}, {"scans": -1}], ids=str
)
def test_impossible_sizes_are_refused(changes: dict) -> None:
    with pytest.raises(ev.RunError, match=next(iter(changes))):
        dataclasses.replace(QUICK, **changes)


def test_the_command_refuses_another_seed_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    PaperFolder(tmp_path, QUICK)
    assert run(["paper", "--quick", "--seed", "1", "--out", str(tmp_path)]) == 1
    assert "seed 0, not 1" in capsys.readouterr().err


def test_the_full_run_is_the_papers() -> None:
    config = PaperConfig()
    assert (config.runs, config.steps) == (100, 3500)
    assert (config.arena_units, config.arena_triangles) == (2200, 13860)
    assert len(list_networks(config)) == 6
    names = list(list_experiments(Path(), config, 1))
    assert names == [
        "cloud", "networks", "arenas", "evolution", "physics", "laser", "films", "widened", "resolutions",
        "swarm",
    ]  # fmt: skip
    assert not {"resolutions", "swarm"} & set(list_experiments(Path(), QUICK, 1))
    assert {"gg", "gsrm", "simple", "boxes", "hfield", "prisms"} <= set(RECIPES)


def test_ratio_of_known_costs() -> None:
    reference = np.random.default_rng(0).uniform(90, 110, 200)
    ratio = find_ratio(1.2 * reference, reference)
    assert ratio["ratio"] == pytest.approx(1.2)
    assert ratio["low"] == pytest.approx(1.2)  # drawn in pairs: what slows both down does not count
    noisy = find_ratio(1.2 * np.random.default_rng(1).permutation(reference), reference)
    assert noisy["low"] < 1.2 < noisy["high"]
    assert noisy == find_ratio(1.2 * np.random.default_rng(1).permutation(reference), reference)
    assert summarize([1.0, 2.0, 6.0]) == {
        "mean": 3.0, "deviation": pytest.approx(2.1602469), "median": 2.0,
    }  # fmt: skip


def test_all_scan_methods_agree() -> None:
    arena = sg.load_arena("simple")
    casters = [TreeCaster(arena), TreeCaster(arena, on_contact=True), BruteForceCaster(arena.surface)]
    with contextlib.suppress(ImportError):
        casters.append(EmbreeCaster(arena.surface))
    for x in (-2.0, -0.45, 0.03):
        exact, *others = (caster(look_down(x)) for caster in casters)
        assert np.isfinite(exact).sum() > 100
        assert exact[180] == pytest.approx(1.5 - float(arena.height(x, 0.1)), abs=1e-4)  # the middle beam
        for ranges in others:
            both = np.isfinite(exact) & np.isfinite(ranges)
            assert both.sum() >= 0.98 * np.isfinite(exact).sum()
            assert np.abs(exact - ranges)[both].mean() < 1e-4


def test_the_scanner_stands_on_the_course_and_sees_it() -> None:
    arena = sg.load_arena("simple")
    poses = list_poses(arena, 7)
    assert np.allclose(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.eye(3))
    assert (poses[:, 2, 0] < -0.3).all()  # the middle beam looks down
    caster = TreeCaster(arena)
    assert all(np.isfinite(caster(pose)).mean() > 0.3 for pose in poses)


def test_contact_shapes_are_scanned_where_they_are() -> None:
    arena = sg.load_arena("simple")
    raised = [piece.copy().apply_translation([0, 0, 0.1]) for piece in arena.pieces]
    lifted = dataclasses.replace(arena, pieces=raised)
    pose = look_down(-0.45)
    difference = TreeCaster(lifted)(pose)[180] - TreeCaster(lifted, on_contact=True)(pose)[180]
    assert difference == pytest.approx(0.1, abs=1e-4)


def test_crossings_are_timed(champion: ev.Champion) -> None:
    config = dataclasses.replace(QUICK, runs=2, steps=80)
    samples = time_crossings(champion, {"simple": sg.load_arena("simple")}, config)["simple"]
    assert [len(values) for values in samples.values()] == [2, 2, 2, 2, 2]
    assert 0 <= min(samples["interrupted"]) <= max(samples["interrupted"]) <= 1
    assert min(samples["collision_us"]) > 0
    assert np.all(np.array(samples["physics_us"]) > np.array(samples["collision_us"]))
    assert min(samples["contacts"]) > 1


def test_frames_before_the_pit_half_way_and_last() -> None:
    positions = np.zeros((100, 3, 3))
    positions[:, 0, 0] = np.linspace(-2.35, 1.65, 100)  # the head is before the pit at half time
    assert select_frames(positions, 20) == [10, 14, 19]
    assert select_frames(positions - 5.0, 20) == [0, 10, 19]


def test_the_benchmark_may_be_absent_or_half_done(tmp_path: Path) -> None:
    absent = load_benchmark(tmp_path / "evolution.json")
    assert absent["machine"] is None
    assert not any([*absent["models"].values(), *(any(part.values()) for part in absent["stages"].values())])
    parts = {"models/gg 13860": {"of": 3}, "champions": {"of": 5}, "stages/gg 13860": {"of": 1}}
    path = tmp_path / "evolution.json"
    origin = {"machine": {}, "versions": {}}
    days = {"models/gg 13860": "2026-01-03", "champions": "2026-01-01", "stages/gg 13860": "2026-01-02"}
    origins = {part: {"date": day, **origin} for part, day in days.items()}
    path.write_text(json.dumps({"results": parts, "origins": origins}))
    found = load_benchmark(path)
    assert {name for name, part in found["models"].items() if part} == {"gsrm 2200", "gg 13860"}
    assert found["stages"]["gg 13860"] == {
        "fine_only": {"of": 3},
        "coarse_to_fine": {"of": 1},
        "compared": None,
    }
    assert found["date"] == "2026-01-01 to 2026-01-03"


def test_powers_of_growth() -> None:
    sizes = np.array([39, 4175, 13860])
    assert find_power(sizes, 3.0 * sizes**0.7) == pytest.approx(0.7)
    assert find_power(sizes, [5.0, 5.0, 5.0]) == pytest.approx(0.0)


def test_the_hand_made_model_is_the_truth_drawn_with_few_triangles() -> None:
    surface = cut_sides(sg.load_arena("simple").surface)
    measured = measure_surface(surface, sg.load_arena("truth").surface)
    assert measured["triangles"] == 18
    assert measured["boundary_loops"] == measured["euler_number"] == 1
    assert max(measured["truth_to_mesh_p95"], measured["mesh_to_truth"]) < 1e-6
