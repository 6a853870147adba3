"""`symbrion assets`: make the ready-made arenas again."""

import dataclasses
from pathlib import Path
from typing import Any

from evolution._src.cli.command import SeededCommand, require_writable_folder
from evolution._src.cli.console import Console
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.quantities import format_count


@dataclasses.dataclass(frozen=True, kw_only=True)
class Assets(SeededCommand):
    """Make the ready-made arenas truth, simple, gsrm and gg again: survey, networks, convex pieces.

    Example: symbrion assets --out assets/arenas
    """

    out: Path = Path("arenas")
    """Output folder; each arena becomes a folder in it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion assets`", "scan")
        from symbrion_gym._src.ready_made import make_ready_made

        with console.track("Ready-made arenas") as step:
            arenas = make_ready_made(self.out, seed=self.seed, progress=step.progress)
        for name, arena in arenas.items():
            console.print_line(
                f"{self.out / name}: {format_count(len(arena.pieces), 'piece')}, {len(arena.surface.faces)} faces"
            )
        return {"arenas": {name: self.out / name for name in arenas}, "seconds": step.seconds}
