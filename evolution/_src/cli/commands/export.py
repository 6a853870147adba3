"""`symbrion export`: write an arena for other simulators and robots."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import symbrion_gym as sg
from evolution._src.cli.command import Command, UsageError, check_arena, require_writable_folder
from evolution._src.cli.console import Console
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count


@dataclasses.dataclass(frozen=True, kw_only=True)
class Export(Command):
    """Write an arena as a folder that other simulators load without this package, with loaders and a license note.

    Example: symbrion export arenas/mine --to usd --out mine-usd
    """

    arena: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ARENA")]
    """A folder by `symbrion arena`, a ready-made arena (truth, simple, gsrm, gg, stairs) or a mesh file."""
    to: Literal["mjcf", "urdf", "usd", "obj"] = "mjcf"
    """mjcf: MuJoCo, mjlab, Playground; urdf: PyBullet, Gazebo, Drake; usd: Isaac Lab, Newton (extra `usd`); obj."""
    out: Path = Path("export")
    """Output folder. An export in it is replaced, other files are kept."""

    def __post_init__(self) -> None:
        check_arena(self.arena)
        require_writable_folder(self.out, "--out")
        from symbrion_gym._src.arenas.export.export import find_own_files

        try:
            find_own_files(self.out)
        except sg.ArenaError as error:
            raise UsageError(f"--out {error}") from error

    def run(self, console: Console) -> dict[str, Any]:
        if self.to == "usd":
            require_extras("`symbrion export --to usd`", "usd")
        with console.track(f"Export to {self.to}"):
            arena = sg.load_arena(self.arena)
            about = arena.export(self.out, self.to)
        solids, pieces = (
            format_count(about["num_solids"], "convex solid"),
            format_count(about["num_pieces"], "piece"),
        )
        console.print_line(
            f"{solids} in {self.out} (from {pieces}); {self.out}/README.md says how to load it"
        )
        return {"folder": self.out, **about}
