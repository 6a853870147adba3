"""`symbrion paper`: repeat the experiments of the paper on this machine."""

import dataclasses
import os
from pathlib import Path
from typing import Any

from evolution._src.cli.command import SeededCommand, require_writable_folder
from evolution._src.cli.console import Console
from reconstruction._src.base.extras import require_extras


@dataclasses.dataclass(frozen=True, kw_only=True)
class Paper(SeededCommand):
    """Repeat the experiments of the paper (Tables I-III, Figs. 3-7) and write a page that compares them with it.

    Each result is saved when it is finished: the same command continues where it was interrupted.

    Example: symbrion paper --quick --out paper
    """

    out: Path = Path("paper")
    """Output folder: report.html, results.json, figures, films, arenas. Finished experiments in it are not repeated."""
    quick: bool = False
    """Fewer sizes, runs and scans: about 3 minutes instead of 20 on two cores."""
    workers: int = os.cpu_count() or 1
    """Threads; the results do not depend on their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")
        self.require_least(workers=1)

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion paper`", "scan", "report")
        from evolution._src.experiments.paper import claim_folder, lock_folder, run_experiments, write_json
        from evolution._src.experiments.paper_page import write_paper_page

        report = self.out / "report.html"
        claim_folder(self.out, {"quick": self.quick, "seed": self.seed})
        with lock_folder(self.out):
            results = run_experiments(self.out, self.quick, self.seed, console.track, self.workers)
            write_json(self.out / "results.json", results)
            with console.track("figures and page"):
                write_paper_page(self.out, self.quick, self.seed, results)
        console.print_line(f"report: {report.resolve()}")
        return {"report": report, "results": self.out / "results.json", **_summarize(results)}


def _summarize(results: dict[str, Any]) -> dict[str, Any]:
    """Return the main results."""
    return {
        "held_in_truth": results["evolution"]["figures"]["judged"]["truth"],
        "physics_ratio": results["physics"]["figures"]["ratios"]["gg"]["physics_us"],
        "laser_ratio": results["laser"]["figures"]["ratios"]["tree"]["gg"],
        "seconds": {name: record["seconds"] for name, record in results.items()},
        "cpu_seconds": {name: record.get("cpu_seconds") for name, record in results.items()},
    }
