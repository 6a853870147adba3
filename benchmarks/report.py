"""Where benchmarks write what they measured, and on which machine."""

import datetime
import importlib.metadata
import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

from reconstruction.atomic_write import write_atomically

RESULTS = Path(os.environ.get("BENCHMARK_RESULTS", Path(__file__).parent / "results"))
PACKAGES = ("mujoco", "jax", "numpy", "scipy", "coacd", "cma", "gymnasium", "trimesh")


def describe_machine() -> dict[str, str | int | None]:
    """Return processor, cores, system and Python version."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line
        ]
        processor = names[0] if names else processor
    return {
        "processor": processor,
        "cores": os.cpu_count(),
        "system": platform.system(),
        "python": platform.python_version(),
    }


def describe_versions() -> dict[str, str]:
    """Return the versions of the packages that decide speed and results."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def load_records() -> dict[str, dict[str, Any]]:
    """Return what every benchmark wrote last, by its name."""
    return {path.stem: json.loads(path.read_text()) for path in sorted(RESULTS.glob("*.json"))}


def write_results(name: str, results: dict) -> Path:
    """Write `results/<name>.json` with machine, versions and date, in one step; return its path."""
    record = {
        "benchmark": name,
        "is_quick": "--quick" in sys.argv,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": describe_machine(),
        "versions": describe_versions(),
        "results": results,
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    path = RESULTS / f"{name}.json"
    with write_atomically(path) as beside:
        beside.write_text(json.dumps(record, indent=2) + "\n")
    return path
