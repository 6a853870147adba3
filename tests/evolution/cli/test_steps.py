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
        ([(0.0, 0.0), (0.1, 0.6), (10.0, 0.7)], "70%, about 30 s left"),  # read from a folder in no time
        (
            [(0.0, 0.0), (4.0, 0.1), (4.1, 0.25), (10.0, 0.25)],
            "25%, about 30 s left",
        ),  # an easy part of the work
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


def test_a_terminal_shows_that_something_starts_until_the_first_step(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", screen)
    with Console() as shown:
        assert "Starting" in screen.getvalue()
        with shown.track("Survey"):
            begun = len(screen.getvalue())
        shown.track("Training")
    assert "Starting" not in screen.getvalue()[begun:]
    assert "Survey" in screen.getvalue()[begun:]
