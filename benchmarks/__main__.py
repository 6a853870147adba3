"""Run every benchmark in a separate process, then write the tables.

    python -m benchmarks [--quick] [NAME ...]

A quick run writes its results and its table to `benchmarks/results/quick` and does not change the README.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent


def find_benchmarks() -> list[str]:
    """Return the names of the modules in this folder that can be run."""
    return sorted(
        path.stem for path in FOLDER.glob("*.py") if re.search(r"^def run\(", path.read_text(), re.MULTILINE)
    )


def main() -> None:
    """Read the command line and run; a benchmark that fails does not stop the others."""
    names = find_benchmarks()
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"which to run (default: all): {', '.join(names)}"
    )
    parser.add_argument("--quick", action="store_true", help="smaller sizes and fewer repetitions")
    options = parser.parse_args()
    unknown = set(options.names) - set(names)
    if unknown:
        parser.error(f"no such benchmark: {', '.join(sorted(unknown))}; there are {', '.join(names)}")
    environment, switch = dict(os.environ), []
    if options.quick:
        environment["BENCHMARK_RESULTS"], switch = str(FOLDER / "results" / "quick"), ["--quick"]
    failed = []
    for name in options.names or names:
        print(f"\n== {name} ==", flush=True)
        if _run([f"benchmarks.{name}", *switch], environment):
            failed.append(name)
    if _run(["benchmarks.table", *(["--table-only"] if options.quick else [])], environment):
        failed.append("table")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


def _run(words: list[str], environment: dict[str, str]) -> int:
    return subprocess.run([sys.executable, "-m", *words], env=environment, check=False).returncode


if __name__ == "__main__":
    main()
