"""Measure the evidence: `python -m benchmarks.evidence [NAME ...] [--out FILE]`, then print and write the table.

Rows that are there are kept where they are of the same commit. `--check` refuses evidence of other code than is here: a
release is a commit whose evidence was made from it.

One process after the other, so that no row disturbs another. Results: benchmarks/results/evidence.json (with commit,
day and machine) and docs/evidence.md, from which README and docs quote. Environment variables name peers that are built
elsewhere: GNN_GSRM (the authors' program), OPEN3D_PYTHON (a Python that has Open3D).
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from benchmarks.evidence import contact, evolving, robustness, speed, surfaces  # noqa: F401  (they register rows)
from benchmarks.evidence.row import ROWS
from benchmarks.report import COMMIT, run_git

RESULTS = Path(__file__).parents[1] / "results" / "evidence.json"
PAGE = Path(__file__).parents[2] / "docs" / "evidence.md"
PACKAGES = ("mujoco", "jax", "numpy", "coacd", "cma", "gymnasium")
NO_CODE = ("docs", "README.md", "CHANGELOG.md", "benchmarks/results", "benchmarks/submissions")
"""What may change after the evidence was made."""
STUDIES = (
    ("physics", "2026-11-26", "`python -m benchmarks.physics`"),
    ("environment", "2026-11-27", "`python -m benchmarks.tasks`"),
    ("suite", "2026-11-28", "`symbrion bench-suite`"),
    ("gpu", "2026-11-23 to 26", "`python -m benchmarks.warp`"),
    ("own-scan", "2026-11-26", "by hand"),
    ("your-own-robot", "2026-11-22", "by hand"),
    ("swarm", "2026-11-23", "by hand"),
    ("bodies", "2026-11-23", "by hand"),
)
"""Pages with other figures, when they were measured, and how."""
LONGEST = 3600.0
"""A row that takes longer is ended [s]."""


def describe() -> dict[str, Any]:
    """Return commit, day, machine and versions."""
    names = [
        line.split(":")[1].strip() for line in _read("/proc/cpuinfo").splitlines() if "model name" in line
    ]
    return {
        "commit": COMMIT,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": f"{os.cpu_count()} cores of {names[0] if names else platform.machine()}, {platform.system()}",
        "versions": {"python": platform.python_version()} | {name: version(name) for name in PACKAGES},
    }


def _read(path: str) -> str:
    return Path(path).read_text() if Path(path).exists() else ""


def measure(name: str) -> dict[str, Any]:
    """Measure a row in a process of its own."""
    begin = time.perf_counter()
    words = [sys.executable, "-m", "benchmarks.evidence", name, "--here"]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as process:
        try:
            said, errors = process.communicate(timeout=LONGEST)
            reason = (errors.strip() or "?").splitlines()[-1]
            found = {"failed": reason} if process.returncode else json.loads(said.strip().splitlines()[-1])
        except subprocess.TimeoutExpired:
            found = {"failed": f"took longer than {LONGEST:.0f} s"}
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)  # its workers, too, which would disturb the next row
    return found | {"wall_s": round(time.perf_counter() - begin, 1)}


def make_page(record: dict[str, Any]) -> str:
    """Return the table as a page of the documentation."""
    about = record["about"]
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    lines = ["# Evidence", "", "`make evidence` measures this page.", "",
             f"Commit {str(about['commit'])[:12]}, {about['date']}, {about['machine']}; {versions}."]  # fmt: skip
    for group in dict.fromkeys(row.group for row in ROWS.values()):
        lines += ["", f"## {group}", "", "| what | measured | asked |", "|---|---|---|"]
        for row in (row for row in ROWS.values() if row.group == group):
            found = record["rows"].get(row.name, {"missing": "not measured"})
            said = found.get("said") or f"*{found.get('missing') or found.get('failed')}*"
            lines.append(f"| {row.what} (`{row.name}`) | {said} | {row.judge(found)} |")
    lines += ["", "## Studies", "", "Figures on these pages were measured once:", ""]
    lines += [f"- [{page}]({page}.md): {date}, {how}" for page, date, how in STUDIES]
    return "\n".join(lines) + "\n"


def check_tree(record: dict[str, Any]) -> None:
    """Refuse evidence that is not whole, or was made of other code than that in the tree."""
    commit, rows = record.get("about", {}).get("commit"), record.get("rows", {})
    missing = {name for name in ROWS if rows.get(name, {"failed": "not measured"}).get("failed")}
    if missing:
        sys.exit(f"the evidence lacks, or failed at, {', '.join(sorted(missing))}; make evidence")
    changed = run_git("diff", "--name-only", commit, "--", ".", *(f":(exclude){path}" for path in NO_CODE))
    if changed != "":
        sys.exit(f"the evidence is of {commit}, after which the code changed: {changed}; make evidence")


def main() -> None:
    """Read the command line, measure, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", choices=[[], *ROWS], metavar="NAME", help=f"rows: {', '.join(ROWS)}"
    )
    parser.add_argument("--out", type=Path, help="write the results here, and no page")
    parser.add_argument("--check", action="store_true", help="measure nothing, but refuse old evidence")
    parser.add_argument("--here", action="store_true", help="measure in this process and print JSON")
    options = parser.parse_args()
    if options.here:
        for name in options.names:
            print(json.dumps(ROWS[name].measure(), default=float))
        return
    target = options.out or RESULTS
    record = json.loads(target.read_text()) if target.exists() else {}
    if options.check:
        check_tree(record)
        return
    if not options.names or record.get("about", {}).get("commit") != COMMIT:
        record = {"rows": {}}
    record["about"] = describe()
    for name in options.names or ROWS:
        record["rows"][name] = measure(name)
        print(f"{name}: {record['rows'][name].get('said', record['rows'][name])}", flush=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(json.dumps(record, indent=1) + "\n")
    if options.out is None:
        PAGE.write_text(make_page(record))


if __name__ == "__main__":
    main()
