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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.action in ("verify", "board"):
            if not self.files:
                raise UsageError(f"{self.action}: no submission; give one or more files")
            for file in self.files:
                require_file(file, "FILE")
        elif self.files:
            raise UsageError(f"{self.action} takes no files; verify and board do")
        if self.action in ("run", "board"):
            if self.out is None:
                raise UsageError(f"{self.action}: --out is missing; give the file to be written")
            require_writable_file(self.out, "--out", (".json",) if self.action == "run" else (".html",))
        if min(self.seeds, default=-1) < 0 or self.workers < 1:
            raise UsageError("--seeds are needed, from 0, and --workers, from 1")
        if self.budget is not None and not 0.0 < self.budget <= 1e6:
            raise UsageError(f"--budget {self.budget} is not above 0, up to 1e6 s")

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

        assert self.out is not None
        with console.track(f"Baseline {self.method}") as step:
            submission = run_suite(
                self.method,
                self.seeds,
                self.tasks,
                self.budget or BUDGET,
                self.workers,
                step.progress,
                out=self.out,
            )
        console.print_line(f"{self.out}: {format_count(len(submission.entries), 'entry', 'entries')}")
        return {"out": self.out, "entries": len(submission.entries), "seconds": step.seconds}

    def _verify(self, console: Console) -> dict[str, Any]:
        from evolution._src.suite.submission import load_submission, verify

        failed = 0
        rows = []
        for file in self.files:
            with console.track(f"Verification of {file}") as step:
                checks = verify(load_submission(file), step.progress, self.tasks, self.allow_code)
            for check in checks:
                failed += not check.holds
                told, found = check.entry.truth, check.truth
                pairs = (told, found), (check.entry.scan, check.scan)
                scores = [f"{each.successes}, {each.fitness:.3f}" for pair in pairs for each in pair]
                rows.append(
                    [check.entry.task, str(check.entry.seed), *scores, "yes" if check.holds else "NO"]
                )
        head = [f"{place}, {when}" for place in ("truth", "scan") for when in ("submitted", "again")]
        console.show_table("Verified: successes of 10, fitness", ["task", "seed", *head, "holds"], rows)
        return {"entries": len(rows), "failed": failed, "ok": not failed}

    def _board(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion bench-suite board`", "report")
        from evolution._src.suite.leaderboard import (
            SHARED,
            SHORT_COLUMNS,
            count_wins,
            make_page,
            rank,
            shorten_rows,
        )
        from evolution._src.suite.submission import load_submission

        assert self.out is not None
        submissions = [load_submission(file) for file in self.files]
        title = "Successes of 10 in the truth and on the scan, fitness in the truth"
        console.show_table(title, list(SHORT_COLUMNS), shorten_rows(rank(submissions)))
        make_page(submissions).write(self.out)
        wins, ties = count_wins(submissions), count_wins(submissions, SHARED)
        return {"out": self.out, "tasks_led": wins, "tasks_tied": ties}
