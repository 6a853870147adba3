"""`symbrion demo`: the whole pipeline, and an HTML page with its results."""

import dataclasses
import os
from pathlib import Path
from typing import Any

from evolution._src.cli.command import SeededCommand, require_writable_folder
from evolution._src.cli.console import Console
from reconstruction._src.base.extras import require_extras


@dataclasses.dataclass(frozen=True, kw_only=True)
class Demo(SeededCommand):
    """Run the whole pipeline: survey, networks, arenas, evolution, trials in the true arena, video, report.

    Example: symbrion demo --out demo
    """

    out: Path = Path("demo")
    """Output folder; open report.html in it. The files of an earlier demo there are replaced."""
    workers: int = os.cpu_count() or 1
    """Threads; the results do not depend on their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")
        self.require_least(workers=1)

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion demo`", "scan", "report")
        from evolution._src.experiments.demo import DemoConfig, run_pipeline
        from evolution._src.experiments.demo_page import write_demo_page

        config = DemoConfig(self.out, self.seed, workers=self.workers)
        result = run_pipeline(config, console.track)
        report = self.out / "report.html"
        with console.track("7/7 report"):
            write_demo_page(result, report)
        for name, crosses in result.crosses.items():
            outcome = result.outcomes[name]
            verdict = "crosses" if crosses else "does NOT cross"
            place = "true" if name == "truth" else "reconstructed"
            rate = f"{outcome.successes} of {outcome.trials} randomized trials succeed"
            console.print_line(f"{place} arena: the champion {verdict} the pit; {rate}")
        console.print_line(f"report: {report.resolve()}")
        return {
            "ok": all(result.crosses.values()),
            "report": report,
            "crosses": result.crosses,
            "successes": {name: outcome.successes for name, outcome in result.outcomes.items()},
            "trials": {name: outcome.trials for name, outcome in result.outcomes.items()},
            "seconds": result.seconds,
        }
