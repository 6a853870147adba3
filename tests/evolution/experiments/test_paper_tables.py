"""The tables of the paper's page: our figures, those of the paper next to them, machine and runs in the caption."""

from pathlib import Path

from evolution._src.experiments.paper.benchmark import load_benchmark
from evolution._src.experiments.paper.page import tables
from evolution._src.experiments.paper.page.swarm import tabulate_stories

ABOUT = {"machine": "a processor, mujoco 4.0.0", "date": "2026-11-21", "seconds": 1.0}
COST = {"mean": 50.0, "deviation": 2.0, "median": 49.0}
RATIO = {"ratio": 1.05, "low": 1.01, "high": 1.09}


def record(figures: object) -> dict:
    """Return a record of an experiment."""
    return {"figures": figures, **ABOUT}


def check(table: tables.Table) -> list[list[str]]:
    """Check what every table owes its reader; return its cells as text."""
    assert all(len(row) == len(table.columns) for row in table.rows)
    assert "a processor, mujoco 4.0.0" in table.caption
    assert "2026-11-21" in table.caption
    return [[str(cell) for cell in row] for row in table.rows]


def test_table_1_has_the_figures_of_the_paper() -> None:
    row = {
        "network": "gsrm_2200", "method": "gsrm", "size": 2200, "triangles": 4231, "cold_seconds": None,
        "warm_seconds": 0.2, "truth_to_mesh": 0.001, "truth_to_mesh_p95": 0.003, "mesh_to_truth": 0.0007,
        "boundary_loops": 1,
    }  # fmt: skip
    other = row | {"network": "gsrm_800", "size": 800, "cold_seconds": 3.21}
    by_hand = row | {"network": "simple", "size": None, "triangles": 38, "warm_seconds": None}
    first, second, third = check(tables.tabulate_networks(record([row, other, by_hand])))
    assert first == ["GSRM 2,200 units", "4,231", "4,175", "-", "0.20", "20", "1.00", "3.00", "0.70", "1"]
    assert second[:6] == ["GSRM 800 units", "4,231", "-", "3.2", "0.20", "-"]  # the paper has no such figure
    assert third[:6] == ["hand-made", "38", "39", "-", "-", "-"]


def test_table_2_has_ratios_and_runs() -> None:
    row = {"arena": "gg", "text": "growing grid, convex pieces", "pieces": 4, "triangles": 13858, "physics_us": COST,
           "collision_us": COST, "contacts": 5.8, "crossed": 2}  # fmt: skip
    rows = [row, row | {"arena": "simple"}, row | {"arena": "prisms", "pieces": 4231}]
    ratios = {name: {"physics_us": RATIO, "collision_us": RATIO} for name in ("gg", "prisms")}
    table = tables.tabulate_physics(
        record({"runs": 3, "steps": 3500, "interrupted": 0.012, "rows": rows, "ratios": ratios})
    )
    gg, simple, prisms = check(table)
    assert gg == ["growing grid, convex pieces", "4", "5.8", "50.0 ± 2.0", "147-152", "50.0 ± 2.0", "825-846",
                  "1.05 (1.01 to 1.09)", "2 of 3"]  # fmt: skip
    assert simple[7] == "1"
    assert prisms[1] == "4,231"
    assert prisms[4] == prisms[6] == "-"
    assert "3 runs of 3,500 steps" in table.caption
    assert "1.2 %" in table.caption


def test_table_3_has_the_ratio_of_the_paper() -> None:
    row = {"model": "gg", "method": "tree", "triangles": 13858, "scan_us": COST, "scans": 100, "error": None}
    rows = [row | {"method": "hulls", "triangles": 0, "error": 0.0013}, row]
    ratios = {"tree": {"gg": RATIO}, "brute force": {"gg": RATIO}}
    tree, hulls = check(
        tables.tabulate_laser(record({"beams": 361, "hits": 0.5, "rows": rows, "ratios": ratios}))
    )
    assert tree[4:7] == ["362,000", "1.05 (1.01 to 1.09)", "66"]
    assert hulls[4:8] == ["-", "-", "-", "1.3"]


def test_cloud_arenas_and_resolutions() -> None:
    steps = [{"step": "raw", "readings": 664784, "mean": 0.02, "p95": 0.05}]
    cells = check(tables.tabulate_cloud(record({"scans": 2734, "beams": 361, "steps": steps})))
    assert cells == [["raw", "664,784", "20.0", "50.0"]]
    arena = {"arena": "hfield", "text": "a field", "pieces": 0, "triangles": 4231, "seconds": 0.1,
             "mean": None, "p95": None}  # fmt: skip
    assert check(tables.tabulate_arenas(record([arena])))[0][3:] == ["-", "0.1", "-", "-"]
    row = {"model": "gg_210", "triangles": 210, "pieces": 5, "genotypes": 48, "validated": [46, 48],
           "successes": 19, "trials": 20}  # fmt: skip
    cells = check(tables.tabulate_resolutions(record([row])))
    assert cells == [["GG 210 triangles", "210", "5", "48", "46 of 48", "no", "19 of 20"]]


def test_the_widened_pit_has_a_before_and_an_after() -> None:
    surface = {"surface": "refined", "triangles": 4278, "seconds": 1.5, "truth_to_mesh": 0.002,
               "truth_to_mesh_p95": 0.006, "mesh_to_truth": 0.0017, "boundary_loops": 1}  # fmt: skip
    runs = {
        when: {"genotypes": 48, "judged": {"narrow": {"successes": 9, "trials": 10},
                                           "wide": {"successes": successes, "trials": 10}}}
        for when, successes in (("before", 0), ("after", 8))
    }  # fmt: skip
    figures = {"pit": [0.35, 0.40], "surfaces": [surface], **runs}
    check(tables.tabulate_widened(record(figures)))
    table = tables.tabulate_widened_champions(record(figures))
    assert list(table.columns[2:]) == ["trials crossed, pit of 35 cm", "trials crossed, pit of 40 cm"]
    before, after = check(table)
    assert before[1:] == ["48", "9 of 10", "0 of 10"]
    assert after[1:] == ["48", "9 of 10", "8 of 10"]


def test_the_benchmark_is_quoted_with_its_machine() -> None:
    origin = {"date": "2026-11-21", "commit": "0123456789"}
    runs = [
        {"held_in_truth": 20, "confirmed": True, "origin": origin, "judging_seed": 1},
        {"held_in_truth": 17, "confirmed": True, "origin": origin | {"commit": None}},
        {"held_in_truth": 19, "confirmed": False, "origin": origin | {"date": "2026-11-20"}},
    ]
    result = {"champions_that_hold": 1, "of": 3, "median_genotypes": 1180.0, "median_cpu_seconds": 60.2,
              "unconfirmed": 1, "unconfirmed_that_hold": 1, "runs": runs}  # fmt: skip
    about = {"machine": {"processor": "a processor", "cores": 2}, "versions": {"mujoco": "4.0.0"}}
    benchmark = {
        "models": {"gsrm 2200": result, "gg 210": None},
        "stages": {"gsrm 2200": {"fine_only": result, "coarse_to_fine": None, "compared": None}},
        "date": "2026-11-21",
        **about,
    }
    table = tables.tabulate_models(benchmark)
    measured = "2026-11-20, 2026-11-21; 0123456"
    assert table.rows[0] == ["GSRM 2,200 units", "1 of 3", "1 (1)", "1,180", "60", measured, "20, 17", "19"]
    assert table.rows[1] == ["GG 210 triangles", "not measured", *["-"] * 6]
    assert "2 of 3 runs were judged with fixed seeds" in table.caption
    assert "a processor, 2 cores, mujoco 4.0.0" in table.caption
    table = tables.tabulate_stages(benchmark)
    assert table.rows[0][0] == "GSRM 2,200 units only"
    assert table.rows[1][0] == "first GSRM 800 units, then GSRM 2,200 units"
    assert [row[1] for row in table.rows] == ["1 of 3", "not measured"]
    assert "times" not in table.caption
    benchmark["stages"]["gsrm 2200"]["compared"] = {
        "times_less_cpu_seconds": 1.4,
        "times_less_genotypes": 1.6,
    }
    assert "0.7 times the processor time" in tables.tabulate_stages(benchmark).caption


def test_an_absent_benchmark_is_reported() -> None:
    table = tables.tabulate_models(load_benchmark(Path("nowhere")))
    assert {row[1] for row in table.rows} == {"not measured"}
    assert "no results of the benchmark" in table.caption


def test_stories_of_a_swarm_without_an_organism_have_no_times() -> None:
    story = {"seed": 0, "gathered": 474.7, "crossed": 511.02, "recoveries": 18, "across": 8}
    failed = {"seed": 1, "gathered": None, "crossed": None, "recoveries": 60, "across": 0}
    first, second = check(tabulate_stories(record({"stories": [story, failed]})))
    assert first == ["0", "474.7", "511.02", "18", "8"]
    assert second == ["1", "-", "-", "60", "0"]
