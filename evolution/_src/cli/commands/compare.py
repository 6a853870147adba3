"""`symbrion compare`: several runs side by side."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import tyro

import evolution as ev
from evolution._src.body_search.run import TABLE, has_bodies
from evolution._src.cli.command import Command, UsageError, require_writable_file
from evolution._src.cli.commands.evolve import require_run
from evolution._src.cli.console import Console
from evolution._src.report.comparison import COLUMNS, draw_comparison, make_comparison_page, tabulate
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.quantities import format_count


@dataclasses.dataclass(frozen=True, kw_only=True)
class Compare(Command):
    """Compare runs, finished or not: a table, and their learning curves in one figure.

    Example: symbrion compare runs/coarse runs/fine --out comparison.html
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN [RUN ...]")]
    """The run folders."""
    out: Path | None = None
    """Output file for the figure (.png) or a page with figure and table (.html)."""

    def __post_init__(self) -> None:
        if not self.folders:
            raise UsageError("no run to compare; give one or more run folders")
        for folder in self.folders:
            require_run(folder)
            if has_bodies(folder):
                raise UsageError(
                    f"{folder} is a search for bodies, which has no learning curve; see {folder / TABLE}"
                )
        if self.out is not None:
            require_writable_file(self.out, "--out", (".png", ".html"))

    def run(self, console: Console) -> dict[str, Any]:
        """Compare the runs.

        Raises:
            RunError: a run is damaged, or there is no generation to draw.
        """
        if self.out is not None:
            require_extras("`symbrion compare --out`", "report")
        runs = {str(folder): ev.load_run(folder) for folder in self.folders}
        rows = tabulate(runs)
        console.show_table("Runs", list(COLUMNS), rows)
        summary = {"runs": [dict(zip(COLUMNS, row, strict=True)) for row in rows], "out": self.out}
        if self.out is None:
            return summary
        if not any(len(run.history) for run in runs.values()):
            raise ev.RunError("none of these runs has finished a generation; there is nothing to draw yet")
        if self.out.suffix.lower() == ".html":
            make_comparison_page(runs).write(self.out)
        else:
            from evolution._src.report.pictures import to_png

            with write_atomically(self.out) as beside:
                beside.write_bytes(to_png(draw_comparison(runs)))
        console.print_line(f"{self.out}: {format_count(len(runs), 'run')}")
        return summary
