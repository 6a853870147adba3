"""`symbrion paper`: repeat the experiments of the paper on this machine."""

import dataclasses
import os
from pathlib import Path
from typing import Any

from evolution._src.cli.command import SeededCommand, UsageError, require_writable_folder
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
        if self.workers < 1:
            raise UsageError(f"--workers {self.workers} is too few; give 1 or more")

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion paper`", "scan", "report")
        from evolution._src.experiments.paper.benchmark import load_benchmark
        from evolution._src.experiments.paper.config import QUICK, PaperConfig
        from evolution._src.experiments.paper.experiments import run_experiments
        from evolution._src.experiments.paper.folder import PaperFolder, write_json
        from evolution._src.experiments.paper.page.page import write_paper_page
        from evolution._src.report.provenance import describe_machine

        config = dataclasses.replace(QUICK if self.quick else PaperConfig(), seed=self.seed)
        folder = PaperFolder(self.out, config)
        report = self.out / "report.html"
        with folder.lock():
            records = run_experiments(folder, console.track, self.workers)
            results = {
                "machine": describe_machine(),
                "config": config.to_json(),
                "experiments": records,
                "benchmark": load_benchmark(),
            }
            write_json(self.out / "results.json", results)
            with console.track("figures and page"):
                write_paper_page(self.out, config, records, report)
        console.print_line(f"report: {report.resolve()}")
        return {"report": report, "results": self.out / "results.json", **_summarize(records)}


def _summarize(records: dict[str, Any]) -> dict[str, Any]:
    """Return the main results."""
    return {
        "held_in_truth": records["evolution"]["figures"]["judged"]["truth"],
        "physics_ratio": records["physics"]["figures"]["ratios"]["gg"]["physics_us"],
        "laser_ratio": records["laser"]["figures"]["ratios"]["tree"]["gg"],
        "seconds": {name: record["seconds"] for name, record in records.items()},
        "cpu_seconds": {name: record.get("cpu_seconds") for name, record in records.items()},
    }
