"""`symbrion survey`: scan an arena with the virtual robot."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import tyro

import symbrion_gym as sg
from evolution.commands.arguments import check_arena
from evolution.commands.command import Command, require_writable_file
from evolution.commands.console import Console


@dataclasses.dataclass(frozen=True, kw_only=True)
class Survey(Command):
    """Drive the virtual robot with its two SICK laser scanners through an arena and keep the scan log.

    Example: symbrion survey truth --out survey.npz
    """

    arena: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ARENA")] = "truth"
    """A named arena (truth, simple, gsrm, gg), an arena folder, or a mesh file."""
    out: Path = Path("survey.npz")
    """Where the scan log goes (.npz)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_arena(self.arena)
        require_writable_file(self.out, "--out", (".npz",))

    def run(self, console: Console) -> dict[str, Any]:
        with console.track(f"Survey of {self.arena}") as step:
            log = sg.survey(self.arena, seed=self.seed, progress=step.progress)
            self.out.parent.mkdir(parents=True, exist_ok=True)
            log.save(self.out)
        scans, beams = log.ranges.shape
        console.say(f"{scans} scans of {beams} beams in {self.out}")
        console.say(f"next: symbrion reconstruct {self.out} --out surface.npz")
        return {"log": self.out, "scans": scans, "beams": beams, "seconds": step.seconds}
