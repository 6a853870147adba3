"""`symbrion arena`: turn a surface into geometry for MuJoCo."""

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
    """Decompose a surface into convex pieces for contact, keep the exact surface for rays, and write both as a folder.

    Example: symbrion arena surface.npz --out arenas/pit
    """

    mesh: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="MESH")]
    """A reconstruction by `symbrion reconstruct` (.npz) or a mesh file (.ply .obj .stl .off .glb)."""
    out: Path = Path("arena")
    """Output folder: MJCF for MuJoCo's viewer, meshes, arena.json. An arena in it is replaced, other files are kept."""
    accuracy: float = 0.003
    """Target of the mean distance between contact geometry and mesh [m]."""
    kind: Literal["convex", "hfield", "prisms", "primitives"] = "convex"
    """Contact geometry: convex pieces, a height field, one prism per triangle (slow), or boxes where planes fit."""

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
            raise UsageError(
                f"--accuracy {self.accuracy} is not a distance; give meters above 0, for example 0.003"
            )

    def run(self, console: Console) -> dict[str, Any]:
        mesh = rc.Reconstruction.load(self.mesh).mesh if self.mesh.suffix == ".npz" else self.mesh
        with console.track(f"Arena from {self.mesh.name}") as step:
            arena = sg.make_arena(
                mesh, accuracy=self.accuracy, kind=self.kind, seed=self.seed, progress=step.progress
            )
            arena.save(self.out)
        quality = dataclasses.asdict(arena.quality)
        console.print_line(
            f"{len(arena.pieces)} pieces in {self.out}; "
            f"to view it: python -m mujoco.viewer --mjcf={self.out}/arena.xml"
        )
        console.show_table(
            "Distance of the contact geometry from the mesh",
            ["measure", "value"],
            [[name, format_value(value)] for name, value in quality.items()],
        )
        return {"folder": self.out, "pieces": len(arena.pieces), "seconds": step.seconds, "quality": quality}
