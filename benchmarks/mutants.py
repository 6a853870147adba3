"""Break the code in small ways and count what no test notices (mutation testing, by mutmut).

    python -m benchmarks.mutants [--again] [--children N]

What to break and which tests ask stands in `[tool.mutmut]` of pyproject.toml. A run that was stopped goes on where
it was; it works in `mutants/`. Survivors are explained in docs/mutants.md.
"""

import argparse
import subprocess
import sys
from collections import Counter
from pathlib import Path

from mutmut.configuration import config
from mutmut.mutation.data import SourceFileMutationData
from mutmut.stats import status_by_exit_code

WANTED = 0.85
"""Share of the mutants of each file that must be killed; one that never ends is."""
COLUMNS = ("killed", "timeout", "survived", "no tests")


def read_statuses() -> dict[str, dict[str, str]]:
    """Return what came of each mutant, by file and name."""
    statuses = {}
    for path in config().only_mutate:
        mutants = SourceFileMutationData(path=Path(path))
        mutants.load()
        statuses[path] = {name: status_by_exit_code[code] for name, code in mutants.exit_code_by_key.items()}
    return statuses


def main() -> None:
    """Run and print a table; the exit code is 1 if a file has too few killed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.mutants",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--again", action="store_true", help="only those that survived, after tests were added"
    )
    parser.add_argument("--children", type=int, default=2, help="processes at once (default: 2)")
    options = parser.parse_args()
    names = []
    if options.again:
        everything = [pair for statuses in read_statuses().values() for pair in statuses.items()]
        names = [name for name, status in everything if status != "killed"]
    command = [sys.executable, "-m", "mutmut", "run", "--max-children", str(options.children), *names]
    if names or not options.again:
        subprocess.run(command, check=True)
    print(f"\n{'file':48}" + "".join(f"{name:>10}" for name in (*COLUMNS, "other", "score")))
    is_good = True
    for path, statuses in read_statuses().items():
        counts = Counter(statuses.values())
        cells = [counts[name] for name in COLUMNS]
        score = (counts["killed"] + counts["timeout"]) / max(len(statuses), 1)
        is_good &= score >= WANTED
        numbers = "".join(f"{cell:10}" for cell in (*cells, len(statuses) - sum(cells)))
        print(f"{path:48}{numbers}{score:10.1%}")
    print("\nmutmut results: the names of what survived; mutmut show NAME: what was changed")
    sys.exit(not is_good)


if __name__ == "__main__":
    main()
