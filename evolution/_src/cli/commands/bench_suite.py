"""`symbrion bench-suite`: tasks with fixed budgets, baselines, and the exam of submissions with its leaderboard."""

import dataclasses
import secrets
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from evolution._src.cli.command import TrustingCommand, UsageError, require_file, require_writable_file
from evolution._src.cli.console import Console
from evolution._src.errors import RunError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.printable import make_printable
from reconstruction._src.base.range_checks import format_count

METHODS = Literal["zero", "random", "cmaes", "random-path", "path"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class BenchSuite(TrustingCommand):
    """Run a baseline of the benchmark suite, or try submissions again and make the leaderboard.

    Example: symbrion bench-suite board baseline.json --out board.html
    """

    action: Annotated[Literal["list", "run", "board"], tyro.conf.Positional]
    """list: the tasks; run: a baseline; board: try submissions on new scans and in the truth, and rank them."""
    files: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[FILE ...]")] = ()
    """Submissions, for board."""
    method: METHODS = "cmaes"
    """The baseline."""
    seeds: tuple[int, ...] = ()
    """Seeds of the baseline; all of each task, which are needed for a place on the board, unless given."""
    tasks: tuple[str, ...] = ()
    """Tasks of run; all unless given."""
    budget: float | None = None
    """Simulated time for a task and seed [s]; that of the suite unless given."""
    exam_seed: int | None = None
    """Seed of the scans and conditions of board; drawn, and written on the page, unless given."""
    workers: int = 1
    """Number of threads; they change nothing but the time."""
    out: Path | None = None
    """Output file: the submission (.json) of run, written after each entry and continued where it exists; the page
    (.html) of board."""

    def check(self) -> None:
        super().check()
        if bool(self.files) != (self.action == "board"):
            raise UsageError(f"{self.action}: board takes one or more submissions, others none")
        for file in self.files:
            require_file(file, "FILE")
        if self.action in ("run", "board"):
            if self.out is None:
                raise UsageError(f"{self.action}: --out is missing; give the file to be written")
            require_writable_file(self.out, "--out", (".json",) if self.action == "run" else (".html",))
        if min((*self.seeds, self.exam_seed or 0)) < 0:
            raise UsageError("--seeds and --exam-seed begin at 0")
        self.require_positive("budget")

    def run(self, console: Console) -> dict[str, Any]:
        actions = {"list": self._list, "run": self._run, "board": self._board}
        return actions[self.action](console)

    def _list(self, console: Console) -> dict[str, Any]:
        from evolution._src.suite.tasks import BUDGET, SEEDS, SUITE

        rows = [[task.name, task.place, str(task.body)] for task in SUITE]
        title = f"Tasks, {len(SEEDS)} seeds, {BUDGET:.0f} s each"
        console.show_table(title, ["task", "place", "body"], rows)
        return {"tasks": [task.name for task in SUITE], "budget": BUDGET}

    def _run(self, console: Console) -> dict[str, Any]:
        from evolution._src.suite.baselines import run_suite
        from evolution._src.suite.tasks import BUDGET

        budget = self.budget or BUDGET
        with console.track(f"Baseline {self.method}") as step:
            submission = run_suite(
                self.method, self.seeds, self.tasks, budget, self.workers, step.progress, out=self.out
            )
        console.print_line(f"{self.out}: {format_count(len(submission.entries), 'entry', 'entries')}")
        return {"out": self.out, "entries": len(submission.entries), "seconds": step.seconds}

    def _board(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion bench-suite board`", "report", "scan")
        from evolution._src.suite import leaderboard
        from evolution._src.suite.exam import LONGEST_LINE, hold_exam
        from evolution._src.suite.submission import load_submission

        assert self.out is not None
        submissions, unread = [], []
        for file in self.files:
            try:
                submissions.append(load_submission(file))
            except RunError as error:
                unread.append((file.name, make_printable(error, LONGEST_LINE)))
        seed = secrets.randbelow(2**32) if self.exam_seed is None else self.exam_seed
        with console.track(f"Exam, seed {seed}") as step:
            exam = hold_exam(submissions, seed, self.allow_code, self.workers, step.progress)
        exam = exam._replace(untried=(*exam.untried, *unread))
        rows = leaderboard.rank(exam)
        title = "Successes of 10: interquartile mean over seeds (95 % interval)"
        console.show_table(title, ["task", *leaderboard.COLUMNS], [[row.task, *row.format()] for row in rows])
        for name, why in exam.untried:
            console.print_line(f"{name}: not tried, so not ranked: {why}")
        leaderboard.make_page(exam, submissions).write(self.out)
        summary = {"out": self.out, "exam_seed": seed, "entries": len(exam.results)}
        return summary | {"untried": dict(exam.untried), "ok": not exam.untried}
