"""Startup cost: imports, the first environment, help and error messages of the command.

    python -m benchmarks.imports [--quick]

Each program runs in fresh processes, alternating with `import mujoco, gymnasium, trimesh`, which every user of the
environments needs; the ratio is computed for each round.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.report import write_results

ROOT = Path(__file__).parents[1]
BASE = "import mujoco, gymnasium, trimesh"
COMMAND = "import sys; from evolution.__main__ import main; sys.argv[1:] = {words!r}; main()"
PROGRAMS = {
    BASE: BASE,
    "import reconstruction": "import reconstruction",
    "import symbrion_gym": "import symbrion_gym",
    "import evolution": "import evolution",
    "gym.make and reset, gsrm": (
        "import gymnasium, symbrion_gym; gymnasium.make('symbrion_gym/SnakePit-v1', arena='gsrm').reset(seed=0)"
    ),
    "symbrion --help": COMMAND.format(words=["--help"]),
    "symbrion evolve --arena nonsense": COMMAND.format(words=["evolve", "--arena", "nonsense"]),
}


class Cost(NamedTuple):
    """Cost of a process: processor time [s], wall time [s], peak memory [MB]."""

    cpu_seconds: float
    wall_seconds: float
    memory_mb: float


def measure(program: str) -> Cost:
    """Run a program in a fresh process in an empty folder and return its cost."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        began = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-c", program],
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - began
    is_refusal = "nonsense" in program
    if process.returncode != (2 if is_refusal else 0):
        raise RuntimeError(f"{program!r} ended with code {process.returncode}")
    return Cost(usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss / 1024)


def run(quick: bool = False) -> dict:
    """Measure all programs, alternating; print a table and write results/imports.json."""
    for program in PROGRAMS.values():  # the first process reads from the disk
        measure(program)
    rounds = [
        {name: measure(program) for name, program in PROGRAMS.items()} for _ in range(3 if quick else 15)
    ]
    results: dict = {}
    print(f"{'program':36s}{'cpu s':>8s}{'of base':>9s}{'wall s':>8s}{'MB':>7s}")
    for name in PROGRAMS:
        costs = [one[name] for one in rounds]
        row = {field: statistics.median(getattr(cost, field) for cost in costs) for field in Cost._fields}
        row["cpu_ratio"] = statistics.median(one[name].cpu_seconds / one[BASE].cpu_seconds for one in rounds)
        results[name] = row
        figures = f"{row['cpu_seconds']:8.2f}{row['cpu_ratio']:9.2f}{row['wall_seconds']:8.2f}"
        print(f"{name:36s}{figures}{row['memory_mb']:7.0f}")
    write_results("imports", results)
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="3 rounds instead of 15")
    run(parser.parse_args().quick)
