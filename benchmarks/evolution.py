"""Does evolution find champions that hold in the true arena, at what price, and is its bookkeeping honest?

    python -m benchmarks.evolution [--quick] [--only champions stages ...] [--seeds 0 1 ...]
    python -m benchmarks.evolution --judge-again [--only champions ...]

Every champion is judged by 20 fresh randomised trials from the floor in the true arena, which the search
never saw; their seed is drawn then and kept with the row. Only champions that their run has confirmed count as
ones that hold. Each run is written as soon as it is known; a part that is measured again replaces its own rows.
Wall seconds mean something on an idle machine only (`load` tells); genotypes, trials and processor seconds
always do.
"""

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.evolution_judging import judge_again
from benchmarks.evolution_machine import measure_backends, measure_kills, measure_overhead, measure_workers
from benchmarks.evolution_runs import Results, make_model, measure_runs
from benchmarks.evolution_summary import find_gaps, holds
from evolution.search.config import EvolutionConfig
from evolution.search.stages import Stage
from symbrion_gym.arenas.course import Course

SEEDS = (0, 1, 2, 3, 4)
HELD_OUT = 5
"""Seeds from here on were not looked at when the search was given its patience."""
BASE = EvolutionConfig(arena="gsrm", modules=8, generations=50, workers=2)
"""At most 600 genotypes."""
MODELS: dict[str, tuple[str, int] | str] = {
    "simple": "simple",
    "gsrm 200": ("gsrm", 200),
    "gsrm 800": ("gsrm", 800),
    "gsrm 2200": "gsrm",
    "gsrm 5000": ("gsrm", 5000),
    "gg 210": ("gg", 210),
    "gg 13860": "gg",
}
"""Models to evolve on: a ready-made arena, or a network and its units (gsrm) or triangles (gg)."""
COARSE, FINES = "gsrm 800", ("gsrm 2200", "gg 13860")
"""Coarser ones lead astray: what crosses in a grid of 210 triangles does not in truth; a GSRM of 200 units makes 18
contact pieces, the fine ones 6 to 8, and so is dearer than they are."""
LAWS: dict[str, dict[str, Any]] = {
    "travelling": {"controller": "travelling"},
    "reactive from its hint": {"controller": "reactive", "origin": "hint", "sigma": 0.15},
}
"""Other ways to begin, to compare: angles instead of slopes, and a law that begins from numbers set by hand."""
BODIES: dict[str, Any] = {"body_lengths": (3, 9), "restart_after": 20, "generations": 300}
ABYSS = Course(pit=0.37)
"""Wider than a body that does nothing holds itself out: it crosses 0.36 m in 60 of 60 trials, 0.37 m in none."""


class Benchmark:
    """The parts, each a method of its name.

    Args:
        results: where they write.
        seeds: of the runs.
        repeats: of what is timed.
        say: told each figure.
    """

    def __init__(
        self, results: Results, seeds: tuple[int, ...], repeats: int, say: Callable[[str], None]
    ) -> None:
        self._results, self._seeds, self._repeats, self._say = results, seeds, repeats, say

    def _run(
        self,
        part: str,
        seeds: tuple[int, ...] | None = None,
        course: Course | None = None,
        **changes: Any,
    ) -> list[dict[str, Any]]:
        chosen = self._seeds if seeds is None else seeds
        return measure_runs(self._results, part, replace(BASE, **changes), chosen, self._say, course)

    def _put(self, part: str, figures: dict[str, Any]) -> None:
        self._results.put(part, figures)
        self._say(f"{part}: {figures}")

    def overhead(self) -> None:
        """The loop over bare stepping."""
        self._put("overhead", measure_overhead(self._repeats))

    def workers(self) -> None:
        """Two threads over one."""
        self._put("workers", measure_workers(self._repeats))

    def backends(self) -> None:
        """Equal histories from 1, 2 and 4 threads and from processes; Ray has its own test."""
        self._put("backends", measure_backends())

    def kills(self) -> None:
        """Runs killed by signal 9 and resumed."""
        self._put("kills", measure_kills(20))

    def champions(self) -> None:
        """The task: the default course, 8 modules, on the scanned arena, from zero."""
        self._run("champions")
        self._run("champions_held_out", tuple(seed + HELD_OUT for seed in self._seeds))

    def six_modules(self) -> None:
        """A shorter body."""
        self._run("six_modules", modules=6)

    def abyss(self) -> None:
        """A bridge: where the floor of the pit is touched, the trial ends."""
        with tempfile.TemporaryDirectory() as folder:
            arena = make_model("gsrm", 2200, Path(folder), ABYSS)
            self._run("abyss", course=ABYSS, arena=arena, environment=(("abyss", True),))

    def models(self) -> None:
        """Evolved on coarse and fine models of the same arena, judged in truth."""
        champions = self._results.content.get("champions")
        with tempfile.TemporaryDirectory() as folder:
            for name, recipe in MODELS.items():
                if recipe == BASE.arena and champions:
                    self._put(f"models/{name}", champions)  # the very same runs
                    continue
                arena = recipe if isinstance(recipe, str) else make_model(*recipe, Path(folder))
                self._run(f"models/{name}", arena=arena)

    def stages(self) -> None:
        """Coarse to fine against fine only (the row of `models`), by the time to a champion that holds."""
        with tempfile.TemporaryDirectory() as folder:
            method, units = MODELS[COARSE]
            coarse = make_model(str(method), int(units), Path(folder))
            for fine in FINES:
                stages = (Stage(coarse, 15, "success", success_share=0.5, trials=1), Stage(str(MODELS[fine])))
                self._run(f"stages/{fine}", stages=stages)
                self._compare_stages(fine)

    def stages_compared(self) -> None:
        """Coarse to fine against fine only once more, from the rows that there are."""
        for fine in FINES:
            self._compare_stages(fine)

    def _compare_stages(self, fine: str) -> None:
        """Set the runs that began coarse beside those that did not, of the same seeds, as far as champions hold."""
        staged = self._results.find_runs(f"stages/{fine}")
        seeds = {row["seed"] for row in staged}
        only = [row for row in self._results.find_runs(f"models/{fine}") if row["seed"] in seeds]
        only, staged = ([row for row in rows if holds(row)] for rows in (only, staged))
        if only and staged:
            names = [
                f"{moment}{name}" for name in ("cpu_seconds", "genotypes") for moment in ("holds_from_", "")
            ]
            known = [
                name for name in names if all(name in row for row in (*only, *staged))
            ]  # older rows lack some
            figures = {f"times_less_{name}": _compare(only, staged, name) for name in known}
            parts = [f"stages/{fine}", f"models/{fine}"]
            self._put(f"stages_compared/{fine}", {"coarse": COARSE, "from_parts": parts, **figures})

    def body_length(self) -> None:
        """Evolution chooses the length of the body, and once one holds goes on among shorter ones."""
        self._run("body_length", self._seeds[:3], **BODIES)

    def laws(self) -> None:
        """Other laws and beginnings on the default course."""
        for name, changes in LAWS.items():
            self._run(f"laws/{name}", self._seeds[:3], **changes)

    def gap(self) -> None:
        """The gap between validation and final test, over all runs that a seed drawn with the row has judged."""
        content = self._results.content
        parts = [part for part in content if part == "champions" or content[part] != content.get("champions")]
        drawn = {
            part: [row for row in self._results.find_runs(part) if "judging_seed" in row] for part in parts
        }
        parts = [part for part, rows in drawn.items() if rows]
        figures = find_gaps([row for part in parts for row in drawn[part]])
        if figures["of"]:
            self._put("gap", {"from_parts": parts, **figures})


PARTS = tuple(name for name in vars(Benchmark) if not name.startswith("_"))
QUICK = ("overhead", "workers", "backends", "champions", "gap")


def _compare(fine: list[dict[str, Any]], staged: list[dict[str, Any]], name: str) -> float:
    """Return how many times less coarse to fine needs, by the medians."""
    one, other = (np.median([row[name] for row in rows]) for rows in (fine, staged))
    return round(float(one / other), 2)


def run(
    quick: bool = False,
    only: tuple[str, ...] = (),
    seeds: tuple[int, ...] = SEEDS,
    is_judged_again: bool = False,
) -> dict[str, Any]:
    """Measure, print, keep and return the figures.

    Args:
        quick: two seeds, and the small parts only.
        only: names of the parts to measure; empty means all (all small ones if quick).
        seeds: of the runs of each kind.
        is_judged_again: evolve nothing; judge the champions that are kept once more.
    """
    results = Results("evolution")
    say = partial(print, flush=True)
    benchmark = Benchmark(results, seeds[:2] if quick else seeds, 2 if quick else 5, say)
    if is_judged_again:
        judge_again(results, only, say)
        only = ("stages_compared", "gap")
    for name in only or (QUICK if quick else PARTS):
        getattr(benchmark, name)()
    return results.content


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="two seeds, and the small parts only")
    parser.add_argument("--only", nargs="*", default=[], choices=PARTS, help="parts to measure")
    parser.add_argument("--seeds", nargs="*", type=int, default=list(SEEDS), help="of the runs of each kind")
    parser.add_argument(
        "--judge-again", action="store_true", help="judge the kept champions by new seeds; evolve nothing"
    )
    options = parser.parse_args()
    run(options.quick, tuple(options.only), tuple(options.seeds), options.judge_again)


if __name__ == "__main__":
    main()
