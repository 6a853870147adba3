"""Mutation testing with mutmut: change the code in small ways and count the changes that no test notices.

    python -m benchmarks.mutants [--share S] [--again] [--children N] [--table]

`[tool.mutmut]` in pyproject.toml lists the files to change and the tests to run. An interrupted run continues; it works
in `mutants/`. docs/mutants.md explains the survivors.
"""

import argparse
import math
import random
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from mutmut.__main__ import _run as run_mutmut
from mutmut.configuration import config
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.file_mutation import mutate_file_contents
from mutmut.runners.harness import PytestRunner
from mutmut.state import state
from mutmut.stats import status_by_exit_code
from mutmut.utils.format_utils import get_mutant_name

TARGET = 0.85
"""Share of the mutants of each file that must be killed; those that time out count as killed."""
COLUMNS = ("killed", "timeout", "survived", "no tests")
NOT_CHECKED = "not checked"


def read_statuses() -> dict[str, dict[str, str]]:
    """Return the status of each tested mutant, by file and name."""
    statuses = {}
    for path in config().only_mutate:
        mutants = SourceFileMutationData(path=Path(path))
        mutants.load()
        named = {name: status_by_exit_code[code] for name, code in mutants.exit_code_by_key.items()}
        statuses[path] = {name: status for name, status in named.items() if status != NOT_CHECKED}
    return statuses


def draw_names(share: float, seed: int = 0) -> list[str]:
    """Return the names of a share of the mutants of each file; a larger share contains a smaller one."""
    drawn = []
    for path in config().only_mutate:
        mutated = mutate_file_contents(path, Path(path).read_text())
        names = [get_mutant_name(Path(path), name) for name in mutated.mutant_names]
        random.Random(seed).shuffle(names)
        drawn += names[: math.ceil(share * len(names))]
    return drawn


def select_names(share: float, again: bool) -> list[str] | None:
    """Return the mutants to test; None for all that were not tested yet."""
    statuses = {name: status for each in read_statuses().values() for name, status in each.items()}
    if again:
        return [name for name, status in statuses.items() if status != "killed"]
    return None if share >= 1 else [name for name in draw_names(share) if name not in statuses]


def run_mutants(names: Sequence[str], children: int) -> None:
    """Test the mutants of these names; without names, all that were not tested yet.

    The fastest tests of a mutant run first: most mutants are killed by one of these.
    """
    run_tests = PytestRunner.run_tests

    def run_fastest_first(self: PytestRunner, *, mutant_name: str | None, tests: Iterable[str]) -> int:
        seconds = state().duration_by_test
        ordered = sorted(tests, key=lambda name: (seconds.get(name, 0.0), name))
        return run_tests(self, mutant_name=mutant_name, tests=ordered)

    PytestRunner.run_tests = run_fastest_first
    run_mutmut(tuple(names), children)


def print_table() -> bool:
    """Print the results of each file; return whether enough mutants were killed in all of them."""
    print(f"\n{'file':48}" + "".join(f"{name:>10}" for name in (*COLUMNS, "other", "score")))
    is_good = True
    for path, statuses in read_statuses().items():
        counts = Counter(statuses.values())
        cells = [counts[name] for name in COLUMNS]
        score = (counts["killed"] + counts["timeout"]) / max(len(statuses), 1)
        is_good &= score >= TARGET
        numbers = "".join(f"{cell:10}" for cell in (*cells, len(statuses) - sum(cells)))
        print(f"{path:48}{numbers}{score:10.1%}")
    print("\n`mutmut results` lists the survivors, `mutmut show NAME` shows a change.")
    return is_good


def main() -> None:
    """Run and print a table; the exit code is 1 if too few mutants of a file were killed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.mutants",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--share", type=float, default=1.0, help="test a sample of this share of each file (default: all)"
    )
    parser.add_argument("--again", action="store_true", help="only those not killed, after tests were added")
    parser.add_argument("--children", type=int, default=2, help="processes at once (default: 2)")
    parser.add_argument("--table", action="store_true", help="only print the results so far")
    options = parser.parse_args()
    names = [] if options.table else select_names(options.share, options.again)
    if names is None or names:
        run_mutants(names or (), options.children)
    sys.exit(not print_table())


if __name__ == "__main__":
    main()
