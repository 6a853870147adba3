"""What is seen before the first step, and the time that is left, as a step prints it where there is no terminal."""

import io
import sys

import pytest

from evolution._src.cli import console
from evolution._src.cli.console import Console, Step


class Log:
    """Keeps what is printed."""

    def __init__(self):
        self.lines = []

    def print(self, line):
        self.lines.append(line)


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [0.0]
    monkeypatch.setattr(console.time, "perf_counter", lambda: now[0])
    return now


class Bars:
    """Draws nothing."""

    def add_task(self, *_, **__):
        return 0

    def update(self, *_, **__):
        pass


@pytest.mark.parametrize(
    ("reports", "expected"),
    [
        ([(0.0, 0.0), (10.0, 0.25)], "25%, about 30 s left"),
        ([(20.0, 0.5), (30.0, 0.75)], "75%, about 10 s left"),  # half of it was done before
        ([(20.0, 0.5)], "50%"),
        ([(20.0, 0.5), (30.0, 0.51)], "51%"),
        ([(0.0, 0.0), (10.0, 1.0)], "100%"),
        ([(0.0, 0.0), (30.0, 0.9), (40.0, 0.0), (50.0, 0.25)], "25%, about 30 s left"),  # it goes back
    ],
)
def test_the_time_left_is_that_at_the_speed_since_the_first_report(clock, reports, expected):
    log = Log()
    with Step("work", Bars(), log) as step:
        for now, share in reports:
            clock[0] = now
            step.progress("trials", share)
    assert log.lines[-2] == f"  trials ({expected})"


def test_a_terminal_shows_that_something_starts_until_a_step_with_the_time_left(monkeypatch, clock):
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("COLUMNS", "80")
    with Console() as shown:
        assert "Starting" in screen.getvalue()
        with shown.track("Survey of an arena with a long name") as step:
            begun = len(screen.getvalue())
            step.progress("generation 1 of 30: 16 of 36 trials", 0.0)
            clock[0] = 30.0
            step.progress("generation 1 of 30: 36 of 36 trials", 0.75)
            clock[0] = 33.0
            shown._bars.refresh()
        shown.track("Training")
    drawn = screen.getvalue()[begun:]
    assert "Starting" not in drawn
    assert "Survey" in drawn
    assert "0:00:07 left" in drawn
