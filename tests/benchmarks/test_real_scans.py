"""Scenes, sources and bars of the benchmark of real scans."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.material.bars import BARS, find_figures, format_bars, format_peers, summarise
from benchmarks.material.contact_judge import cast
from benchmarks.material.made_scenes import RANGE_NOISE, make_noise_heights, make_table, save
from benchmarks.material.scan_sources import PUBLIC, MissingScanError, load_case, load_file
from benchmarks.material.snake_steps import find_spots
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course

ROW = {
    "points": 50_000,
    "made": {"accuracy": 0.01, "cpu_s": 90.0, "memory_gb": 0.5},
    "surface": {"points_mean": 0.006, "points_p95": 0.01, "beams": 0.9},
    "poisson": {"points_mean": 0.005, "points_p95": 0.01},
    "contact": {"ours": {"contact_mean": 0.012, "contact_p95": 0.05, "uncovered": 0.0, "beams": 0.9}},
}


def test_a_made_scan_is_repeatable_and_lies_on_its_truth() -> None:
    first, second = make_table(), make_table()
    assert np.array_equal(first.points, second.points)
    assert first.truth.is_watertight
    assert first.seen_from.max() == len(first.viewpoints) - 1
    beams = first.points - first.viewpoints[first.seen_from]
    lengths = np.linalg.norm(beams, axis=1)
    exact = cast(first.truth, first.viewpoints[first.seen_from], beams / lengths[:, None])
    off = lengths - exact
    assert np.std(off) == pytest.approx(RANGE_NOISE, rel=0.05)
    assert not first.truth.contains(first.viewpoints).any()


def test_noise_has_the_wanted_relief_and_no_short_waves() -> None:
    heights = make_noise_heights(np.random.default_rng(0), 128, 10.0, 1.0)
    assert heights.std() == pytest.approx(1.0)
    power = np.abs(np.fft.rfft2(heights))
    assert power[0, 11:].max() < 1e-9 * power.max()


def test_a_scene_survives_its_file(tmp_path: Path) -> None:
    made = make_table()
    save(tmp_path / "mine.npz", made)
    case = load_file(tmp_path / "mine.npz")
    assert np.array_equal(case.points, made.points)
    assert case.truth is not None
    assert case.origins is not None
    assert np.array_equal(case.origins[0], made.viewpoints[0])


def test_an_absent_scan_says_where_it_comes_from(tmp_path: Path) -> None:
    with pytest.raises(MissingScanError, match=r"street: small_gicp_street.ply \(koide3/small_gicp"):
        load_case("street", [tmp_path])


def test_an_airborne_scan_has_vertical_beams_and_no_viewpoint(tmp_path: Path) -> None:
    scan = PUBLIC["wooded hills"]
    points = np.random.default_rng(0).uniform(0, 1000, (50, 3))
    lines = "\n".join(" ".join(f"{value:.3f}" for value in point) for point in points)
    header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 50\nHEIGHT 1\nPOINTS 50\n"
    (tmp_path / scan.file).write_text(f"{header}DATA ascii\n{lines}\n")
    case = load_case("wooded hills", [tmp_path])
    assert case.viewpoints is None
    assert case.origins is not None
    assert np.allclose(case.origins[:, :2], case.points[:, :2])
    assert np.ptp(case.points, axis=0).max() < 20


def test_figures_are_ratios_of_what_was_measured() -> None:
    figures = find_figures(ROW)
    assert figures["contact_over_accuracy"] == pytest.approx(1.2)
    assert figures["p95_over_accuracy"] == pytest.approx(5.0)
    assert figures["beams_over_surface"] == pytest.approx(1.0)
    assert figures["cpu_s_per_100k"] == 90.0, "a small cloud gets no less time"
    assert figures["free_space"] is None


def test_a_route_on_top_of_a_ceiling_is_none() -> None:
    drive = {"route": 1.0, "arrived": 16, "left_ground": 0, "unseen_ends": 1}
    assert find_figures(ROW | {"drive": drive})["route"] == 0
    assert find_figures(ROW | {"drive": drive | {"unseen_ends": 0}})["route"] == 1
    assert find_figures(ROW | {"drive": {"route": 0.0, "failed": "no ground"}})["arrived"] is None


def test_a_scene_without_an_arena_is_counted_and_named() -> None:
    rows = {"good": ROW, "bad": {"points": 10, "failed": "coacd took too long"}}
    summary = summarise(rows)
    assert summary["scenes"] == {"of": 2, "met": 1}
    assert summary["p95_over_accuracy"] == {"worst": pytest.approx(5.0), "met": 0, "of": 1}
    text = "\n".join(format_bars(rows))
    assert "coacd took too long" in text
    assert "5.00 !" in text
    assert "ours" in "\n".join(format_peers(rows))
    assert set(find_figures(ROW)) == set(BARS)


def test_the_snake_is_dropped_on_ground() -> None:
    arena = Arena.from_course(Course())
    spots = find_spots(arena)
    assert len(spots) == 3
    for spot in spots:
        assert spot.position[2] >= arena.height(*spot.position[:2]) - 1e-6
    low, high = find_spots(arena, below=0.01), find_spots(arena)
    assert max(arena.height(*spot.position[:2]) for spot in low) < 0.01
    assert max(arena.height(*spot.position[:2]) for spot in high) > 0.01
