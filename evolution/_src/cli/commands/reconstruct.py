"""`symbrion reconstruct`: turn points or a scan log into a surface."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import reconstruction as rc
from evolution._src.cli.command import UsageError, require_own_archive, require_writable_file
from evolution._src.cli.console import Console
from evolution._src.cli.quality_rows import make_surface_rows
from evolution._src.cli.scan_source import ScanCommand
from evolution._src.cli.tile_options import TileOptions
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.range_checks import format_extents

if TYPE_CHECKING:
    import trimesh

    from reconstruction._src.knowledge.slip.patches import FrictionEstimate

MESH_ENDINGS = (".ply", ".obj", ".stl", ".off", ".glb")
MINIMUM_UNITS = 4  # A network begins as a tetrahedron or a square


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reconstruct(TileOptions, ScanCommand):
    """Reconstruct a surface from a scan log or a point cloud with a self-organizing network.

    Example: symbrion reconstruct survey.npz --out pit.npz

    Example: symbrion reconstruct room.e57 --crop auto --out room.npz

    Example: symbrion reconstruct scan.dat.bz2 --crop 0.4 9.6 -4.3 1.4 -1 2 --units 1500 --out stairs.ply

    Example: symbrion reconstruct valley.laz --tile 50 --workers 2 --out tiles
    """

    out: Path = Path("surface.npz")
    """Output file: .npz contains the network, which can be refined; .ply .obj .stl .off .glb only the mesh."""
    method: Literal["gsrm", "gg"] = "gsrm"
    """gsrm: growing self-reconstruction map, for any surface; gg: growing grid, for a single sheet such as terrain."""
    units: int | None = None
    """Number of units of the network (vertices of the mesh): the resolution. Default: enough for the scan."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tile is not None:
            self.check_tiles(self.out)
            return
        require_writable_file(self.out, "--out", (".npz", *MESH_ENDINGS))
        if self.out == Reconstruct.out:
            require_own_archive(self.out, "--out", "header")
        if self.out.exists() and self.out.samefile(self.source):
            raise UsageError(f"--out {self.out} is the scan itself; give another name")
        self.require_least(units=MINIMUM_UNITS)

    def run(self, console: Console) -> dict[str, Any]:
        if self.tile is not None:
            return self.run_tiles(
                console,
                self.source,
                self.out,
                method=self.method,
                seed=self.seed,
                unit=self.unit,
                viewpoints=self.viewpoint,
                is_raw=self.raw,
            )
        with console.track(f"Reading {self.source.name}"):
            scan = self.read_scan()
        console.print_line(
            f"{self.source.name}: {scan.readings.describe()}; {scan.points.num_points} are used"
        )
        size = "" if self.units is None else f", {self.units} units"
        with console.track(f"Network {self.method}{size}") as step:
            result = rc.reconstruct(
                scan.points,
                method=self.method,
                units=self.units,
                seed=self.seed,
                progress=step.progress,
                readings=scan.readings,
            )
            if scan.slip is not None:
                result = result.refine(slip=scan.slip)
        quality = result.quality()
        self.out.parent.mkdir(parents=True, exist_ok=True)
        if self.out.suffix == ".npz":
            result.save(self.out)
        else:
            export_mesh(result.mesh, self.out)
        console.print_line(
            f"{len(result.mesh.vertices)} vertices, {len(result.mesh.faces)} faces in {self.out}"
        )
        low, high = result.mesh.bounds.tolist()
        console.print_line(f"the surface extends over {format_extents(low, high)}")
        console.show_table(
            "Quality",
            ["measure", "value"],
            make_surface_rows(quality),
        )
        for subject, note in result.notes.items():
            console.print_line(f"{subject}: {note}")
        for line in describe_friction(result.friction):
            console.print_line(line)
        return {
            "mesh": self.out,
            "points": scan.points.num_points,
            "readings": scan.readings.num_points,
            "viewpoints": 0 if result.viewpoints is None else len(result.viewpoints),
            "offset": result.offset.tolist(),
            "bounds": [low, high],
            "notes": result.notes,
            "seconds": step.seconds,
            "quality": quality.as_dict(),
        }


def describe_friction(felt: "FrictionEstimate | None") -> list[str]:
    """Return a line for the friction of each patch that robots felt."""
    return [
        f"friction {patch.friction:.2f} ± {patch.half_width:.2f} of {patch.num_readings} readings, "
        + ("patch" if len(patch.rectangles) else "ground")
        for patch in ([] if felt is None else felt.patches)
    ]


def export_mesh(mesh: "trimesh.Trimesh", path: Path) -> None:
    """Write a mesh file atomically."""
    with write_atomically(path) as beside:
        mesh.export(beside)
