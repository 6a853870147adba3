"""`symbrion reconstruct`: turn points or a scan log into a surface, or a scan larger than memory into tiles."""

import dataclasses
import math
from pathlib import Path
from typing import Any, Literal

import reconstruction as rc
from evolution._src.cli.command import (
    UsageError,
    require_own_archive,
    require_writable_file,
    require_writable_folder,
)
from evolution._src.cli.console import Console
from evolution._src.cli.scan_source import ScanCommand
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.range_checks import format_count, format_distance, format_extents, format_share
from reconstruction._src.scans.frames import UNITS

MESH_ENDINGS = (".ply", ".obj", ".stl", ".off", ".glb")
MINIMUM_UNITS = 4  # A network begins as a tetrahedron or a square
_NOT_IN_TILES = ("crop", "thin", "units", "up", "scale", "intrinsics", "vertices")
"""Options that a tiled reconstruction does not have."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reconstruct(ScanCommand):
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
    tile: float | None = None
    """Reconstruct in square tiles with this edge [m]: for .las .laz .npy larger than memory. --out is then a folder."""
    units_per_area: float | None = None
    """With --tile: units of the network in a square meter. Default: one for 20 points."""
    workers: int = 1
    """With --tile: number of processes."""

    def check(self) -> None:
        super().check()
        if self.tile is not None:
            require_writable_folder(self.out, "--out")
            self._divide(self.tile)
            for name in _NOT_IN_TILES:
                if getattr(self, name) != getattr(Reconstruct, name):
                    remedy = "use --units-per-area" if name == "units" else "leave it out"
                    raise UsageError(f"--{name} does not go with --tile; {remedy}")
            return
        require_writable_file(self.out, "--out", (".npz", *MESH_ENDINGS))
        if self.out == Reconstruct.out:
            require_own_archive(self.out, "--out", "header")
        if self.out.exists() and self.out.samefile(self.source):
            raise UsageError(f"--out {self.out} is the scan itself; give another name")
        self.require_least(units=MINIMUM_UNITS)

    def _divide(self, tile: float) -> "rc.TilesConfig":
        return rc.TilesConfig(tile=tile, units_per_area=self.units_per_area)

    def run(self, console: Console) -> dict[str, Any]:
        if self.tile is not None:
            return self._run_tiles(self._divide(self.tile), console)
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
            with write_atomically(self.out) as beside:
                result.mesh.export(beside)
        bounds = result.mesh.bounds.tolist()
        console.print_line(
            f"{len(result.mesh.vertices)} vertices, {len(result.mesh.faces)} faces in {self.out}"
        )
        console.print_line(f"the surface extends over {format_extents(*bounds)}")
        console.show_table("Quality", ["measure", "value"], _make_quality_rows(quality))
        for subject, note in result.notes.items():
            console.print_line(f"{subject}: {note}")
        for patch in result.friction.patches if result.friction else ():
            place = "patch" if len(patch.rectangles) else "ground"
            friction = f"friction {patch.friction:.2f} ± {patch.half_width:.2f}"
            console.print_line(f"{friction} of {patch.num_readings} readings, {place}")
        return {
            "mesh": self.out,
            "points": scan.points.num_points,
            "readings": scan.readings.num_points,
            "viewpoints": 0 if result.viewpoints is None else len(result.viewpoints),
            "offset": result.offset.tolist(),
            "bounds": bounds,
            "notes": result.notes,
            "seconds": step.seconds,
            "quality": quality.as_dict(),
        }

    def _run_tiles(self, config: "rc.TilesConfig", console: Console) -> dict[str, Any]:
        """Reconstruct a scan in tiles and return the summary."""
        with console.track(f"Tiles of {self.source.name}") as step:
            tiles = rc.reconstruct_tiles(
                self.source,
                self.out,
                config,
                method=self.method,
                seed=self.seed,
                meters=None if self.unit is None else UNITS[self.unit],
                viewpoints=self.viewpoint or None,
                is_raw=self.raw,
                workers=self.workers,
                progress=step.progress,
            )
        number = len(tiles.places)
        console.print_line(f"{format_count(number, 'tile')} of {tiles.tile:g} m in {self.out}")
        return {"tiles": self.out, "number": number, "offset": list(tiles.offset), "seconds": step.seconds}


def _make_quality_rows(quality: "rc.Quality") -> list[list[object]]:
    """Return measure and value of what is known about a surface."""
    topology = quality.topology
    rows: list[list[object]] = [
        ["vertices, faces", f"{topology.num_vertices}, {topology.num_faces}"],
        ["area", f"{quality.area:.4g} m²"],
        ["parts", topology.components],
        ["boundary loops", topology.boundary_loops],
        ["non manifold edges, pinched vertices", f"{topology.non_manifold_edges}, {topology.pinched_vertices}"],
        ["self intersections, folds", f"{quality.self_intersections}, {quality.folds}"],
        ["smallest angle of a face: mean", f"{math.degrees(quality.min_angle):.1f}°"],
        ["faces with an angle below 10°", format_share(quality.slivers)],
    ]  # fmt: skip
    if quality.cloud_to_mesh is not None:
        distances = quality.cloud_to_mesh.mean, quality.cloud_to_mesh.p95, quality.cloud_to_mesh.max
        rows.append(["cloud to mesh: mean, p95, max", ", ".join(map(format_distance, distances))])
    return rows
