"""Writing and reading of results: each part with its day, commit, machine and versions.

    {"benchmark": name, "origins": {part: origin}, "results": {part: figures}}

An origin contains `date`, `commit`, `dirty` (whether the code differed from the commit), `is_quick`, `machine` and
`versions`; `commit` is None outside a checkout. If `from_history` is true, the commit is the one that added the
figures, which were measured before origins were recorded.
"""

import datetime
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

from reconstruction._src.base.atomic_write import write_atomically

RESULTS = Path(os.environ.get("BENCHMARK_RESULTS", Path(__file__).parent / "results"))
PACKAGES = ("mujoco", "jax", "numpy", "scipy", "coacd", "cma", "gymnasium", "trimesh")


def run_git(*words: str) -> str | None:
    """Return what a git command prints at the root; None where it fails or there is no git."""
    try:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, check=True, timeout=60, text=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


ROOT = Path(__file__).resolve().parent.parent
COMMIT = run_git("rev-parse", "HEAD")
"""Found at import: later changes of the files do not affect a running benchmark."""
IS_DIRTY = bool(run_git("status", "--porcelain", "--", ".", ":(exclude)benchmarks/results"))
"""Whether the code differs from that commit."""


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
    """Return the versions of the packages that influence speed and results."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def load_record(name: str) -> dict[str, Any]:
    """Return the last results of a benchmark; empty `origins` and `results` if there are none.

    Figures without an origin are ignored.
    """
    path = RESULTS / f"{name}.json"
    record = json.loads(path.read_text()) if path.exists() else {"results": {}}
    origins = record.get("origins", {})
    results = {part: figures for part, figures in record["results"].items() if part in origins}
    return record | {"origins": origins, "results": results}


def describe_moment() -> dict[str, Any]:
    """Return day and commit of a measurement made now."""
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "commit": COMMIT,
        "dirty": IS_DIRTY,
    }


def write_results(name: str, measured: dict[str, Any]) -> Path:
    """Write parts to `results/<name>.json` in one step; return its path.

    Args:
        name: of the benchmark.
        measured: part -> figures; other parts keep their figures and origins.
    """
    origin = {
        **describe_moment(),
        "is_quick": "--quick" in sys.argv,
        "machine": describe_machine(),
        "versions": describe_versions(),
    }
    last = load_record(name)
    record = {
        "benchmark": name,
        "origins": last["origins"] | dict.fromkeys(measured, origin),
        "results": last["results"] | measured,
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    path = RESULTS / f"{name}.json"
    with write_atomically(path) as temporary:
        temporary.write_text(json.dumps(record, indent=2) + "\n")
    return path


class Results:
    """The file of results; a new measurement replaces only its own part.

    Args:
        name: of the file in `benchmarks/results`.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    @property
    def content(self) -> dict[str, Any]:
        """The present content of the file; another process may have added to it."""
        return load_record(self._name)["results"]

    def put(self, part: str, figures: dict[str, Any]) -> None:
        """Write a part."""
        write_results(self._name, {part: figures})
