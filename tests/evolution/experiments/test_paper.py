"""The paper's experiments: saved one by one, measured right, refused where they contradict what is there."""

import json
from pathlib import Path

import numpy as np
import pytest

import evolution as ev
import symbrion_gym as sg
from evolution._src.experiments import paper
from evolution._src.experiments.paper import (
    compute_ratio,
    cut_sides,
    list_poses,
    make_brute_force_caster,
    make_tree_caster,
    read_result,
    select_frames,
    summarize,
)
from reconstruction import measure_quality, silent

OPTIONS = {"quick": True, "seed": 0}


def look_down(x: float, height: float = 1.5) -> np.ndarray:
    """Return the pose of a scanner whose middle beam points down, its fan across the course's y axis."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]).T  # x down, y along the course
    pose[:3, 3] = x, 0.1, height
    return pose


def test_a_result_is_saved_once_and_read_again(tmp_path: Path) -> None:
    path = tmp_path / "experiments" / "cloud.json"
    paper.write_json(path, paper._time_work(lambda progress: {"values": [1.0, 2.0]}, lambda *_: None))
    result = read_result(path)
    assert result["figures"] == {"values": [1.0, 2.0]}
    assert "mujoco" in result["machine"]
    assert result["cpu_seconds"] >= 0


@pytest.mark.parametrize("text", ["{", "[]", '{"figures": 1}'])
def test_a_damaged_result_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "cloud.json").write_text(text)
    with pytest.raises(ev.RunError, match=r"cloud\.json is damaged"):
        read_result(tmp_path / "cloud.json")


def test_ratio_of_known_costs() -> None:
    reference = np.random.default_rng(0).uniform(90, 110, 200)
    ratio = compute_ratio(1.2 * reference, reference)
    assert ratio["ratio"] == pytest.approx(1.2)
    assert ratio["low"] == pytest.approx(1.2)  # drawn in pairs: what slows both down does not count
    noisy = compute_ratio(1.2 * np.random.default_rng(1).permutation(reference), reference)
    assert noisy["low"] < 1.2 < noisy["high"]
    assert noisy == compute_ratio(1.2 * np.random.default_rng(1).permutation(reference), reference)
    assert summarize([1.0, 2.0, 6.0]) == {
        "mean": 3.0, "deviation": pytest.approx(2.1602469), "median": 2.0,
    }  # fmt: skip


def test_all_scan_methods_agree() -> None:
    arena = sg.load_arena("simple")
    tree, brute_force = make_tree_caster(arena), make_brute_force_caster(arena)
    for x in (-2.0, -0.45, 0.03):
        exact, ranges = tree(look_down(x)), brute_force(look_down(x))
        assert np.isfinite(exact).sum() > 100
        assert exact[180] == pytest.approx(1.5 - float(arena.height(x, 0.1)), abs=1e-4)  # the middle beam
        both = np.isfinite(exact) & np.isfinite(ranges)
        assert both.sum() >= 0.98 * np.isfinite(exact).sum()
        assert np.abs(exact - ranges)[both].mean() < 1e-4


def test_the_scanner_stands_on_the_course_and_sees_it() -> None:
    arena = sg.load_arena("simple")
    poses = list_poses(arena, 7)
    assert np.allclose(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.eye(3))
    assert (poses[:, 2, 0] < -0.3).all()  # the middle beam looks down
    caster = make_tree_caster(arena)
    assert all(np.isfinite(caster(pose)).mean() > 0.3 for pose in poses)


@pytest.mark.slow
def test_crossings_are_timed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = tuple(f"g{index}" for index in range(8))
    champion = ev.Champion(
        genotype=(-0.1, 0.0, 0.0, -0.1, 0.0, 1.1, 0.0, -0.6),
        names=names,
        controller="reactive",
        arena="simple",
    )
    monkeypatch.setattr(paper, "load_champion", lambda folder: champion)
    monkeypatch.setattr(
        paper, "RECIPES", {"simple": paper.RECIPES["simple"], "boxes": paper.RECIPES["boxes"]}
    )
    monkeypatch.setattr(paper, "STEPS", 80)
    for name in paper.RECIPES:
        sg.load_arena("simple").save(tmp_path / "arenas" / name)
    sizes = paper.PaperSizes(runs=2)
    measured = paper.measure_physics(tmp_path, sizes, seed=0, progress=silent)
    assert 0 <= measured["interrupted"] <= 1
    for row in measured["rows"]:
        assert 0 < row["collision_us"]["mean"] < row["physics_us"]["mean"]
        assert row["contacts"] > 1
    assert set(measured["ratios"]) == {"boxes"}
    json.dumps(measured)


def test_frames_before_the_pit_half_way_and_last() -> None:
    positions = np.zeros((100, 3, 3))
    positions[:, 0, 0] = np.linspace(-2.35, 1.65, 100)  # the head is before the pit at half time
    assert select_frames(positions, 20) == [10, 14, 19]
    assert select_frames(positions - 5.0, 20) == [0, 10, 19]


def test_the_hand_made_model_is_the_truth_drawn_with_few_triangles() -> None:
    surface = cut_sides(sg.load_arena("simple").surface)
    quality = measure_quality(surface, truth=sg.load_arena("truth").surface)
    assert len(surface.faces) == 18
    assert quality.topology.boundary_loops == quality.topology.euler_number == 1
    assert quality.truth_to_mesh is not None
    assert quality.mesh_to_truth is not None
    assert max(quality.truth_to_mesh.p95, quality.mesh_to_truth.max) < 1e-6
