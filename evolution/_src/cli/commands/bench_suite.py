"""`symbrion bench-suite`: tasks with fixed budgets, baselines, verification of submissions, the leaderboard."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from evolution._src.cli.command import TrustingCommand, UsageError, require_file, require_writable_file
from evolution._src.cli.console import Console
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count

METHODS = Literal["zero", "random", "cmaes", "surrogate"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class BenchSuite(TrustingCommand):
    """Run a baseline of the benchmark suite, verify submissions, or make the leaderboard.

    Example: symbrion bench-suite verify baseline.json
    """

    action: Annotated[Literal["list", "run", "verify", "board"], tyro.conf.Positional]
    """list: the tasks; run: a baseline; verify: run the genotypes of submissions again; board: the leaderboard."""
    files: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[FILE ...]")] = ()
    """Submissions, for verify and board."""
    method: METHODS = "cmaes"
    """The baseline."""
    seeds: tuple[int, ...] = (0,)
    """Seeds of the baseline."""
    tasks: tuple[str, ...] = ()
    """Tasks of run and verify; all unless given."""
    budget: float | None = None
    """Simulated time for a task and seed [s]; that of the suite unless given."""
    workers: int = 1
    """Number of threads; they change nothing but the time."""
    out: Path | None = None
    """Output file: the submission (.json) of run, written after each entry and continued where it exists; the page
    (.html) of board."""

    def check(self) -> None:
        super().check()
        if bool(self.files) != (self.action in ("verify", "board")):
            raise UsageError(f"{self.action}: verify and board take one or more submissions, others none")
        for file in self.files:
            require_file(file, "FILE")
        if self.action in ("run", "board"):
            if self.out is None:
                raise UsageError(f"{self.action}: --out is missing; give the file to be written")
            require_writable_file(self.out, "--out", (".json",) if self.action == "run" else (".html",))
        if min(self.seeds, default=-1) < 0:
            raise UsageError("--seeds are needed, from 0")
        self.require_positive("budget")

    def run(self, console: Console) -> dict[str, Any]:
        """Do what the action says."""
        actions = {"list": self._list, "run": self._run, "verify": self._verify, "board": self._board}
        return actions[self.action](console)

    def _list(self, console: Console) -> dict[str, Any]:
        from evolution._src.suite.tasks import BUDGET, SUITE

        rows = [[task.name, task.arena, "free" if task.body is None else str(task.body)] for task in SUITE]
        console.show_table(f"Tasks, {BUDGET:.0f} s each", ["task", "arena", "body"], rows)
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

    def _verify(self, console: Console) -> dict[str, Any]:
        from evolution._src.suite.submission import load_submission, verify

        failed, rows = 0, []
        for file in self.files:
            with console.track(f"Verification of {file}") as step:
                checks = verify(load_submission(file), step.progress, self.tasks, self.allow_code)
            for check in checks:
                entry = check.entry
                failed += not check.holds
                tried = entry.truth, check.truth, entry.scan, check.scan
                scores = [f"{each.successes}, {each.fitness:.3f}" for each in tried]
                rows.append([entry.task, str(entry.seed), *scores, "yes" if check.holds else "NO"])
        head = [f"{place}, {when}" for place in ("truth", "scan") for when in ("submitted", "again")]
        console.show_table("Verified: successes of 10, fitness", ["task", "seed", *head, "holds"], rows)
        return {"entries": len(rows), "failed": failed, "ok": not failed}

    def _board(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion bench-suite board`", "report")
        from evolution._src.suite import leaderboard
        from evolution._src.suite.submission import load_submission

        assert self.out is not None
        submissions = [load_submission(file) for file in self.files]
        title = "Successes of 10 in the truth and on the scan, fitness in the truth"
        rows = leaderboard.shorten_rows(leaderboard.rank(submissions))
        console.show_table(title, list(leaderboard.SHORT_COLUMNS), rows)
        leaderboard.make_page(submissions).write(self.out)
        ties = leaderboard.count_wins(submissions, leaderboard.SHARED)
        return {"out": self.out, "tasks_led": leaderboard.count_wins(submissions), "tasks_tied": ties}
