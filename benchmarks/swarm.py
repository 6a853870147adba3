"""Swarms: docks, physics at two levels, senses, behavior.

Run as `python -m benchmarks.swarm [--only PART ...] [--quick]`. Each part is a function of a module in
`benchmarks/material`; figures are written as soon as a part is done. Times are processor times of one core.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from typing import Any

from benchmarks.report import write_results

PARTS = {
    "docks": "benchmarks.material.swarm_docks:measure_docks",
    "crossing": "benchmarks.material.swarm_crossing:measure_crossing",
    "speed": "benchmarks.material.swarm_docks:measure_speed",
    "kinematic": "benchmarks.material.swarm_kinematic:measure_kinematic",
    "batch": "benchmarks.material.swarm_batch:measure_batch",
    "docking": "benchmarks.material.swarm_behavior:measure_docking",
    "story": "benchmarks.material.swarm_behavior:measure_story",
    "weights": "benchmarks.material.swarm_weights:measure_weights",
    "random": "benchmarks.material.swarm_random:measure_random",
}
"""Part -> module and function, which takes `quick`."""


def run(quick: bool = False, parts: tuple[str, ...] = tuple(PARTS)) -> dict[str, Any]:
    """Measure and return the parts.

    Args:
        quick: small samples.
        parts: of `PARTS`.
    """
    results: dict[str, Any] = {}
    for part in parts:
        module, function = PARTS[part].split(":")
        results[part] = getattr(import_module(module), function)(quick)
        print(part, results[part], flush=True)
        write_results("swarm", {part: results[part]})
    return results


def main() -> None:
    """Parse the command line and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=tuple(PARTS), default=tuple(PARTS))
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    run(options.quick, tuple(options.only))


if __name__ == "__main__":
    main()
