"""Output of the command line: progress bars with the remaining time, results as lines and tables."""

import errno
import os
import sys
import time
from collections.abc import Sequence
from datetime import timedelta
from typing import IO, Any

from rich.console import Console as RichConsole
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.table import Column, Table
from rich.text import Text

from reconstruction._src.base.printable import make_printable


class Console:
    """Draws progress on standard error, unless `quiet`; standard output contains only results, none if `mute`."""

    def __init__(self, quiet: bool = False, mute: bool = False):
        self.quiet = quiet
        self._out = _PlainConsole(file=sys.stdout, quiet=mute, soft_wrap=True)
        self._rich = _PlainConsole(file=sys.stderr, quiet=quiet)
        cut = Column(no_wrap=True, ratio=1)  # so that the time left is seen on a narrow terminal
        self._bars = Progress(
            TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, max_width=26)),
            BarColumn(bar_width=10),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeElapsedColumn(),
            _TimeLeft(),
            TextColumn("{task.fields[detail]}", "dim", markup=False, table_column=cut),
            console=self._rich,
            expand=True,
            disable=quiet or not self._rich.is_terminal,
        )

    def __enter__(self) -> "Console":
        # Until packages are imported.
        self._starting = [self._bars.add_task("Starting", total=None, detail="", end=None)]
        self._bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end_start()
        self._bars.stop()

    def _end_start(self) -> None:
        while self._starting:
            self._bars.remove_task(self._starting.pop())

    def print_line(self, text: str) -> None:
        """Print a line of results."""
        self._out.print(make_printable(text))

    def show_table(self, title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Print a table of results."""
        table = Table(*columns, title=title, title_justify="left")
        for row in rows:
            table.add_row(*(make_printable(cell) for cell in row))
        self._out.print(table)

    def track(self, title: str) -> "Step":
        """Return a step with its own progress bar, for use in a `with` block."""
        self._end_start()
        log = None if self.quiet or self._rich.is_terminal else self._rich
        return Step(make_printable(title), self._bars, log)


class _PlainConsole(RichConsole):
    """Prints text literally, without markup; becomes silent when the reader of a pipe has closed it."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def on_broken_pipe(self) -> None:
        """Continue without output: the results are in files."""
        self.quiet = True
        discard_output(self.file)


class _TimeLeft(ProgressColumn):
    """The time left, counted down between two reports."""

    def render(self, task: Task) -> Text:
        end = task.fields["end"]
        left = "-:--:--" if end is None else timedelta(seconds=round(max(end - time.perf_counter(), 0.0)))
        return Text(f"{left} left", style="progress.remaining")


class Step:
    """One step of the work: long functions call its `progress`. Without a terminal it prints lines instead of a bar."""

    LOG_INTERVAL = 5.0
    """Shortest time between two lines of progress [s]; a log of an hour has at most 720 of them."""
    MIN_FRACTION = 0.02
    """Share of the work since the first report from which the remaining time is estimated."""

    def __init__(self, title: str, bars: Progress, log: RichConsole | None):
        self.title, self._bars, self._log = title, bars, log
        self.seconds = 0.0  # wall time, known when the step has ended
        self._task = bars.add_task(title, total=1.0, detail="", end=None)
        self._start = self._last_line = 0.0
        self._begin, self._known, self._before = 0.0, 0.0, 1.0  # first time and fraction, the one before

    def __enter__(self) -> "Step":
        self._start = self._last_line = time.perf_counter()
        if self._log:
            self._log.print(f"{self.title} ...")
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self.seconds = time.perf_counter() - self._start
        if error is None:
            self._bars.update(self._task, completed=1.0, detail="", end=self._start)
        if self._log and error is None:
            self._log.print(f"{self.title}: done in {self.seconds:.1f} s")

    def progress(self, message: str, fraction: float) -> None:
        """Show what is being done and the fraction done: the callback for the function that does the work."""
        now, left = time.perf_counter(), None
        if fraction < self._before:  # the work begins, or goes back
            self._begin, self._known = now, fraction
        self._before, done = fraction, fraction - self._known
        if done > self.MIN_FRACTION and fraction < 1:
            left = (now - self._begin) * (1 - fraction) / done
        self._bars.update(self._task, completed=fraction, detail=message, end=left and now + left)
        if self._log and now - self._last_line > self.LOG_INTERVAL:
            self._last_line = now
            about = "" if left is None else f", about {left:.0f} s left"
            self._log.print(f"  {message} ({fraction:.0%}{about})")


def prepare_streams() -> None:
    """Make both streams writable: characters that an encoding lacks are escaped, closed streams discard output."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def flush_streams() -> OSError | None:
    """Write buffered output, so that nothing fails when the interpreter ends."""
    problem = None
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            discard_output(stream)
            problem = None if is_unread(error) else error
    return problem


def is_unread(error: OSError) -> bool:
    """Return whether writing failed because the reader has closed the pipe, which is no failure of the command."""
    return isinstance(error, BrokenPipeError) or (sys.platform == "win32" and error.errno == errno.EINVAL)


def discard_output(stream: IO[str]) -> None:
    """Discard the output of a stream from now on, including what is buffered."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
