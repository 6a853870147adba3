"""`symbrion demo`: the whole road, with a page to show for it."""

import dataclasses
import os
from pathlib import Path
from typing import Any

from evolution.cli.arguments import check_modules
from evolution.cli.command import SeededCommand, UsageError, require_writable_folder
from evolution.cli.console import Console
from reconstruction.extras import require_extras


@dataclasses.dataclass(frozen=True, kw_only=True)
class Demo(SeededCommand):
    """Walk the whole road: survey, networks, arenas, evolution, judgement in the true arena, video, report.

    Example: symbrion demo --out demo
    """

    out: Path = Path("demo")
    """Everything goes here; report.html is the page to open. The files of an earlier demo there are replaced."""
    modules: int = 8
    """Modules in the snake."""
    generations: int = 30
    """Generations of the evolution, at most."""
    workers: int = os.cpu_count() or 1
    """Threads; the results do not depend on their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")
        check_modules(self.modules)
        for option in ("generations", "workers"):
            if getattr(self, option) < 1:
                raise UsageError(f"--{option} {getattr(self, option)} is too few; give 1 or more")

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion demo`", "scan", "report")
        from evolution.experiments.demo.demo import DemoConfig, walk_road
        from evolution.experiments.demo.page import write_demo_page

        config = DemoConfig(
            self.out, self.seed, modules=self.modules, generations=self.generations, workers=self.workers
        )
        road = walk_road(config, console.track)
        report = self.out / "report.html"
        with console.track("7/7 report"):
            write_demo_page(road, report)
        for name, crosses in road.crosses.items():
            held = road.judgements[name]
            verdict = "crosses" if crosses else "does NOT cross"
            place = "true" if name == "truth" else "reconstructed"
            rate = f"{held.successes} of {held.trials} randomised trials"
            console.say(f"{place} arena: the champion {verdict} the pit; {rate}")
        console.say(f"report: {report.resolve()}")
        return {
            "ok": all(road.crosses.values()),
            "report": report,
            "crosses": road.crosses,
            "successes": {name: held.successes for name, held in road.judgements.items()},
            "trials": {name: held.trials for name, held in road.judgements.items()},
            "seconds": road.seconds,
        }
