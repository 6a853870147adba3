"""`symbrion replay`: judge a champion again, record a video of it, watch it."""

import dataclasses
import os
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import evolution as ev
from evolution._src.cli.command import (
    SeededCommand,
    TrustingCommand,
    UsageError,
    check_arena,
    require_writable_file,
)
from evolution._src.cli.commands.evolve import find_replay_arena, require_run
from evolution._src.cli.console import Console
from evolution._src.search.run import RunFolder
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count

SPEED = 5.0  # Playback speed of video and viewer, relative to real time


@dataclasses.dataclass(frozen=True, kw_only=True)
class Replay(SeededCommand, TrustingCommand):
    """Judge the champion of a run by randomized trials; record one trial as a video, or watch it.

    Example: symbrion replay runs/a --arena truth --video champion.mp4
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder."""
    arena: str | None = None
    """Arena of the trials: a ready-made arena by name, an arena folder, or a mesh file. Default: the true
    course; of a search for bodies in an arena of your own, that arena."""
    trials: int = 20
    """Number of trials, randomized in start, heading, friction and torque; 0 skips them."""
    start: Literal["floor", "pit"] | tuple[float, float] | None = None
    """Start of a trial: on the floor before the first ramp, just before the pit, or X Y [m]. Default: as in the run
    where that had a place or a task, otherwise the floor."""
    video: Path | None = None
    """Record one trial without randomization in this file (.mp4)."""
    page: Path | None = None
    """Of a search for bodies: write a page (.html), a grid of the fittest bodies; a click shows it drive."""
    films: int = 6
    """Films on that page, of the fittest bodies."""
    viewer: bool = False
    """Show one trial without randomization in MuJoCo's viewer."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_run(self.folder)
        if self.arena is not None:
            check_arena(self.arena)
        self.require_least(trials=0, films=0)
        if self.video is not None:
            require_writable_file(self.video, "--video", (".mp4",))
        if self.page is not None:
            require_writable_file(self.page, "--page", (".html",))
            if not RunFolder(self.folder).has_bodies():
                raise UsageError(f"--page {self.page}: {self.folder} is no search for bodies; leave it out")

    def run(self, console: Console) -> dict[str, Any]:
        """Judge, record and show the champion."""
        if self.video is not None:
            require_extras("`symbrion replay --video`", "report")
        if self.page is not None:
            require_extras("`symbrion replay --page`", "report")
        champion = ev.load_run(self.folder).champion
        if champion is None:
            raise ev.RunError(f"{self.folder} has no champion yet; `symbrion resume {self.folder}` first")
        arena = self.arena or (
            find_replay_arena(champion.arena) if RunFolder(self.folder).has_bodies() else "truth"
        )
        summary: dict[str, Any] = {"arena": arena, "trials": self.trials, "champion": champion.as_dict()}
        if self.trials:
            with console.track(f"{format_count(self.trials, 'trial')} in {arena}"):
                outcome = ev.judge(
                    champion,
                    arena,
                    self.trials,
                    self.seed,
                    start=self.start,
                    workers=os.cpu_count() or 1,
                    allow=self.allow_code,
                )
            console.print_line(
                f"the champion succeeds in {outcome.successes} of {outcome.trials} trials in {arena}"
            )
            summary["successes"] = outcome.successes
        if self.video is not None:
            summary["video"] = self._film(champion, arena, console)
        if self.page is not None:
            self._write_page(self.page, console)
            summary["page"] = self.page
        if self.viewer:
            self._show(champion, arena, console)
        return summary

    def _write_page(self, path: Path, console: Console) -> None:
        from evolution._src.report.body_page import make_body_page

        path.parent.mkdir(parents=True, exist_ok=True)  # fails before the films
        with console.track("Page of bodies") as step:
            page = make_body_page(
                ev.load_bodies(self.folder, self.allow_code), self.films, self.seed, step.progress
            )
        page.write(path)
        console.print_line(f"{path}: a click on a body shows it drive")

    def _show(self, champion: "ev.Champion", arena: str, console: Console) -> None:
        recording = ev.play(
            champion, arena, self.seed, start=self.start, window=True, speed=SPEED, allow=self.allow_code
        )
        verdict = "succeeds" if recording.success else "does not succeed"
        console.print_line(f"{recording.seconds:.1f} s of robot time, the champion {verdict}")

    def _film(self, champion: "ev.Champion", arena: str, console: Console) -> Path | None:
        assert self.video is not None
        from evolution._src.report.video import encode_video

        with console.track("Video"):
            recording = ev.play(
                champion,
                arena,
                self.seed,
                start=self.start,
                film=True,
                speed=SPEED,
                allow=self.allow_code,
            )
        if not recording.frames:
            console.print_line("no video: this machine has no OpenGL")
            return None
        self.video.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(self.video) as beside:
            beside.write_bytes(encode_video(recording.frames, recording.fps))
        verdict = "succeeds" if recording.success else "does not succeed"
        console.print_line(f"{self.video}: {recording.seconds:.1f} s of robot time, the champion {verdict}")
        return self.video
