"""`symbrion swarm`: single robots gather, dock, cross a pit as one body, and part."""

import dataclasses
import os
from pathlib import Path
from typing import Any

from evolution._src.cli.command import (
    SeededCommand,
    TrustingCommand,
    UsageError,
    require_writable_folder,
)
from evolution._src.cli.console import Console
from evolution._src.errors import RunError
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras


@dataclasses.dataclass(frozen=True, kw_only=True)
class Swarm(SeededCommand, TrustingCommand):
    """Let single robots, scattered before a pit that none of them can cross, become one body that crosses it.

    One meets the pit and becomes the seed; the others find its beacon, dock and lock; the organism crosses with an
    evolved champion in full contact; then all undock and go on. The same command again goes on where it was
    interrupted.

    Example: symbrion swarm --arena gsrm --out swarm
    """

    out: Path = Path("swarm")
    """Output folder: champion, track, timeline, film and figures."""
    arena: str = "gsrm"
    """Arena with a pit: a name, folder or file."""
    robots: int = 8
    """Number of robots, and length of the snake that they become."""
    champion: Path | None = None
    """Run folder or file of a champion of that length; by default one evolves in the arena."""
    workers: int = os.cpu_count() or 1
    """Threads of its evolution; the results do not depend on their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")
        self.require_least(robots=2, workers=1)

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion swarm`", "report")
        from evolution._src.experiments.swarm.run import SwarmRunConfig, run_swarm
        from evolution._src.experiments.swarm.story import StoryConfig

        try:
            story = StoryConfig(arena=self.arena, seed=self.seed, num_robots=self.robots)
        except RunError as error:
            raise UsageError(str(error)) from error
        config = SwarmRunConfig(self.out, story, self.champion, self.workers, self.allow_code)
        track, stories = run_swarm(config, console.track)
        self._show(track, stories[0], console)
        rows = [
            [row["seed"], "yes" if row["docks"] else "no", "yes" if row["success"] else "no",
             "-" if row["gathered"] is None else row["gathered"], "-" if row["crossed"] is None else row["crossed"],
             row["recoveries"], row["across"], row["reason"]]
            for row in stories
        ]  # fmt: skip
        columns = [
            "seed",
            "docks",
            "success",
            "whole [s]",
            "across [s]",
            "recoveries",
            "robots across",
            "why not",
        ]
        console.show_table(f"Stories of {self.robots} robots in {self.arena}", columns, rows)
        outcome = "is across" if stories[0]["success"] else "is not across"
        console.print_line(f"The swarm {outcome}; {self.out}")
        return {"folder": self.out, "success": stories[0]["success"], "stories": stories}

    def _show(self, track: Any, row: dict[str, Any], console: Console) -> None:
        """Write timeline and film of the first story."""
        import symbrion_gym as sg
        from evolution._src.experiments.swarm.film import draw_timeline, encode_film
        from evolution._src.report.figures import to_png
        from symbrion_gym._src.swarm.placing import find_field

        arena = sg.load_arena(self.arena)
        field = find_field(arena, self.robots)
        crossing = None if row["crossed"] is None else (row["gathered"], row["crossed"])
        with write_atomically(self.out / "timeline.png") as beside:
            beside.write_bytes(to_png(draw_timeline(track, field, crossing)))
        if not (self.out / "film.mp4").exists():
            with console.track("film") as step:
                film = encode_film(track, arena, field, crossing, step.progress)
            if film is None:
                console.print_line("no film: this machine has no OpenGL")
                return
            with write_atomically(self.out / "film.mp4") as beside:
                beside.write_bytes(film)
