"""`symbrion paper`: the paper's experiments, measured again on this machine."""

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

import symbrion_gym as sg
from evolution.commands.command import Command, UsageError, require_writable_folder
from evolution.commands.console import Console
from evolution.demo import DemoConfig, walk_road
from evolution.paper import QUICK, PaperConfig, measure_costs, measure_networks
from evolution.report.paper_page import write_paper_page
from evolution.report.provenance import describe_machine
from reconstruction.whole_file import write_whole


@dataclasses.dataclass(frozen=True, kw_only=True)
class Paper(Command):
    """Run the paper's experiments: the road, Table I (networks), II (physics) and III (laser scan), and a page.

    Example: symbrion paper --quick --out paper
    """

    out: Path = Path("paper")
    """Everything goes here: report.html, results.json. An earlier run there is replaced."""
    quick: bool = False
    """Fewer sizes, runs and scans."""
    workers: int = os.cpu_count() or 1
    """Threads; the results do not depend on their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")
        if self.workers < 1:
            raise UsageError(f"--workers {self.workers} is too few; give 1 or more")

    def run(self, console: Console) -> dict[str, Any]:
        config = dataclasses.replace(QUICK if self.quick else PaperConfig(), seed=self.seed)
        road = walk_road(DemoConfig(self.out, self.seed, workers=self.workers), console.track)
        assert road.run.champion is not None
        truth = sg.load_arena("truth")
        with console.track("Table I: networks") as step:
            networks = measure_networks(road.points, truth.surface, config, step.progress)
        arenas = {**road.arenas, "simple": sg.load_arena("simple"), "truth": truth}
        with console.track("Tables II and III: physics and laser scan") as step:
            costs = measure_costs(road.run.champion, arenas, config, step.progress)
        with console.track("report"):
            write_paper_page(road, networks, costs, config, self.out / "report.html")
            results = {
                "machine": describe_machine(),
                "config": dataclasses.asdict(config),
                "table_1": [row._asdict() for row in networks],
                "tables_2_and_3": [row._asdict() for row in costs],
                "crosses": road.crosses,
            }
            with write_whole(self.out / "results.json") as beside:
                beside.write_text(json.dumps(results, indent=2) + "\n")
        console.say(f"report: {(self.out / 'report.html').resolve()}")
        return {"report": self.out / "report.html", **results}
