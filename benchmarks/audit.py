"""The audit of every task: random and short evolved controllers of 11 bodies x 6 tasks x 4 arenas, successes audited.

    python -m benchmarks.audit [--quick] [--only cheats] [--minutes M] [--more]

It runs in rounds of one cell each and stores its counts after every round, so that a run that was stopped goes on with
`--more`.
"""

import argparse
import time
from collections import Counter
from typing import Any

from benchmarks.evolution_runs import Results
from benchmarks.material.audited_tasks import list_cells, try_evolved, try_random

RANDOM_EPISODES = 10_000
EVOLVED_EPISODES = 2_000
MINUTES = 180.0
PARTS = ("cheats",)
_TRIES = {"random": try_random, "evolved": try_evolved}
_SHOWN_FAULTS = 20


def run(
    quick: bool = False, only: tuple[str, ...] = (), minutes: float = MINUTES, more: bool = False
) -> dict[str, Any]:
    """Audit in rounds, until both kinds have as many episodes as wanted and each cell had a round.

    Args:
        quick: a few rounds.
        only: names of the parts; there is one.
        minutes: no round begins after this time [min].
        more: add to the last results.
    """
    results = Results("audit")
    last = results.content.get("cheats", {}) if more else {}
    rounds, counts = Counter(last.get("rounds", {})), Counter(last.get("counts", {}))
    faults, limit = list(last.get("faults", [])), time.monotonic() + 60 * minutes
    wanted = dict.fromkeys(_TRIES, 2 if quick else len(list_cells()))
    episodes = {"random": 0 if quick else RANDOM_EPISODES, "evolved": 0 if quick else EVOLVED_EPISODES}
    while time.monotonic() < limit:
        open_kinds = [
            kind
            for kind in _TRIES
            if rounds[kind] < wanted[kind] or counts[f"{kind} episodes"] < episodes[kind]
        ]
        if not open_kinds:
            break
        kind = min(open_kinds, key=lambda kind: rounds[kind])
        found, new = _TRIES[kind](rounds[kind])
        rounds[kind] += 1
        counts.update(found)
        faults += new
        cheats = counts["random cheats"] + counts["evolved cheats"]
        results.put(
            "cheats",
            {
                "cheats": cheats,
                "cells": min(*(rounds[kind] for kind in _TRIES), len(list_cells())),
                "faults": faults[:_SHOWN_FAULTS],
                "counts": dict(sorted(counts.items())),
                "rounds": dict(rounds),
            },
        )
        print(f"{kind} round {rounds[kind]}: {dict(found)} {new or ''}", flush=True)
    return results.content


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.audit",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="a few rounds")
    parser.add_argument("--only", nargs="*", default=[], choices=PARTS, help="parts to measure")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="no round begins after this time")
    parser.add_argument("--more", action="store_true", help="add to the last results")
    options = parser.parse_args()
    run(options.quick, tuple(options.only), options.minutes, options.more)


if __name__ == "__main__":
    main()
