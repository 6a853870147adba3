"""`symbrion replay`: judge a champion again, record a video of it, watch it."""

import dataclasses
import functools
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
from evolution._src.cli.commands.evolve import require_run
from evolution._src.cli.console import Console
from evolution._src.search.run import RunFolder
from reconstruction._src.base.atomic_write import write_file
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.assets import SCANNED

SPEED = 5.0  # Playback speed of video and viewer, relative to real time
MODELS_OF_TRUTH = ("simple", *SCANNED)  # Named arenas that are models of the true course


@dataclasses.dataclass(frozen=True, kw_only=True)
class Replay(SeededCommand, TrustingCommand):
    """Judge the champion of a run by randomized trials; record one trial as a video, or watch it.

    Example: symbrion replay runs/a --arena truth --video champion.mp4
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder."""
    arena: str | None = None
    """Arena of the trials: a ready-made arena by name, an arena folder, or a mesh file. Default: that of the run; the
    true course for its ready-made models (simple, gsrm, gg)."""
    trials: int = 20
    """Number of trials, randomized as in the run, but for the length of the arena; 0 skips them."""
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

    def check(self) -> None:
        super().check()
        require_run(self.folder)
        if self.arena is not None:
            check_arena(self.arena)
        self.require_least(trials=0, films=0)
        require_writable_file(self.video, "--video", (".mp4",))
        require_writable_file(self.page, "--page", (".html",))
        if self.page is not None and not RunFolder(self.folder).has_bodies():
            raise UsageError(f"--page {self.page}: {self.folder} is no search for bodies; leave it out")

    def run(self, console: Console) -> dict[str, Any]:
        if self.video is not None or self.page is not None:
            require_extras("`symbrion replay` with --video or --page", "report")
        run = ev.load_run(self.folder)
        champion = run.champion
        if champion is None:
            raise ev.RunError(f"{self.folder} has no champion yet; `symbrion resume {self.folder}` first")
        arena = self.arena or choose_arena(champion.arena)
        summary: dict[str, Any] = {"arena": arena, "trials": self.trials, "champion": champion.to_json()}
        options: dict[str, Any] = {"start": self.start, "allow": self.allow_code}
        if self.trials:
            with console.track(f"{format_count(self.trials, 'trial')} in {arena}"):
                workers = os.cpu_count() or 1
                conditions = dataclasses.replace(run.config.randomization, stretch=(1.0,))
                outcome = ev.judge(
                    champion,
                    arena,
                    self.trials,
                    self.seed,
                    randomization=conditions,
                    workers=workers,
                    **options,
                )
            rate = f"{outcome.successes} of {outcome.trials} trials"
            console.print_line(f"the champion succeeds in {rate} in {arena}")
            summary["successes"] = outcome.successes
        play = functools.partial(ev.play, champion, arena, self.seed, speed=SPEED, **options)
        if self.video is not None:
            with console.track("Video"):
                film = play(film=True)
            summary["video"] = self.video if film.frames else None
            if film.frames:
                from evolution._src.report.video import encode_video

                write_file(self.video, encode_video(film.frames, film.fps))
                console.print_line(f"{self.video}: {_describe(film)}")
            else:
                console.print_line("no video: this machine has no OpenGL")
        if self.page is not None:
            from evolution._src.report.body_page import make_body_page
            from evolution._src.search.bodies.run import BodyRun

            self.page.parent.mkdir(parents=True, exist_ok=True)  # fails before the films
            bodies = ev.load_run(self.folder, self.allow_code)
            assert isinstance(bodies, BodyRun)
            with console.track("Page of bodies") as step:
                make_body_page(bodies, self.films, self.seed, step.progress).write(self.page)
            console.print_line(f"{self.page}: a click on a body shows it drive")
            summary["page"] = self.page
        if self.viewer:
            console.print_line(_describe(play(window=True)))
        return summary


def choose_arena(arena: str) -> str:
    """Return where a champion is tested: in the true course for models of it, else where it evolved."""
    return "truth" if arena in MODELS_OF_TRUTH else arena


def _describe(recording: "ev.Recording") -> str:
    verdict = "succeeds" if recording.success else "does not succeed"
    return f"{recording.seconds:.1f} s of robot time, the champion {verdict}"
