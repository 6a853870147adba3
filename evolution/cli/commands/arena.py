"""`symbrion arena`: turn a surface into geometry that MuJoCo can drive on."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import reconstruction as rc
import symbrion_gym as sg
from evolution.cli.command import SeededCommand, UsageError, require_file, require_writable_folder
from evolution.cli.commands.reconstruct import format_value
from evolution.cli.console import Console


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arena(SeededCommand):
    """Decompose a surface into convex pieces for contact, keep it exactly for rays; write a folder.

    Example: symbrion arena surface.npz --out arenas/pit
    """

    mesh: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="MESH")]
    """A reconstruction of `symbrion reconstruct` (.npz) or a mesh file (.ply .obj .stl .off .glb)."""
    out: Path = Path("arena")
    """The arena's folder: MJCF for MuJoCo's viewer, meshes, arena.json. Of what it holds, only an arena is replaced."""
    accuracy: float = 0.003
    """Wanted mean distance of the contact surface from the mesh [m]."""
    kind: Literal["convex", "hfield", "prisms", "primitives"] = "convex"
    """Contact geometry: convex pieces (default), height field, exact prisms (slow), or planes as boxes."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_file(self.mesh, "MESH")
        require_writable_folder(self.out, "--out")
        try:
            from symbrion_gym.arenas.saving import find_own_files

            find_own_files(self.out)
        except sg.ArenaError as error:
            raise UsageError(f"--out {error}") from error
        if not self.accuracy > 0:
            raise UsageError(f"--accuracy {self.accuracy} is no distance; give metres above 0, 0.003 say")

    def run(self, console: Console) -> dict[str, Any]:
        mesh = rc.Reconstruction.load(self.mesh).mesh if self.mesh.suffix == ".npz" else self.mesh
        with console.track(f"Arena from {self.mesh.name}") as step:
            arena = sg.make_arena(
                mesh, accuracy=self.accuracy, kind=self.kind, seed=self.seed, progress=step.progress
            )
            arena.save(self.out)
        quality = dataclasses.asdict(arena.quality)
        console.say(
            f"{len(arena.pieces)} pieces in {self.out}; "
            f"look at it: python -m mujoco.viewer --mjcf={self.out}/arena.xml"
        )
        console.show_table(
            "Contact surface against the mesh",
            ["measure", "value"],
            [[k, format_value(v)] for k, v in quality.items()],
        )
        return {"folder": self.out, "pieces": len(arena.pieces), "seconds": step.seconds, "quality": quality}
