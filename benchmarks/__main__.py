"""Run every benchmark in turn: `python -m benchmarks [--quick] [NAME ...]`."""

import argparse
import importlib
from pathlib import Path

HOUSEKEEPING = {"__init__", "__main__", "report"}


def find_benchmarks() -> list[str]:
    """Return the names of the benchmark modules beside this file."""
    return sorted(p.stem for p in Path(__file__).parent.glob("*.py") if p.stem not in HOUSEKEEPING)


def main() -> None:
    names = find_benchmarks()
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"which to run (default: all): {', '.join(names)}"
    )
    parser.add_argument("--quick", action="store_true", help="smaller sizes and fewer repetitions")
    options = parser.parse_args()
    unknown = set(options.names) - set(names)
    if unknown:
        parser.error(f"no such benchmark: {', '.join(sorted(unknown))}; there are {', '.join(names)}")
    for name in options.names or names:
        print(f"\n== {name} ==", flush=True)
        importlib.import_module(f"benchmarks.{name}").run(quick=options.quick)


if __name__ == "__main__":
    main()
