"""`symbrion reconstruct`: turn points or a scan log into a surface."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro
from jaxtyping import Float

import reconstruction as rc
from evolution.cli.command import (
    SeededCommand,
    UsageError,
    require_file,
    require_own_archive,
    require_writable_file,
)
from evolution.cli.console import Console
from evolution.cli.tile_options import TileOptions
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.bounded_read import MAX_BYTES, UnreadableFileError, find_npz_names

if TYPE_CHECKING:
    import trimesh

MESH_ENDINGS = (".ply", ".obj", ".stl", ".off", ".glb")
MINIMUM_UNITS = 4
"""A network begins as a tetrahedron or a square."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reconstruct(TileOptions, SeededCommand):
    """Reconstruct a surface from a scan log or a point cloud with a self-organizing network.

    Example: symbrion reconstruct survey.npz --out pit.npz

    Example: symbrion reconstruct scan.dat.bz2 --crop 0.4 9.6 -4.3 1.4 -1 2 --units 1500 --out stairs.ply

    Example: symbrion reconstruct valley.laz --tile 50 --workers 2 --out tiles
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCAN")]
    """A scan log (.npz, .3d) or points (.xyz .txt .csv .dat .npy .npz .ply .pcd .vtk .obj), also as .gz or .bz2."""
    out: Path = Path("surface.npz")
    """Output file: .npz contains the network, which can be refined; .ply .obj .stl .off .glb only the mesh."""
    method: Literal["gsrm", "gg"] = "gsrm"
    """gsrm: growing self-reconstruction map, for any surface; gg: growing grid, for a single sheet such as terrain."""
    units: int = 2200
    """Number of units of the network (vertices of the mesh): the resolution."""
    unit: Literal["m", "cm", "mm"] = "m"
    """Length unit of a point file."""
    crop: tuple[float, float, float, float, float, float] | None = None
    """Use only the points in this box: XMIN XMAX YMIN YMAX ZMIN ZMAX [m]."""
    thin: float | None = None
    """Keep one point per cube of this edge length [m]. Default: 0.015 for scan logs, no thinning for points."""
    max_gigabytes: float = MAX_BYTES / 1e9
    """Largest size of SCAN after decompression, and of its points in memory (24 bytes each) [10^9 bytes]."""
    raw: bool = False
    """Use the points without pre-processing (leveling, smoothing, filters)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_file(self.source, "SCAN")
        if self.tile is not None:
            self.check_tiles(self.out)
            return
        require_writable_file(self.out, "--out", (".npz", *MESH_ENDINGS))
        if self.out == Reconstruct.out:
            require_own_archive(self.out, "--out", "header")
        if self.out.exists() and self.out.samefile(self.source):
            raise UsageError(f"--out {self.out} is the scan itself; give another name")
        if self.units < MINIMUM_UNITS:
            raise UsageError(f"--units {self.units} is too few; give {MINIMUM_UNITS} or more")
        if not self.max_gigabytes > 0:
            raise UsageError(f"--max-gigabytes {self.max_gigabytes} is not a limit; give a number above 0")
        if self.thin is not None and not self.thin > 0:
            raise UsageError(f"--thin {self.thin} is not an edge length; give meters above 0")
        if self.crop is not None and not all(
            low < high for low, high in zip(self.crop[::2], self.crop[1::2], strict=True)
        ):
            raise UsageError(
                f"--crop {' '.join(map(str, self.crop))} is empty; give XMIN XMAX YMIN YMAX ZMIN ZMAX"
            )

    def run(self, console: Console) -> dict[str, Any]:
        if self.tile is not None:
            return self.run_tiles(
                console,
                self.source,
                self.out,
                method=self.method,
                seed=self.seed,
                unit=self.unit,
                is_raw=self.raw,
            )
        with console.track(f"Reading {self.source.name}"):
            points = self._read_points()
        with console.track(f"Network {self.method}, {self.units} units") as step:
            result = rc.reconstruct(
                points, method=self.method, units=self.units, seed=self.seed, progress=step.progress
            )
        quality = result.quality().as_dict()
        self.out.parent.mkdir(parents=True, exist_ok=True)
        if self.out.suffix == ".npz":
            result.save(self.out)
        else:
            export_mesh(result.mesh, self.out)
        console.print_line(
            f"{len(result.mesh.vertices)} vertices, {len(result.mesh.faces)} faces in {self.out}"
        )
        console.show_table(
            "Quality",
            ["measure", "value"],
            [[name, format_value(value)] for name, value in flatten(quality).items()],
        )
        return {"mesh": self.out, "points": len(points), "seconds": step.seconds, "quality": quality}

    def _read_points(self) -> Float[np.ndarray, "N 3"]:
        """Return the points of SCAN, pre-processed, cropped and thinned as the options say [m]."""
        max_bytes = 1e9 * self.max_gigabytes
        source = rc.load_scan_log(self.source, max_bytes) if is_scan_log(self.source) else self.source
        if isinstance(source, rc.ScanLog):
            points = source.points() if self.raw else rc.preprocess(source)
        else:
            points = rc.load_points(source, self.unit, max_bytes)
            points = points if self.raw else rc.preprocess(points)
        if self.crop is not None:
            points = rc.crop(points, np.reshape(self.crop, (3, 2)).T)
        from symbrion_gym.ready_made import SPACING

        spacing = SPACING if self.thin is None and isinstance(source, rc.ScanLog) else self.thin
        return points if spacing is None else rc.thin(points, spacing)


def is_scan_log(path: Path) -> bool:
    """Return whether a file contains scans with poses, rather than points."""
    if path.suffix == ".3d":
        return True
    try:
        return path.suffix == ".npz" and "ranges" in find_npz_names(path)
    except UnreadableFileError:
        return False


def export_mesh(mesh: "trimesh.Trimesh", path: Path) -> None:
    """Write a mesh file atomically."""
    with write_atomically(path) as beside:
        mesh.export(beside)


def flatten(measures: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested measures as a flat table, "group: name" -> value, without those that are None."""
    rows: dict[str, Any] = {}
    for name, value in measures.items():
        label = f"{prefix}{name}".replace("_", " ")
        if isinstance(value, dict):
            rows |= flatten(value, f"{label}: ")
        elif value is not None:
            rows[label] = value
    return rows


def format_value(value: object) -> str:
    """Return a measure as text, with four significant digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
