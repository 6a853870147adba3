"""Claims of swarms: each bar is read from the names that the benchmark writes; what is not measured is left out."""

from typing import Any

import pytest

from benchmarks.claims.sources import find_sources
from benchmarks.claims.swarm import SWARM
from benchmarks.swarm import PARTS

DRIVES = {"largest_difference": 0.08, "median_difference": -0.01}
LEVEL = {"lost": 0, "not_finite": 0, "steps": 1_000_000, "deepest": 0.01, "gain": 1e-6}
TOLD = {"successes": 17, "stories": [{"success": True}] * 20}
TRIALS = {"locked": 55, "trials": 57, "quantiles_s": {"0.5": 35.0}}
FASTER = {"disjoint": True, "evolved": {"median": 300.0}, "authors": {"median": 400.0}}
RESULTS: dict[str, Any] = {
    "docks": {
        "jump_mm": 0.05,
        "jump_deg": 0.02,
        "momentum_share": 1e-12,
        "changes": 400,
        "drift_mm": 0.6,
        "drift_deg": 0.3,
    },
    "crossing": {"assembled": 17, "placed": 18, "trials": 20, "probability_of_chance": 1.0},
    "speed": {"times_real_time": {"truth": 20.0, "gsrm": 18.0}},
    "kinematic": {
        "speed": {name: {"times_real_time": 22.0} for name in ("truth", "gsrm", "gg")},
        "times": dict.fromkeys(("flat", "ramp", "6 deg", "12 deg", "16 deg"), DRIVES),
    },
    "batch": {"times_faster": 8.0, "different_numbers": 0},
    "random": dict.fromkeys(("kinematic", "mixed", "dynamic"), LEVEL),
    "docking": {
        "rate_within": True,
        "median_within": True,
        "simulated_judged": TRIALS,
        "hardware_judged": TRIALS,
    },
    "story": {"gsrm": TOLD, "truth": TOLD, "without_docking": {"successes": 0, "trials": 20}},
    "weights": {"gsrm": FASTER, "truth": FASTER},
}


def test_every_bar_holds_for_results_that_hold() -> None:
    records = {"swarm": {"results": RESULTS}}
    for claim in SWARM:
        assert claim.is_measured(records), claim.what
        assert claim.bar, claim.what
        assert claim.format(records)
        assert claim.check_bar(records).endswith("met"), claim.what


def test_every_part_of_the_benchmark_is_claimed_and_has_sources() -> None:
    parts = {value.path.split("/")[0] for claim in SWARM for value in claim.values}
    assert parts == set(RESULTS)
    assert parts <= set(PARTS)
    for part in PARTS:
        assert find_sources("swarm", part)


@pytest.mark.parametrize("part", sorted(RESULTS))
def test_what_is_not_measured_is_left_out(part: str) -> None:
    records = {"swarm": {"results": {name: value for name, value in RESULTS.items() if name != part}}}
    left_out = [claim for claim in SWARM if not claim.is_measured(records)]
    assert left_out
    assert all(claim.values[0].path.startswith(part) for claim in left_out)


def test_a_figure_beyond_its_bar_is_missed() -> None:
    results = {**RESULTS, "story": {**RESULTS["story"], "gsrm": {**TOLD, "successes": 15}}}
    missed = [claim for claim in SWARM if "missed" in claim.check_bar({"swarm": {"results": results}})]
    assert [claim.what for claim in missed] == [
        "Eight scattered robots gather, cross the pit of the scanned arena as one body and part: successes of trials"
    ]
